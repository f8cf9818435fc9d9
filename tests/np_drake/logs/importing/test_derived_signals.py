"""Laws of rates and velocity that a log lacks, derived from attitude and position of any rate."""

import numpy as np
import pytest

from np_drake import attitude
from np_drake.logs.importing.alignment import align
from np_drake.logs.importing.log_map import LogMap, Source
from np_drake.logs.importing.signals import Signal

SECONDS = 4.0
AXIS = np.array([0.36, 0.48, 0.8])
MAP = LogMap(
    command="held_after",
    position=Source(["p"] * 3),
    attitude=Source(["q"] * 4),
    thrust=Source(["f"]),
)


def aligned(position_rate: float, attitude_rate: float, p, angle):
    """Return the rows of a log of position p(t) (n, 3), attitude `angle`(t) about an axis, and
    thrust at 100 Hz.
    """
    at = {
        name: np.arange(0.0, SECONDS, 1.0 / rate)
        for name, rate in (("p", position_rate), ("q", attitude_rate))
    }
    own = np.arange(0.0, SECONDS, 0.01)
    return align(
        {
            "position": Signal(at["p"], p(at["p"])),
            "attitude": Signal(
                at["q"], attitude.from_rotation_vector(angle(at["q"])[:, None] * AXIS)
            ),
            "thrust": Signal(own, np.full((len(own), 1), 20.0)),
        },
        MAP,
    )


@pytest.mark.parametrize("rate", [250.0])
def test_rates_are_those_of_the_middle_between_two_attitudes(rate):
    dut = aligned(100.0, rate, lambda t: np.zeros((len(t), 3)), lambda t: np.sin(4 * t))
    true = 4 * np.cos(4 * dut.t)[:, None] * AXIS
    inside = (dut.t > 0.1) & (dut.t < SECONDS - 0.1)
    bound = (
        64 / 8 * (1 / min(rate, 100.0)) ** 2 + 64 / 24 / rate**2
    )  # of linear interpolation, and of the mean rate
    assert np.abs(dut.values["rates"] - true)[inside].max() < 1.5 * bound


@pytest.mark.parametrize("rate", [30.0, 240.0])
def test_the_velocity_of_a_constant_acceleration_is_exact_at_any_rate(rate):
    slope, bend = np.array([0.5, -0.3, 0.1]), np.array([1.0, 2.0, -0.7])
    dut = aligned(
        rate, 100.0, lambda t: t[:, None] * slope + 0.5 * t[:, None] ** 2 * bend, lambda t: 0.1 * t
    )
    whole = dut.t <= SECONDS - 1 / rate  # the last sample of the position
    np.testing.assert_allclose(
        dut.values["velocity"][whole], (slope + dut.t[:, None] * bend)[whole], atol=1e-6
    )


@pytest.mark.parametrize("rate", [50.0])
def test_noise_of_a_position_is_smoothed_over_a_tenth_of_a_second(rate):
    # Slope of a parabola over n samples: var = 12 sigma^2 / (h^2 n (n^2 - 1)).
    rng, sigma = np.random.default_rng(0), 1e-3
    dut = aligned(
        rate, 100.0, lambda t: sigma * rng.standard_normal((len(t), 3)), lambda t: 0.1 * t
    )
    n = max(5, 2 * round(0.05 * rate) + 1)
    expected = sigma * rate * np.sqrt(12 / (n * (n**2 - 1)))
    inside = (dut.t > 0.2) & (dut.t < SECONDS - 0.2)
    found = np.std(dut.values["velocity"][inside])
    assert 0.6 * expected < found < 1.15 * expected  # rows between the samples are smoother
