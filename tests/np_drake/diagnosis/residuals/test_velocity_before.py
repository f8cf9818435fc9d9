"""Laws of the velocity that is known before an instant."""

import dataclasses as dc

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake import attitude
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.diagnosis.residuals.smoothing import velocity_before
from np_drake.rigid_body import V
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
STEP = 0.02
ROWS = 400


class PointMass:
    """Velocity at rows of a mass that pushes along a turning axis and feels a disturbance, held
    over every interval.
    """

    def __init__(self, disturbance: np.ndarray):
        n = len(disturbance)
        self.t = STEP * (np.arange(n) + 0.5)
        self.dt = np.full(n, STEP)
        tilt = np.stack([0.3 * np.sin(2 * self.t), 0.2 * np.cos(3 * self.t), 0 * self.t], axis=1)
        self.q = attitude.from_rotation_vector(tilt)
        self.thrust = VEHICLE.mass * VEHICLE.gravity * (1 + 0.1 * np.sin(5 * self.t))
        up = np.zeros((n, 3))
        up[:, 2] = self.thrust / VEHICLE.mass
        push = attitude.rotate(self.q, up) - [0.0, 0.0, VEHICLE.gravity]
        v = np.zeros((n + 1, 3))
        for k in range(n):
            v[k + 1] = v[k] + STEP * (push[k] + disturbance[k] / VEHICLE.mass)
        self.v = 0.5 * (v[1:] + v[:-1])

    def known(self) -> np.ndarray:
        return velocity_before(self.t, self.dt, self.v, self.q, self.thrust, VEHICLE, STEP)


@given(row=st.integers(5, ROWS - 2), size=st.floats(1, 50))
@settings(max_examples=20, deadline=None)
def test_an_interval_does_not_change_the_velocity_known_before_it(row, size):
    struck = np.zeros((ROWS, 3))
    struck[row] = size
    before, after = PointMass(np.zeros((ROWS, 3))).known(), PointMass(struck).known()
    np.testing.assert_allclose(after[: row + 1], before[: row + 1], rtol=0, atol=1e-12)
    changed = np.abs(after[row + 1] - before[row + 1]).max()
    assert changed > 1e-3 * size


def test_a_flight_without_accelerations_feels_the_velocity_known_before(fly):
    log = dc.replace(fly(seconds=6.0), a=None)
    e = make_flight_residuals(log, VEHICLE)
    x, _ = e.wrench_states
    assert np.abs(x[:, V] - e.mids.x[:, V]).max() < 5e-3
    assert np.abs(x[:, V] - e.mids.x[:, V]).max() > 0.0
    np.testing.assert_array_equal(
        np.delete(x, range(7, 10), axis=1), np.delete(e.mids.x, range(7, 10), axis=1)
    )
