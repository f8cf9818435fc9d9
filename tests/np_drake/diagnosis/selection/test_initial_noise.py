import numpy as np
import pytest

from np_drake.diagnosis.options import Options
from np_drake.diagnosis.selection.map_model import noise_of

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)


def _slow_power(noise, channel: int) -> float:
    """One-sided spectral density at 0.1 Hz."""
    return float(noise.spectrum(np.array([0.1]))[channel, 0])


@pytest.fixture
def residual() -> list[np.ndarray]:
    return [np.random.default_rng(1).normal(size=(1000, 15))]


def test_a_force_that_is_explained_is_known_no_better_than_the_attitude(seen, residual):
    force = np.zeros((1000, 15))
    force[:, 0] = 1000.0  # [N]
    rig = REAL
    flights = [seen(seconds=4.0)]
    calm = noise_of(flights, residual, residual, rig)
    pulled = noise_of(flights, residual, [residual[0] + force], rig)
    for channel in range(3):
        assert _slow_power(pulled, channel) > 2.0 * _slow_power(calm, channel)
    for channel in range(3, 15):  # a pull says nothing of torque and sensors
        assert _slow_power(pulled, channel) == pytest.approx(_slow_power(calm, channel))
    laboratory = noise_of(flights, residual, [residual[0] + force], IDEAL)
    assert _slow_power(laboratory, 0) < _slow_power(pulled, 0)


def test_the_power_of_errors_of_measured_rotor_speed_is_added(seen, residual):
    flights = [seen(name=str(i), seed=i, seconds=4.0) for i in (1, 2)]
    quiet = noise_of(flights, 2 * residual, 2 * residual, IDEAL)
    for flight, size in zip(flights, (3.0, 4.0), strict=True):
        vars(flight)["rotor_noise"] = np.where(np.arange(15) == 2, size, 0.0)  # of the lift
    loud = noise_of(flights, 2 * residual, 2 * residual, IDEAL)
    added = loud.innovation - quiet.innovation
    assert added[2] == pytest.approx((9.0 + 16.0) / 2, rel=0.05)
    np.testing.assert_allclose(np.delete(added, 2), 0.0, atol=1e-9)
