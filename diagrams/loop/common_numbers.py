"""The numbers of a scenario that are changed most: payload, cable, speed and wind."""

import dataclasses as dc
import math

import numpy as np

from diagrams.loop.flight import LIFTED, LOOKS, FlightConfig
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.references.track_file import Trajectory
from systems.payload_config import PayloadConfig


def with_payload(
    config: FlightConfig, *, mass: float | None = None, length: float | None = None
) -> FlightConfig:
    """Return the scenario with another payload; its cable stretches by the same share of its
    length.

    Args:
        mass: of the payload; 0: none; None: the scenario's [kg].
        length: of the cable; None: the scenario's [m].
    Raises: ValueError: on an impossible value, or a length without a payload.
    """
    for name, value in (("payload", mass), ("length", length)):
        if value is not None and not (0 <= value < np.inf and (value > 0 or name == "payload")):
            unit = "not be negative [kg]" if name == "payload" else "be positive [m]"
            raise ValueError(f"--{name}: must {unit} and finite; got {value:g}.")
    reality, hung = config.reality, config.reality.hung
    if mass == 0.0:
        if length is not None:
            raise ValueError(
                f"--length: there is no cable without a payload; got {length:g} m. Leave it out."
            )
        effects = [e for e in reality.effects if not isinstance(e.made, SuspendedPayload)]
        none = dc.replace(reality, payload=PayloadConfig(tether="none"), effects=effects)
        return dc.replace(config, reality=none)
    spare = config.carried_mass - (hung.mass if hung.tether != "none" else 0.0)
    most = LIFTED * config.lift / config.vehicle.gravity - spare
    if mass is not None and mass > most:
        raise ValueError(
            f"--payload: must be at most {most:.3g} kg, which the rotors carry; got {mass:g}."
        )
    if hung.tether == "none":
        if mass is None:
            raise ValueError(f"--length: {config.name} has no payload. Name its mass by --payload.")
        hung = dc.replace(hung, tether="cable")
    new = dc.replace(hung, mass=mass or hung.mass, length=length or hung.length)
    if not new.length > new.radius:
        raise ValueError(
            f"--length: must be above the payload's radius, {new.radius:g} m; got {new.length:g}."
        )
    if any(isinstance(e.made, SuspendedPayload) for e in reality.effects):
        changed = {"mass": new.mass, "length": new.length}
        effects = [
            dc.replace(e, parameters={**e.parameters, **changed})
            if isinstance(e.made, SuspendedPayload)
            else e
            for e in reality.effects
        ]
        return dc.replace(config, reality=dc.replace(reality, effects=effects))
    weight, longer = new.mass / hung.mass, new.length / hung.length
    new.stiffness, new.damping = (
        hung.stiffness * weight / longer,
        hung.damping * weight / math.sqrt(longer),
    )
    return dc.replace(config, reality=dc.replace(reality, payload=new))


def with_speed(config: FlightConfig, speed: float) -> FlightConfig:
    """Return the scenario at another speed along its track.

    Args:
        speed: mean after the ramp; of the steps: of a move [m/s].
    Raises: ValueError: where the track has no speed, or vehicle and controller cannot fly it.
    """
    if not 0 < speed < np.inf:
        raise ValueError(f"--speed: must be positive and finite [m/s]; got {speed:g}.")
    reference = config.reference
    if reference.track in ("hover", "multisine"):
        raise ValueError(
            f"--speed: the track {reference.track} has no speed. Leave it out, or name another."
        )
    if isinstance(
        dc.replace(config, reference=dc.replace(reference, dither=[0.0] * 3)).track, Trajectory
    ):
        raise ValueError(
            f"--speed: {reference.track} states its own times, and with them the speed. "
            f"Leave it out."
        )
    flown = dc.replace(config, reference=dc.replace(reference, speed=speed))
    now = flown.reference.own_duration
    if now is not None and config.duration == reference.own_duration:
        flown = dc.replace(flown, duration=now)
    _require_reach(flown)
    return flown


def _require_reach(config: FlightConfig) -> None:
    """Check the speed of the motion against the controller's bound, and its acceleration against
    the rotors.

    Raises: ValueError: where one is passed.
    """
    flat = config.motion.sample(np.arange(0.0, config.end, LOOKS))
    fastest, most = float(np.abs(flat[1]).max()), config.controller.mpc.max_speed
    pull = (
        float(np.linalg.norm(flat[2] + [0.0, 0.0, config.vehicle.gravity], axis=1).max())
        * config.carried_mass
    )
    for value, bound, unit, of in (
        (fastest, most, "m/s", "controller.mpc.max_speed"),
        (pull, config.lift, "N", "the rotors' thrust"),
    ):
        if value > bound:
            raise ValueError(
                f"--speed: must be lower; at {config.reference.speed:g} m/s {config.name} "
                f"demands {value:.3g} {unit}, "
                f"and {of} is {bound:.3g} {unit}."
            )


def with_wind(config: FlightConfig, wind: tuple[float, float, float]) -> FlightConfig:
    """Return the scenario in another mean wind.

    Args:
        wind: in W [m/s].
    Raises: ValueError: where there is no drag to feel it, or rotors cannot hold against it.
    """
    reality, vehicle = config.reality, config.vehicle
    if not np.isfinite(wind).all():
        raise ValueError(f"--wind: must be finite [m/s]; got {wind}.")
    if any(wind) and not reality.rotor_drag > 0:
        raise ValueError(
            f"--wind: acts through reality.rotor_drag, which is 0 in {config.name}. Name a "
            f"positive one."
        )
    lift = config.lift
    left = math.sqrt(max(lift**2 - (config.carried_mass * vehicle.gravity) ** 2, 0.0))
    most, size = left / max(reality.rotor_drag, 1e-12), float(np.linalg.norm(wind))
    if size > most:
        raise ValueError(
            f"--wind: must be at most {most:.3g} m/s, which the rotors hold; got {size:.4g}."
        )
    return dc.replace(config, reality=dc.replace(reality, wind=list(wind)))


def require_clearance(config: FlightConfig) -> None:
    """Check that the payload does not hang below the ground anywhere on the track.

    Raises: ValueError: where it does.
    """
    hung = config.reality.hung
    if hung.tether == "none":
        return
    lowest = float(config.motion.sample(np.arange(0.0, config.end, LOOKS))[0, :, 2].min())
    room = math.floor(100 * (lowest + hung.hook[2] - hung.radius)) / 100
    if hung.length > room:
        raise ValueError(
            f"--length: must be at most {room:.2f} m, or the payload touches the ground "
            f"where the vehicle flies at "
            f"{lowest:.2f} m; got {hung.length:g}. Raise reference.height in a scenario file."
        )
