"""Laws of the predictors without training, and of the forecast itself."""

import numpy as np
import pytest

from np_drake.residual_model import Sample, WrenchForecast, constant_forecast
from np_drake.residual_models.hold import DisturbanceObserver
from np_drake.vehicle import Vehicle

VEHICLE, STEP = Vehicle(), 0.02
LEVEL = np.array([0, 0, 1.0, 1.0, 0, 0, 0, 0, 0, 0, 0, 0, 0])
CHI = np.array([0.5, -0.3, -2.5, 0.01, -0.02, 0.005])


def fed(dut, samples):
    memory = dut.initial_memory()
    for sample in samples:
        memory = dut.update(memory, sample)
    return memory


@pytest.mark.parametrize("command", [1.0, np.nan])
def test_a_gap_in_the_samples_makes_no_phantom_wrench(command):
    dut, u = DisturbanceObserver(VEHICLE, step=STEP), 0.5 * VEHICLE.hover_input
    lost = Sample(np.full(13, np.nan), command * u, np.zeros(6))
    assert fed(dut, [lost])["started"][0] == 0.0  # it waits for a first sample
    samples, x = [], LEVEL.copy()
    for k in range(20):  # half a g of fall, as the model expects
        samples.append(lost if 8 <= k < 13 else Sample(x.copy(), u, np.zeros(6)))
        x[9] -= 0.5 * 9.81 * STEP
    np.testing.assert_allclose(fed(dut, samples)["chi"], 0.0, atol=1e-9)


def test_forecast_rollout_is_the_recursion_written_out():
    rng = np.random.default_rng(0)
    A, B, C = rng.normal(size=(3, 3)) / 3, rng.normal(size=(3, 6)), rng.normal(size=(6, 3))
    z, zeta, offset = rng.normal(size=3), rng.normal(size=(3, 6)), rng.normal(size=(3, 6))
    chi = WrenchForecast(A, B, C, z, offset).rollout(zeta)
    np.testing.assert_allclose(chi[0], C @ z + offset[0])
    z2 = A @ (A @ z + B @ zeta[0]) + B @ zeta[1]
    np.testing.assert_allclose(chi[2], C @ z2 + offset[2])
    np.testing.assert_allclose(constant_forecast(CHI, 3).rollout(zeta), np.tile(CHI, (3, 1)))


@pytest.mark.parametrize("turning", [False, True])
def test_both_poles_of_the_observers_error_are_those_of_its_bandwidth(turning):
    """A constant wrench from rest: the error of its estimate follows D_(n+2) = 2 p D_(n+1) - p²
    D_n.
    """
    bandwidth, x, errors = 3.0, LEVEL.copy(), []
    both = {"force_bandwidth": bandwidth, "torque_bandwidth": bandwidth}
    dut = DisturbanceObserver(VEHICLE, step=STEP, **both)
    memory, wrench = dut.initial_memory(), np.zeros(6)
    at = 5 if turning else 0
    wrench[at] = 0.02 if turning else 1.5
    for _ in range(12):
        memory = dut.update(memory, Sample(x.copy(), VEHICLE.hover_input, np.zeros(6)))
        errors.append(wrench[at] - memory["chi"][at])
        x[7:10] += STEP * wrench[:3] / VEHICLE.mass
        x[10:13] += STEP * np.linalg.solve(VEHICLE.J, wrench[3:])
    D, p = np.array(errors), np.exp(-2 * np.pi * bandwidth * STEP)
    np.testing.assert_allclose(D[2:], 2 * p * D[1:-1] - p**2 * D[:-2], atol=1e-12)
    assert D[1] == pytest.approx(wrench[at] * (1 - (1 - p) ** 2))
