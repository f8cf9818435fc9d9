"""How the Drake simulator is set up for a set of effects: step, stiffness of the cable, order of actuator effects."""

import dataclasses as dc

from np_drake.effects.combine import EffectsByPlace
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadConfig, payload_config

CABLE_RATE, CABLE_DAMPING = 250.0, 0.3  # of the cable: frequency [rad/s] and damping ratio [1]
# Steps of the integrator [s]: one between rows 10 ms apart, jitter included, three with a cable; share of a lag.
STEP, CABLE_STEP, LAG_SHARE = 0.0112, 0.0037, 0.2


def largest_step(vehicle: Vehicle, places: EffectsByPlace) -> float:
    """A step at which runge_kutta3 is stable and follows the lags to a few parts in a thousand [s]."""
    lags = [vehicle.rotor_time_constant] if vehicle.rotor_time_constant > 0 else []
    for effect in places.actuator:
        lags += [getattr(effect, name) for name in ("time_constant", "time") if hasattr(effect, name)]
    return min([STEP if places.payload is None else CABLE_STEP, *(LAG_SHARE * lag for lag in lags)])


def springy(effect: SuspendedPayload | None, vehicle: Vehicle) -> PayloadConfig:
    """A cable as stiff for this payload as the integrator's step allows."""
    payload = payload_config(effect)
    if payload.tether == "none":
        return payload
    reduced = payload.mass * vehicle.mass / (payload.mass + vehicle.mass)
    stiffness, damping = reduced * CABLE_RATE**2, 2 * CABLE_DAMPING * reduced * CABLE_RATE
    return dc.replace(payload, stiffness=stiffness, damping=damping)


def in_order(effects: list) -> list:
    """Actuator effects as they act: first what changes how rotors turn, then what turning rotors give."""
    return sorted(effects, key=lambda effect: not effect.turns_rotor)
