"""Effect `rotor_inflow`: thrust of rotors that the flow through their discs changes."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import Motion, Parameter, WrenchEffect
from np_drake.vehicle import Vehicle

AIR_DENSITY = 1.2  # at 20 °C near sea level [kg/m³]
# from above, where Glauert's equation is convex; five reach 1e-11 down to a descent at v_h
_NEWTON_STEPS = 8


@dc.dataclass(frozen=True)
class RotorInflow(WrenchEffect):
    """Change of thrust df_i = k omega_i (v_h - v_i - v_z) of every rotor, k = slope rho A R / 4.

    v_h: induced velocity of the rotor at rest, of thrust f_i = 2 rho A v_h². v_i: that in the flow
    v = R^T (v_WB - wind), with Glauert's v_i sqrt(v_x² + v_y² + (v_z + v_i)²) = v_h². Climbing
    lowers thrust, flying ahead raises it. `slope` is the slope of the blades' lift times the
    solidity of the rotor. Own choices: v_h is that of the thrust at rest; all rotors are in the
    flow at Bo, so that there is no torque. Descent faster than v_h is outside of the theory.

    Source: blade element and momentum theory, Leishman, Principles of Helicopter Aerodynamics, ch.
    2 and 3; blades of ideal twist. Prior: a slope of 4 to 6 and a solidity of 0.08 to 0.2.
    """

    slope: float = 0.6  # [1]

    named = "inflow of the rotors"
    drawn = (0.05, 1.5)
    excited_by = "fast climbs and descents with level attitude, then sprints at constant height"
    requires = ("velocity",)
    begins = False
    turns = False
    parameters = (Parameter("slope", "1", 0.0, 0.0, 3.0, 0.6),)

    def body_wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return the change of thrust in B, (..., 6) [N, N·m]; no torque."""
        out = super().body_wrench(vehicle, motion)
        v_B = motion.air_B
        area = np.pi * vehicle.rotor_radius**2
        f = np.maximum(motion.rotor_thrust, 0.0)
        speed = np.sqrt(f / vehicle.thrust_coefficient)
        at_rest = _velocity_at_rest(vehicle, f)
        axial = v_B[..., 2:]
        lateral = np.linalg.norm(v_B[..., :2], axis=-1, keepdims=True)
        k = self.slope * AIR_DENSITY * area * vehicle.rotor_radius / 4
        out[..., 2] = np.sum(
            k * speed * (at_rest - induced_velocity(at_rest, lateral, axial) - axial), axis=-1
        )
        return out


def _velocity_at_rest(vehicle: Vehicle, thrust: np.ndarray | float) -> np.ndarray:
    """Return the induced velocity (...) of rotors at rest with this thrust (...) each [m/s, N].

    Source: momentum theory, f = 2 rho A v².
    """
    return np.sqrt(np.asarray(thrust) / (2 * AIR_DENSITY * np.pi * vehicle.rotor_radius**2))


def hover_induced_velocity(vehicle: Vehicle) -> float:
    """Return the induced velocity of the rotors of a vehicle in hover [m/s]."""
    return float(_velocity_at_rest(vehicle, vehicle.mass * vehicle.gravity / 4))


def induced_velocity(at_rest: np.ndarray, lateral: np.ndarray, axial: np.ndarray) -> np.ndarray:
    """Return the induced velocity of rotors in a flow, by Glauert's equation [m/s].

    Of several solutions, in fast descent, it is the largest.

    Args:
        at_rest: (...) induced velocity of the same thrust without flow [m/s].
        lateral: (...) flow in the disc [m/s].
        axial: (...) along its axis, positive in climb [m/s].
    """
    # Newton's method on v through(v) = at_rest², from above, where it converges monotonically.
    v = at_rest + np.maximum(-axial, 0.0)
    push = at_rest**2
    across = lateral**2
    for _ in range(_NEWTON_STEPS):
        along = v + axial
        through = np.maximum(np.sqrt(across + along**2), 1e-9)
        slope = np.maximum(through + v * along / through, 1e-9)
        v = np.maximum(v - (v * through - push) / slope, 0.0)
    return v
