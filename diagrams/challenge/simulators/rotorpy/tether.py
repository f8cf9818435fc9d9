"""A payload on an inextensible tether under rotorpy's vehicle: the tension that keeps the tether's
length.
"""

import math

import numpy as np

from diagrams.challenge.simulators.rotorpy.conversion import cross
from np_drake.effects.base import Motion
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.rigid_body import P, V, W

# With which an error of length dies out, critically damped [1/s]; a slack tether tightens as
# softly.
RATE = 80.0
BAND = 1e-3  # of its length by which a taut tether may be too short [1]


class Tether:
    """A point mass on a tether that pulls only, in still air. State: its position and velocity in W
    [m, m/s].

    The tension is that with which d²|r|/dt² = -2 RATE d|r|/dt - RATE² (|r| - L), r from hook to
    payload, given the accelerations that vehicle and payload have without it.
    Source: Newton and Euler for both bodies; index reduction with Baumgarte's stabilisation.
    """

    size = 6

    def __init__(self, payload: SuspendedPayload):
        self.mass, self.length, self.damping = payload.mass, payload.length, payload.damping
        self.hook = np.array([payload.hook_x, payload.hook_y, payload.hook_z])

    def hang(self, now: Motion) -> np.ndarray:
        """Return the payload's state (6,) straight below the hook, and moving with it."""
        below = now.x[P] + now.R_WB @ self.hook - [0.0, 0.0, self.length]
        return np.concatenate([below, now.x[V] + now.R_WB @ cross(now.x[W], self.hook)])

    def pull(
        self, now: Motion, own: np.ndarray, motion: np.ndarray, inertial: tuple, gravity: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the tether's part of the vehicle's accelerations, and the rate of the payload's
        state.

        Args:
            own: (6,) state of the payload.
            motion: (6,) [dv/dt of Bcm in W, dw/dt in B] without the tether [m/s², rad/s²].
            inertial: mass [kg], inverse inertia (3, 3), p_BoBcm_B (3,) of the vehicle.
            gravity: [m/s²].

        Returns: (6,) as `motion`; (6,).
        """
        mass, J_inverse, center = inertial
        w = now.x[W]
        arm, (x, y, z) = self.hook - center, w.tolist()
        way = own[:3] - now.x[P] - now.R_WB @ self.hook
        span = math.sqrt(float(way @ way))
        fall = np.array([0.0, 0.0, -gravity]) - self.damping * own[3:]
        if span < (1 - BAND) * self.length:
            return np.zeros(6), np.concatenate([own[3:], fall])
        n, rate = way / span, own[3:] - now.x[V] - now.R_WB @ cross(w, self.hook)
        n_B = n @ now.R_WB
        lever, along = cross(arm, n_B), float(n @ rate)
        inward = w * float(w @ arm) - arm * (x * x + y * y + z * z)  # w x (w x arm)
        hook = float(
            n @ motion[:3] + lever @ motion[3:] + n_B @ inward
        )  # its acceleration along the tether
        wanted = float(n @ fall) - hook + (float(rate @ rate) - along * along) / span
        wanted += 2 * RATE * along + RATE**2 * (span - self.length)
        turn = J_inverse @ lever
        tension = max(wanted / (1 / self.mass + 1 / mass + float(lever @ turn)), 0.0)
        pulled = tension * np.concatenate([n / mass, turn])
        return pulled, np.concatenate([own[3:], fall - tension / self.mass * n])
