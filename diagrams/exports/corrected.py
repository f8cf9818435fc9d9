"""Corrected vehicle: what the nominal model becomes with its effects, as coefficients that
simulators take.
"""

import dataclasses as dc
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.effects.base import MassProperties
from np_drake.effects.combine import mass_properties, split_effects
from np_drake.effects.rotor_inflow import AIR_DENSITY
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class Corrected:
    """A vehicle with its effects. Forces act at Bo, in body axes B; v is the air speed of Bo in B
    [m/s].

    Effects of one kind add up; factors multiply. Sensor errors have no part in it.
    Own choices: a thrust that drifts has its value at the start; a gusty wind is its mean.
    """

    vehicle: Vehicle
    mass: MassProperties  # after the mass effects
    scale: float  # thrust over commanded thrust, of every rotor [1]
    rotor_share: np.ndarray  # (4,) further factor of each rotor: weak rotors [1]
    time_constant: float  # of rotor speed; the vehicle file's where no effect has one [s]
    time_constant_down: float  # of a rotor that slows down [s]
    dead_time: float  # of commands [s]
    torque_share: np.ndarray  # (3,) share of the rotors' torque about Bo that acts, by axis [1]
    linear: np.ndarray  # (3,) d of f = -s d v, s = rotor speed over nominal hover speed [N·s/m]
    quadratic: np.ndarray  # (3,) c of f = -c |v| v, axis by axis [N·s²/m²]
    lift: float  # of f_z = lift (v_x² + v_y²) [N·s²/m²]
    flapping: float  # of tau = flapping [v_y, -v_x, 0] [N·m·s/m]
    inflow: float  # k of df = -k omega v_z / 2 of every rotor: `rotor_inflow` about hover [N·s²/m]
    wind: np.ndarray  # (3,) velocity of the air in W [m/s]
    rotor_inertia: float  # of one rotor about its axis [kg·m²]
    payload: SuspendedPayload | None  # None where it weighs nothing

    @property
    def hover_thrust(self) -> float:
        """Mean thrust of a rotor that carries vehicle and payload [N]."""
        hung = self.payload.mass if self.payload else 0.0
        return (self.mass.mass + hung) * self.vehicle.gravity / 4

    @property
    def hover_command(self) -> np.ndarray:
        """Commanded thrusts (4,) at which every rotor gives `hover_thrust`, as far as it can
        [N].
        """
        command = self.hover_thrust / (self.scale * np.maximum(self.rotor_share, 1e-9))
        return np.minimum(command, self.vehicle.max_rotor_thrust)

    @property
    def kappa(self) -> float:
        """Torque over thrust of a rotor [m]."""
        return self.vehicle.torque_coefficient / self.vehicle.thrust_coefficient

    @cached_property
    def drag_in_hover(self) -> np.ndarray:
        """Linear drag (3,) d of f = -d v at the rotor speed that hovers, part of `rotor_inflow`
        included [N·s/m].
        """
        nominal = self.vehicle.mass * self.vehicle.gravity / 4
        drag = self.linear * np.sqrt(self.hover_thrust / nominal)
        speed = np.sqrt(self.hover_thrust / self.vehicle.thrust_coefficient)
        drag[2] += 4 * 0.5 * self.inflow * speed
        return drag


def corrected(vehicle: Vehicle, effects: Sequence[Any]) -> Corrected:
    """Return the vehicle corrected by effects of `np_drake.effects`.

    Raises: ValueError: if two payloads or two motor lags are given, the rotors give nothing, or no
        rigid body can have the mass properties.
    """
    parts = split_effects(effects)
    mass = mass_properties(vehicle, parts.mass)
    require(
        mass.rigid,
        f"corrected: the effects must leave a rigid body; got {mass.mass:g} kg and "
        f"{mass.J.diagonal()} kg·m².",
    )
    lags = _of(effects, "motor_lag", "uneven_lag")
    require(len(lags) <= 1, f"corrected: there must be one motor_lag at most; got {len(lags)}.")
    lag = lags[0].time_constant if lags else vehicle.rotor_time_constant
    scale = _gain(vehicle, _of(effects, "thrust_scale", "thrust_drift"))
    require(scale[0] > 0, f"corrected: the scale of thrust must be positive; got {scale[0]:g}.")
    mixers = _of(effects, "mixer_gain")
    slope = _sum(effects, "rotor_inflow", "slope")[0]
    gusts = _sum(effects, "gusty_wind", "mean_x", "mean_y", "mean_z")
    return Corrected(
        vehicle=vehicle,
        mass=mass,
        scale=float(scale[0]),
        rotor_share=_gain(vehicle, _of(effects, "weak_rotor")),
        time_constant=lag,
        time_constant_down=getattr(lags[0], "down", lag) if lags else lag,
        dead_time=sum(effect.dead_time for effect in parts.actuator),
        torque_share=1.0 + _sum(effects, "mixer_gain", "roll", "pitch", "yaw") - len(mixers),
        linear=_sum(effects, "linear_drag", "d_x", "d_y", "d_z"),
        quadratic=_sum(effects, "quadratic_drag", "c_x", "c_y", "c_z"),
        lift=float(_sum(effects, "translational_lift", "lift")[0]),
        flapping=float(_sum(effects, "blade_flapping", "moment")[0]),
        inflow=slope * AIR_DENSITY * np.pi * vehicle.rotor_radius**3 / 4,
        wind=_sum(effects, "constant_wind", "x", "y", "z") + gusts,
        rotor_inertia=float(_sum(effects, "rotor_gyroscopic", "rotor_inertia")[0]),
        payload=parts.payload if parts.payload is not None and parts.payload.mass > 0 else None,
    )


def _of(effects: Sequence[Any], *identifiers: str) -> list[Any]:
    return [effect for effect in effects if effect.identifier in identifiers]


def _sum(effects: Sequence[Any], identifier: str, *names: str) -> np.ndarray:
    """Return the sums of these parameters over all effects of a kind."""
    rows = [[getattr(effect, name) for name in names] for effect in _of(effects, identifier)]
    return np.sum(np.reshape(rows, (-1, len(names))), axis=0, dtype=float)


def _gain(vehicle: Vehicle, effects: list[Any]) -> np.ndarray:
    """Return the thrusts (4,) of memoryless effects over a command of 1 N, when the flight begins
    [1].
    """
    thrust = np.ones(4)
    for effect in effects:
        thrust = effect.thrust(vehicle, np.zeros(0), thrust, 0.0)
    return thrust
