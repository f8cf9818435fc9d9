"""Laws of what an autopilot's turned axes and late attitude leave in the channels."""

import numpy as np
import pytest

from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.residuals import FORCE, TORQUE
from np_drake.diagnosis.residuals.flight_residuals import ATTITUDE
from np_drake.effects.attitude_bias import AttitudeBias
from np_drake.effects.attitude_latency import AttitudeLatency
from np_drake.effects.imu_mounting import ImuMounting

INSIDE = slice(25, -25)  # of the grid: the ends are held
ANGLES = np.array([0.04, -0.03, 0.02])
MOUNTED, TURNED, LATE = ImuMounting(*ANGLES), AttitudeBias(*ANGLES), AttitudeLatency(0.02)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(values[INSIDE] ** 2, axis=1))))


def test_rates_and_attitude_turned_together_stay_consistent(seen):
    mounted, turned, clean = (
        seen(*e, seconds=8.0).y[:, ATTITUDE] for e in ((MOUNTED,), (TURNED,), ())
    )
    assert rms(mounted - clean) < 0.01 * rms(turned - clean)


def test_turned_axes_tilt_the_force_by_thrust_times_angle(seen):
    mounted, clean = seen(MOUNTED, seconds=8.0), seen(seconds=8.0)
    thrust = clean.nominal[:, :3]
    expected = np.cross(thrust, ANGLES)  # R(angles)' f - f to first order
    left = mounted.y[:, FORCE] - clean.y[:, FORCE] - expected
    assert rms(left) < 0.05 * rms(expected)  # second order in the angles


def test_a_late_attitude_lags_by_its_rate_of_change(seen):
    late, clean = seen(LATE, seconds=8.0), seen(seconds=8.0)
    acceleration = np.gradient(clean.w, clean.grid.step, axis=0)
    left = (late.y - clean.y)[:, ATTITUDE] + LATE.latency * acceleration
    assert rms(left) < 0.2 * rms(LATE.latency * acceleration)  # of a grid of 20 ms


@pytest.mark.parametrize("accelerations", [True, False])
@pytest.mark.parametrize("effect", [MOUNTED, LATE], ids=lambda e: e.identifier)
def test_the_predicted_residual_is_that_of_an_exact_log(seen, effect, accelerations):
    dut, clean = (seen(*e, seconds=8.0, accelerations=accelerations) for e in ((effect,), ()))
    trace = dut.y - clean.y
    left = trace - predicted_residual(dut, [Term(effect)])
    for part in (FORCE, TORQUE, ATTITUDE):
        assert rms(left[:, part]) < 0.05 * rms(trace[:, part]) + 1e-3  # [N, N·m, rad/s]
