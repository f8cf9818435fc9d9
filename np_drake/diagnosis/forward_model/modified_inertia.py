"""Rigid body with mass properties other than those of the vehicle file, and the residual that they
leave.
"""

from collections.abc import Sequence

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.effects.base import MassEffect, MassProperties


class ModifiedInertia:
    """Mass properties of a flight's vehicle under mass effects, applied to the motion of the
    flight.

    Args:
        effects: mass effects, in the order in which they act.
    """

    def __init__(self, flight: FlightResiduals, effects: Sequence[MassEffect]):
        self._e = flight
        real = MassProperties.of(flight.vehicle)
        for effect in effects:
            real = effect.properties(real)
        w, c = flight.w, np.asarray(real.p_BoBcm_B, float)
        self._mass, self._lever, self._turned = (
            real.mass,
            attitude.skew(c).T,
            np.linalg.inv(real.J).T,
        )
        self._gyroscopic = np.cross(w, w @ real.J.T)
        self._offset, self._at_origin = c.any(), c.any() and flight.vehicle.logged_point == "origin"
        self._inward = w * (w @ c)[:, None] - c * np.sum(w**2, axis=1)[:, None]  # w x (w x c)

    def needs(self, added: np.ndarray, ahead: np.ndarray) -> np.ndarray:
        """Return the residual wrench (m, 6) in B that the changed mass properties leave [N, N·m].

        By forward dynamics with the real m', c, J': al = J'^-1 (tau - c x F - w x J' w), s = F / m'
        - al x c - w x (w x c), or F / m' where the log follows the centre of mass. The residual is
        m s - thrust and J al + w x J w - tau_nominal.

        Args:
            added: (m, 6) wrench in B in addition to the nominal one [N, N·m].
            ahead: (m, 4) thrust and torques at rows less their mean around the rows [N, N·m].
        """
        e = self._e
        rotors = e.unscaled - e.given
        wrench = rotors + added
        F, tau = wrench[:, :3], wrench[:, 3:]
        at_mids = F - ahead[:, :1] * [0.0, 0.0, 1.0] if self._offset else F
        s, al = F / self._mass, self._angular(at_mids, tau)
        if self._at_origin:
            s = s + self._angular(F, tau + ahead[:, 1:]) @ self._lever - self._inward
        needed = np.concatenate([e.vehicle.mass * s, al @ e.vehicle.J.T + e.gyroscopic], axis=1)
        return needed - rotors

    def _angular(self, F: np.ndarray, tau: np.ndarray) -> np.ndarray:
        return (tau - F @ self._lever - self._gyroscopic) @ self._turned
