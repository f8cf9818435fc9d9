"""Laws of what is left: its share and its probability come from one calculation and never
contradict each other.
"""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.decision import unexplained as dut
from np_drake.diagnosis.decision.unexplained import Indication
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.options import Materiality, Options, Tolerance
from np_drake.diagnosis.residuals import FORCE, make_flight_residuals
from np_drake.diagnosis.result import ResidualFinding
from np_drake.estimation.noise import scale_only
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
WEIGHT = VEHICLE.mass * VEHICLE.gravity
FORCE_NOISE = 0.1  # [N]
EXACT = dc.replace(Options.for_sensors(True), tolerance=dc.replace(Tolerance(), attitude=0.0))


@pytest.fixture(scope="module")
def hover(fly):
    e = make_flight_residuals(
        fly(seed=1, seconds=20.0, noise=0.0, vigour=(0.0, 0.0, 0.0, 0.0)), VEHICLE
    )
    return dc.replace(e, y=np.zeros_like(e.y))


def noise_of(e) -> np.ndarray:
    return np.random.default_rng(0).normal(size=e.y.shape) * (
        [FORCE_NOISE] * 3 + [1e-3] * 3 + [0.01] * 9
    )


def left_of(hover, before, after, indications=(), options=EXACT, own=None):
    """Return the remainder of residuals beyond white noise, which calibration takes from one to the
    other.
    """
    noise = noise_of(hover) if own is None else own
    e = dc.replace(hover, y=noise + after, calibrated=before - after)
    held = HeldOut(
        [e], {e.name: []}, {e.name: e.y}, {e.name: np.ones(len(e.t), bool)}, {e.name: []}
    )
    return dut.measure_remainder([], scale_only([noise], e.grid.step), held, indications, options)


def asked_for(position: float) -> Options:
    return dc.replace(EXACT, materiality=Materiality(position=position))


def push(e, size: float) -> np.ndarray:
    out = np.zeros_like(e.y)
    out[:, 0] = size
    return out


@pytest.mark.parametrize(
    "before, after, material",  # force over the stated one [1]
    [(2.0, 0.8, False), (2.0, 1.2, True), (2.0, 0.95, True), (10.0, 1.2, False), (0.8, 0.8, False)],
)
def test_sizes_share_and_probability_are_one_answer(hover, before, after, material):
    least = EXACT.materiality.remaining_force * WEIGHT
    asked = dc.replace(EXACT, materiality=Materiality(position=10.0))
    found = left_of(hover, push(hover, before * least), push(hover, after * least), options=asked)
    assert found.force == pytest.approx(after * least, rel=0.05)
    assert found.matters == material
    assert not found.share > dut.TOO_MUCH or found.matters


def test_noise_of_torque_leads_as_far_as_it_integrates(hover):
    deviation, step = 0.05, hover.grid.step  # [N·m], of white noise
    own = noise_of(hover)
    own[:, 3:5] *= deviation / 1e-3
    turning = deviation / np.diag(VEHICLE.J)[:2] * VEHICLE.gravity * (step / 252) ** 0.5
    found = left_of(hover, push(hover, 2.0), push(hover, 0.2), own=own)
    expected = (-2 * np.log(1 - dut.ALONE) * turning.prod()) ** 0.5  # of two normal axes
    assert found.noise == pytest.approx(expected, rel=0.2)
    assert 0.05 < found.position < found.noise  # beyond what is asked for, and hidden
    assert found.probability < 0.05
    loud = left_of(hover, push(hover, 2.0), push(hover, 0.2), own=20 * own)
    assert np.isnan(loud.position)  # of which the thrust turns by more than a radian


def test_a_constant_force_moves_the_vehicle_by_half_its_acceleration(hover):
    wrench = push(hover, 0.3)[:, :6]
    moved = dut.squared_position_errors(hover, wrench, np.ones(len(hover.t), bool))
    expected = 0.5 * 0.3 / VEHICLE.mass * dut.HORIZON**2
    np.testing.assert_allclose(moved**0.5, expected, rtol=1e-9)


def test_a_constant_torque_moves_it_by_the_thrust_that_it_turns(hover):
    wrench = np.zeros((len(hover.t), 6))
    wrench[:, 4] = 0.01
    moved = dut.squared_position_errors(hover, wrench, np.ones(len(hover.t), bool))
    expected = VEHICLE.gravity * 0.01 / VEHICLE.J[1, 1] / 24 * dut.HORIZON**4
    np.testing.assert_allclose(moved**0.5, expected, rtol=0.01)  # of trapezoids


@pytest.mark.parametrize("share", [0.1, 0.5])
def test_the_interval_holds_the_share_that_is_left(hover, share):
    found = left_of(hover, push(hover, 2.0), push(hover, 2.0 * share**0.5))
    assert found.ci95[0] <= share <= found.ci95[1]
    assert found.force == pytest.approx(2.0 * share**0.5, rel=0.02)
    assert found.probability > 0.95


def test_a_slow_force_within_the_tolerance_of_the_attitude_is_no_gap(hover):
    tilted = push(hover, 1.0 * Tolerance().attitude * WEIGHT)
    options = dc.replace(Options.for_sensors(True), materiality=Materiality(position=0.01))
    assert np.isnan(left_of(hover, tilted, tilted, options=options).share)
    assert left_of(hover, 3 * tilted, 3 * tilted, options=options).probability > 0.95


def test_structure_in_the_noise_is_left_as_probably_as_it_is_there(hover):
    power = np.zeros(6)
    power[FORCE] = [0.0, 0.6 * FORCE_NOISE**2, 0.0]
    hidden = [Indication(p, ResidualFinding("line", "a line", 1.0), power, 0.0) for p in (0.9,)]
    gap = push(hover, 0.06 * WEIGHT)
    found = left_of(hover, gap, push(hover, 0.0), hidden, asked_for(1e-4))
    none = left_of(hover, gap, push(hover, 0.0), [hidden[0]._replace(probability=0.0)])
    assert none.share < 0.01
    assert found.share > none.share
    assert found.force == pytest.approx((0.9 * 0.6) ** 0.5 * FORCE_NOISE, rel=0.05)
    far = left_of(hover, gap, push(hover, 0.0), [hidden[0]._replace(position=100.0)])
    assert 0 < far.position < far.noise  # structure that the noise holds leads no farther
