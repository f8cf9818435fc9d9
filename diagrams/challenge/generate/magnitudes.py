"""How strong each effect is drawn: log-uniform from invisible to strong, scaled to the vehicle.

Source: own choice throughout: the weak end drowns in sensor noise, the strong end is what the controller still flies.
"""

from collections.abc import Callable, Sequence

import numpy as np

from diagrams.challenge.random_magnitudes import arm, direction, log_uniform, signed
from np_drake.effects.base import Effect
from np_drake.effects.library import LIBRARY
from np_drake.vehicle import Vehicle

Draw = Callable[[np.random.Generator, Vehicle, float], dict[str, float]]


def _vector(low: float, high: float, names: Sequence[str] = "xyz", rise: float | None = None) -> Draw:
    """Draw a vector of log-uniform size and random direction."""

    def draw(rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        return dict(zip(names, log_uniform(rng, low, high) * direction(rng, rise), strict=True))

    return draw


def _inertia(rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
    size = log_uniform(rng, 0.02, 0.6)
    while True:
        scale = 1 + size * rng.uniform(-0.8, 1.0, 3)
        moments = np.sort(scale * vehicle.J.diagonal())
        if moments[2] < 0.98 * (moments[0] + moments[1]):  # what a rigid body can have
            return dict(zip(("scale_xx", "scale_yy", "scale_zz"), scale, strict=True))


def _payload(rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
    x, y = 0.15 * arm(vehicle) * rng.uniform(-1, 1, 2)
    return {
        "mass": log_uniform(rng, 0.01, 0.3) * vehicle.mass,
        "length": rng.uniform(0.3, 1.5),
        "hook_x": x,
        "hook_y": y,
        "hook_z": -arm(vehicle) * rng.uniform(0.05, 0.3),
    }


def _drift(rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
    return {"start": 1 + rng.uniform(-0.03, 0.03), "rate": signed(rng, 0.01, 0.15) / seconds}


def _drag(low: float, high: float, names: tuple[str, str, str]) -> Draw:
    """Draw drag coefficients per kilogram: a heavy vehicle has more drag."""

    def draw(rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        lateral = log_uniform(rng, low, high) * vehicle.mass
        return dict(zip(names, lateral * rng.uniform([0.8, 0.8, 0.3], [1.2, 1.2, 1.2]), strict=True))

    return draw


def _gusts(rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
    strength = log_uniform(rng, 0.3, 3.0)
    mean = strength * rng.uniform(0.3, 2.0) * direction(rng, 0.1)
    return {
        **dict(zip(("mean_x", "mean_y", "mean_z"), mean, strict=True)),
        "deviation": strength,
        "correlation_time": log_uniform(rng, 0.4, 3.0),
    }


def _one(name: str, parameter: Callable[[np.random.Generator, Vehicle], float]) -> Draw:
    """Draw an effect of one parameter."""

    def draw(rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        return {name: float(parameter(rng, vehicle))}

    return draw


def _weak(rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
    return {"rotor": float(rng.integers(1, 5)), "efficiency": 1 - log_uniform(rng, 0.01, 0.25)}


MAGNITUDES: dict[str, Draw] = {
    "mass_error": _one("delta_mass", lambda rng, v: v.mass * np.clip(signed(rng, 0.01, 0.25), -0.15, 0.25)),
    "inertia_error": _inertia,
    "center_of_mass_offset": lambda rng, v, s: _vector(0.005 * arm(v), 0.2 * arm(v), rise=0.5)(rng, v, s),
    "suspended_payload": _payload,
    "thrust_scale": _one("scale", lambda rng, v: 1 + signed(rng, 0.005, 0.15)),
    "thrust_drift": _drift,
    "weak_rotor": _weak,
    "motor_lag": _one(
        "time_constant",
        lambda rng, v: v.rotor_time_constant + log_uniform(rng, 0.008, 0.085 - v.rotor_time_constant),
    ),
    "command_delay": _one("delay", lambda rng, v: log_uniform(rng, 0.004, 0.04)),
    "linear_drag": _drag(0.01, 0.3, ("d_x", "d_y", "d_z")),
    "quadratic_drag": _drag(0.003, 0.08, ("c_x", "c_y", "c_z")),
    "blade_flapping": _one("moment", lambda rng, v: log_uniform(rng, 3e-4, 2e-2) * v.mass * 9.81 * arm(v)),
    "translational_lift": _one("lift", lambda rng, v: log_uniform(rng, 3e-4, 2e-2) * v.mass * 9.81),
    "rotor_inflow": _one("slope", lambda rng, v: log_uniform(rng, 0.05, 1.5)),
    "constant_wind": _vector(0.5, 7.0, rise=0.1),
    "gusty_wind": _gusts,
    "ground_effect": _one("effective_radius", lambda rng, v: v.rotor_radius * log_uniform(rng, 1.0, 6.0)),
    "rotor_gyroscopic": _one("rotor_inertia", lambda rng, v: v.J[2, 2] * log_uniform(rng, 2e-4, 2e-2)),
    "accelerometer_bias": _vector(0.03, 1.0),
    "gyro_bias": _vector(0.003, 0.15),
    "velocity_bias": _vector(0.01, 0.5),
    "attitude_bias": _vector(0.003, 0.08, ("roll", "pitch", "yaw")),
    "clock_offset": _one("offset", lambda rng, v: signed(rng, 0.003, 0.06)),
}
COMPANION_DRAG = _drag(0.05, 0.3, ("d_x", "d_y", "d_z"))  # through which a wind is felt


def draw_effect(name: str, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> list[Effect]:
    """Draw the effect `name`, and the drag that it acts through where it needs one."""
    effect = LIBRARY[name].of(MAGNITUDES[name](rng, vehicle, seconds))
    if not effect.needs:
        return [effect]
    return [effect, LIBRARY["linear_drag"].of(COMPANION_DRAG(rng, vehicle, seconds))]
