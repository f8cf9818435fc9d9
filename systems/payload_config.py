"""Configuration of the payload of the simulated vehicle, its tether, and what happens to it in
flight.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.checks import require
from np_drake.effects.suspended_payload import SuspendedPayload


@dc.dataclass
class PayloadConfig:
    """Payload and tether of the simulated vehicle."""

    # cable: tension-only spring-damper | rod: universal joint and massless rod | none: no payload
    tether: str = "cable"
    mass: float = 0.26  # of the payload [kg]
    length: float = 0.8  # of the tether [m]
    hook: list[float] = dc.field(
        default_factory=lambda: [0.0, 0.0, -0.025]
    )  # p_BoTo_B, the attachment [m]
    radius: float = 0.03  # of the solid sphere that the payload is [m]
    stiffness: float = 2.0e4  # of the cable [N/m]
    damping: float = 40.0  # of the cable [N·s/m]
    air_damping: float = 0.0  # drag of the payload in still air over mass and velocity [1/s]

    def check(self) -> "PayloadConfig":
        """Return self after checking tether and sizes.

        Raises: ValueError: on an unknown tether or an impossible size.
        """
        require(
            self.tether in ("cable", "rod", "none"),
            f"PayloadConfig: tether must be cable, rod or none; got {self.tether!r}.",
        )
        for name in ("mass", "length", "radius", "stiffness"):
            require(
                0 < getattr(self, name) < np.inf,
                f"PayloadConfig: {name} must be positive and finite; got {getattr(self, name)}.",
            )
        require(
            self.damping >= 0 and np.shape(self.hook) == (3,),
            "PayloadConfig: damping must not be negative and hook must be (3,) [m].",
        )
        require(
            0 <= self.air_damping < np.inf,
            f"PayloadConfig: air_damping must be finite and not negative [1/s]; got "
            f"{self.air_damping}.",
        )
        require(
            self.tether != "rod" or not self.air_damping,
            f"PayloadConfig: air_damping must be 0 on a rod [1/s]; got "
            f"{self.air_damping}. Use a cable.",
        )
        return self


def payload_config(effect: SuspendedPayload | None) -> PayloadConfig:
    """Return the body that the effect stands for; no tether where there is no payload or it weighs
    nothing.
    """
    if effect is None or effect.mass == 0.0:
        return PayloadConfig(tether="none")
    hook = [effect.hook_x, effect.hook_y, effect.hook_z]
    return PayloadConfig(
        "cable", effect.mass, effect.length, hook, air_damping=effect.damping
    ).check()


def as_light(payload: PayloadConfig) -> PayloadConfig:
    """Return the payload with stiffness and damping of its cable reduced for a mass below the
    default.

    A light payload on the usual cable would need tiny steps.
    Source: own choice: stiffness and damping over mass stay, and with them the stretch under its
        weight.
    """
    share = min(payload.mass / PayloadConfig.mass, 1.0)
    return dc.replace(payload, stiffness=share * payload.stiffness, damping=share * payload.damping)


EVENTS = ("attach", "impulse", "release")


@dc.dataclass
class PayloadEvent:
    """Instantaneous change of a payload on a cable."""

    kind: str = (
        "impulse"  # attach: more is hung on | impulse: it is pushed | release: the cable is cut
    )
    time: float = 0.0  # at which it happens [s]
    mass: float = 0.0  # of kind attach: what is hung on the payload and moves with it [kg]
    impulse: list[float] = dc.field(
        default_factory=lambda: [0.0, 0.0, 0.0]
    )  # of kind impulse, in W [N·s]

    def check(self) -> "PayloadEvent":
        """Return self after checking kind, time and size.

        Raises: ValueError: on an unknown kind or an impossible value.
        """
        require(
            self.kind in EVENTS,
            f"events: kind must be one of {', '.join(EVENTS)}; got {self.kind!r}.",
        )
        require(
            0 < self.time < np.inf,
            f"events: time must be positive and finite [s]; got {self.time}.",
        )
        require(
            0 <= self.mass < np.inf and (self.kind == "attach") == (self.mass > 0),
            f"events: mass must be positive for kind attach and 0 for another [kg]; "
            f"got {self.mass}.",
        )
        require(
            np.shape(self.impulse) == (3,) and np.isfinite(self.impulse).all(),
            f"events: impulse must be three finite values [N·s]; got {self.impulse}.",
        )
        require(
            (self.kind == "impulse") == bool(np.any(self.impulse)),
            f"events: impulse must be given for kind impulse alone [N·s]; got "
            f"{self.impulse} for {self.kind}.",
        )
        return self


def push(time: float, impulse: Sequence[float]) -> PayloadEvent:
    """Return the event that the payload is pushed.

    Args:
        time: at which it happens [s].
        impulse: (3,) in W [N·s].
    """
    return PayloadEvent("impulse", time, impulse=[float(value) for value in impulse])


def release(time: float) -> PayloadEvent:
    """Return the event that the cable is cut at `time` [s]; the payload falls."""
    return PayloadEvent("release", time)
