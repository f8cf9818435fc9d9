"""Effect `suspended_payload`: a payload on a tether."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import Motion, Parameter, WrenchEffect, arm, log_uniform
from np_drake.effects.pendulum import Payload, hook_acceleration, hook_velocity, hook_wrench, swing
from np_drake.rigid_body import Q
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class SuspendedPayload(WrenchEffect):
    """Point mass on a massless, inextensible tether that may go slack; the hook is p_BoTo_B.

    With r = p_ToPo_W, |r| = L, z up, and c the damping:  r'' = -g z - a_hook - c (r' + v_hook) -
    (T/m) r/L, T/m = |r'|²/L - (r/L) · (g z + a_hook + c v_hook); the force on the hook is T r/L,
    and the tether is taut only where T > 0: else there is no force, and the payload falls through
    the air.

    The drag -m c v_WP is that in still air, linear in the payload's velocity: it damps a swing
    (energy as exp(-c t)), and the payload hangs back by atan(c v/g) in steady flight at v. Drag
    grows with the square of speed; c stands for the slope in a downwash w: rho Cd A w / m along it,
    half of that across. Prior: a smooth sphere (Cd 0.47, rho 1.2 kg/m³) of 5 g and 2 to 3 cm under
    3 to 4 m/s has c = 0.05 to 0.16 1/s across and twice that along the flow; one of 260 g and 6 cm
    under 5 m/s 0.015 to 0.03. Hence a deviation of 0.15. Neglected: the steady push of the downwash
    (it counts as weight), wind, drag of the tether, added mass.

    The effect has a hidden state, (r, r') of the payload from the hook in W, and so no momentary
    wrench. Over a log the measured motion of the hook drives it (`wrench_along`). In a diagram it
    is a body.
    Source: Newton on the payload.
    """

    mass: float = 0.26  # [kg]
    length: float = 0.8  # [m]
    hook_x: float = 0.0  # [m], body axes
    hook_y: float = 0.0  # [m]
    hook_z: float = -0.025  # [m]
    damping: float = 0.0  # drag over mass and velocity [1/s]

    sudden = True
    named = "a suspended payload"
    phrase = "a {mass} payload on {length}"
    bench_check = "weigh what hangs below, and measure its tether"
    excited_by = "sudden stops that make the payload swing"
    has_hidden_state = True
    requires = ("attitude",)
    linear = False
    parameters = (
        Parameter("mass", "kg", 0.0, 0.0, 2.0, 0.2),
        Parameter("length", "m", 0.8, 0.1, 30.0, 0.5, vanishes=False),
        *(Parameter(f"hook_{axis}", "m", 0.0, -0.3, 0.3, 0.03) for axis in "xyz"),
        Parameter("damping", "1/s", 0.0, 0.0, 1.0, 0.15, vanishes=False),
    )

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case."""
        x, y = 0.15 * arm(vehicle) * rng.uniform(-1, 1, 2)
        return {
            "mass": log_uniform(rng, 0.01, 0.3) * vehicle.mass,
            "length": rng.uniform(0.3, 1.5),
            "hook_x": x,
            "hook_y": y,
            "hook_z": -arm(vehicle) * rng.uniform(0.05, 0.3),
        }

    def possible(self, vehicle: Vehicle, height: float) -> bool:
        """Return whether the payload is ever clear of the ground.

        Args:
            height: largest above the ground; infinite: not known [m].
        """
        return self.length <= height

    @property
    def payload(self) -> Payload:
        """Payload in the form that the functions of `pendulum` take."""
        return Payload(
            self.mass, self.length, (self.hook_x, self.hook_y, self.hook_z), self.damping
        )

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Not available, because the wrench depends on the payload's own motion.

        Raises: NotImplementedError: always.
        """
        raise NotImplementedError("SuspendedPayload: has a state of its own; use wrench_along.")

    def wrench_along(
        self,
        vehicle: Vehicle,
        *,
        x: np.ndarray,
        a: np.ndarray,
        al: np.ndarray,
        step: float,
        r: np.ndarray,
        r_rate: np.ndarray,
    ) -> np.ndarray:
        """Return chi in the middle of each step that begins at a row of a log, (n, 6) [N, N·m].

        Args:
            x: (n, 13) states.
            a: (n, 3) in W [m/s²].
            al: (n, 3) in B [rad/s²].
            step: between rows [s].
            r: (3,) payload from hook in W at the first row [m].
            r_rate: (3,) its rate [m/s].
        """
        payload = self.payload
        a_hook = hook_acceleration(payload.hook, x, a, al)
        v_hook = hook_velocity(payload.hook, x)
        return hook_wrench(
            payload, x[:, Q], swing(payload, r, r_rate, a_hook, step, vehicle.gravity, v_hook)
        )
