"""True wrench over a planned motion, an upper limit of what prediction can do; for tests and tables
only.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake import attitude
from np_drake.effects.base import ActuatorEffect, MassEffect, Motion, WrenchEffect
from np_drake.effects.combine import Onsets, acting, mass_properties, total_wrench
from np_drake.effects.pendulum import Payload, hook_velocity, hook_wrench, swing
from np_drake.rigid_body import Q, W, residual_wrench
from np_drake.vehicle import Vehicle

_SUBSTEPS = 4  # of the actuators in one step of the plan [1]


@dc.dataclass(frozen=True)
class TrueModel:
    """Everything that the nominal model leaves out.

    onsets: when those of the effects begin that do not act from the start [s].
    """

    believed: Vehicle  # the vehicle that the controller assumes
    payload: Payload | None  # None without one
    wrench_effects: list[WrenchEffect]  # effects that act in the simulation, without dead time
    actuator_effects: list[ActuatorEffect]  # effects that act in the simulation, without dead time
    delay: float = 0.0  # dead time of the commands, for the caller [s]
    onsets: Onsets = dc.field(default_factory=dict)
    mass_effects: Sequence[MassEffect] = ()  # change the mass properties
    hangs_at: float = 0.0  # when the payload is hung [s]
    # (time [s], payload from then on), by time
    payloads: Sequence[tuple[float, Payload | None]] = ()

    def payload_at(self, t: float) -> Payload | None:
        """Return the payload that hangs at time t [s]; None without one."""
        if t < self.hangs_at:
            return None
        begun = [payload for time, payload in self.payloads if time <= t]
        return begun[-1] if begun else self.payload

    def wrench_along(
        self,
        x: np.ndarray,
        u: np.ndarray,
        step: float,
        *,
        t: float = 0.0,
        rotor_thrust: np.ndarray,
        swing_state: tuple[np.ndarray, np.ndarray] | None,
    ) -> np.ndarray:
        """Return chi along a plan, (N, 6) [N, N·m]: tether, drag and the actuators' response to the
        commands.

        Args:
            x: (N+1, 13) planned states from time `t` on.
            u: (N, 4) planned commands [N, N·m].
            step: of the plan [s].
            t: when it begins [s].
            rotor_thrust: (4,) actual now [N].
            swing_state: (r, r_rate) of the payload from the hook, in W [m, m/s].
        """
        starts = t + step * np.arange(len(u))
        thrust, command = self._thrusts(u, starts, step, rotor_thrust)
        middle = 0.5 * (x[:-1] + x[1:])
        middle[:, Q] = attitude.normalised(middle[:, Q])
        wrong = (thrust - command) @ self.believed.mixer.T
        chi = np.concatenate([wrong[:, :1] * attitude.body_z(middle[:, Q]), wrong[:, 1:]], axis=1)
        motion = Motion(starts + 0.5 * step, middle, thrust)
        chi += total_wrench(self.believed, acting(self.wrench_effects, self.onsets, t), motion)
        payload = self.payload_at(t)
        if payload is not None and swing_state is not None:
            v_hook = hook_velocity(payload.hook, x)
            a_hook = np.diff(v_hook, axis=0) / step
            between = 0.5 * (v_hook[1:] + v_hook[:-1])
            force = swing(payload, *swing_state, a_hook, step, self.believed.gravity, between)
            chi += hook_wrench(payload, middle[:, Q], force)
        changed = acting(self.mass_effects, self.onsets, t)
        return (
            self._as_believed(middle, command @ self.believed.mixer.T, chi, changed)
            if changed
            else chi
        )

    def _as_believed(
        self, x: np.ndarray, u: np.ndarray, chi: np.ndarray, changed: Sequence[MassEffect]
    ) -> np.ndarray:
        """Return the wrench (N, 6) that the believed vehicle needs to move as the real one does
        under u and chi.

        With F and tau at Bo, c = p_BoBcm_B and J about Bcm of the real vehicle: J al + w x J w =
        tau - c x R^T F and m (a + g z + R (al x c + w x (w x c))) = F.
        Source: Newton and Euler about the centre of mass.
        """
        real = mass_properties(self.believed, changed)
        q = x[:, Q]
        w = x[:, W]
        c = real.p_BoBcm_B
        F = u[:, :1] * attitude.body_z(q) + chi[:, :3]
        tau = (
            u[:, 1:]
            + chi[:, 3:]
            - np.cross(c, attitude.rotate_back(q, F))
            - np.cross(w, w @ real.J.T)
        )
        al = tau @ np.linalg.inv(real.J).T
        a = F / real.mass - attitude.rotate(q, np.cross(al, c) + np.cross(w, np.cross(w, c)))
        a[:, 2] -= self.believed.gravity
        return residual_wrench(self.believed, q=q, w=w, a=a, al=al, u=u)

    def _thrusts(
        self, u: np.ndarray, starts: np.ndarray, step: float, now: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return mean actual and commanded rotor thrust of the steps that begin at `starts` (N,),
        (N, 4) each [N].
        """
        command = np.clip(u @ self.believed.unmixer.T, 0.0, self.believed.max_rotor_thrust)
        gain = np.ones(4)
        effects = acting(self.actuator_effects, self.onsets, float(starts[0]))
        for effect in effects:
            ones = np.ones(4)
            gain *= effect.thrust(
                self.believed, effect.state_at(self.believed, ones), ones, starts[0]
            )
        resting = np.asarray(now, float) / np.maximum(gain, 1e-3)
        thrust = command
        for effect in effects:
            thrust = self._through(effect, thrust, starts, step, resting)
        return thrust, command

    def _through(self, effect: ActuatorEffect, command, starts, step: float, resting) -> np.ndarray:
        """Return mean thrusts (N, 4) [N] of one effect that rests at `resting` (4,) [N] before the
        first command.
        """
        state = effect.state_at(self.believed, resting)
        passed = np.zeros_like(command)
        for i, c in enumerate(command):
            for j in range(_SUBSTEPS):
                t = starts[i] + step * j / _SUBSTEPS
                passed[i] += effect.thrust(self.believed, state, c, t) / _SUBSTEPS
                state = state + step / _SUBSTEPS * effect.state_rate(self.believed, state, c)
        return passed
