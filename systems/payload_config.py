"""Configuration of the payload of the simulated vehicle, its tether, and what happens to it in
flight.
"""

import dataclasses as dc
import math
from collections.abc import Sequence

import numpy as np

from np_drake.checks import require
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.files.yaml_file import POSITIVE, check_fields, number, word


@dc.dataclass
class PayloadConfig:
    """Payload and tether of the simulated vehicle."""

    # cable: tension-only spring-damper | rod: universal joint and massless rod | none: no payload
    tether: str = word("cable", "cable", "rod", "none")
    mass: float = number(0.26, "kg", POSITIVE)  # of the payload
    length: float = number(0.8, "m", POSITIVE)  # of the tether
    hook: list[float] = number([0.0, 0.0, -0.025], "m")  # p_BoTo_B, the attachment
    radius: float = number(0.03, "m", POSITIVE)  # of the solid sphere that the payload is
    stiffness: float = number(2.0e4, "N/m", POSITIVE)  # of the cable
    damping: float = number(40.0, "N·s/m", 0.0)  # of the cable
    # drag of the payload in still air over mass and velocity
    air_damping: float = number(0.0, "1/s", 0.0)
    rope_mass: float = number(0.0, "kg", 0.0)  # of the cable itself
    rope_air_damping: float = number(0.0, "1/s", 0.0)  # of the cable itself, as `air_damping`
    segments: int = number(10, "1", 1, 100)  # point masses of a cable that has mass

    def __post_init__(self) -> None:
        """Raises: ValueError: as `check`."""
        self.check()

    def check(self) -> "PayloadConfig":
        """Return self after checking tether and sizes.

        Raises: ValueError: on an unknown tether or an impossible size.
        """
        check_fields(self, "PayloadConfig")
        require(
            self.tether != "rod" or not self.air_damping,
            f"PayloadConfig: air_damping must be 0 on a rod [1/s]; got "
            f"{self.air_damping}. Use a cable.",
        )
        require(
            self.tether == "cable" or not self.rope_mass,
            f"PayloadConfig: rope_mass must be 0 without a cable [kg]; got {self.rope_mass} and "
            f"tether {self.tether}.",
        )
        return self

    @property
    def pieces(self) -> np.ndarray:
        """Length, stiffness and damping of the pieces of the cable between hook, point masses and
        payload (n + 1, 3) [m, N/m, N·s/m].

        Stiffness as of equal material; damping of the ratio of cable and payload, which a piece of
        equal material would exceed by far.
        """
        if not self.rope_mass:
            return np.array([[self.length, self.stiffness, self.damping]])
        length = np.full(self.segments + 1, self.length / self.segments)
        length[[0, -1]] /= 2
        damping = np.full_like(length, self.damping * math.sqrt(self.rope_mass / self.mass))
        return np.column_stack([length, self.stiffness * self.length / length, damping])

    @property
    def fastest(self) -> tuple[float, float, float]:
        """Mass, stiffness and damping of what vibrates fastest along the cable [kg, N/m, N·s/m];
        of point masses Gershgorin's bound.
        """
        _, stiffness, damping = self.pieces.max(axis=0)
        if not self.rope_mass:
            return self.mass, stiffness, damping
        return min(self.rope_mass / self.segments, self.mass), 3 * stiffness, 4 * damping

    @property
    def reach(self) -> float:
        """How far the lowest point of the payload hangs below Bo of a level vehicle [m]."""
        return self.length + self.radius - self.hook[2]

    @property
    def pendulum(self) -> tuple[float, float]:
        """Mass and length of the payload on a cable without mass that pulls as this one, which
        swings straight: S²/I and I/S [kg, m], with moment S and moment of inertia I about the hook.
        The rest of the mass rides on the hook.
        """
        S = self.mass + self.rope_mass / 2
        I = self.mass + self.rope_mass / 3
        return S**2 / I, self.length * I / S


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


@dc.dataclass
class PayloadEvent:
    """Instantaneous change of a payload on a cable."""

    # attach: more is hung on | impulse: it is pushed | release: the cable is cut
    kind: str = word("impulse", "attach", "impulse", "release")
    time: float = number(0.0, "s", POSITIVE)  # at which it happens
    # of kind attach: what is hung on the payload and moves with it
    mass: float = number(0.0, "kg", 0.0)
    impulse: list[float] = number([0.0, 0.0, 0.0], "N·s")  # of kind impulse, in W

    def check(self) -> "PayloadEvent":
        """Return self after checking kind, time and size.

        Raises: ValueError: on an unknown kind or an impossible value.
        """
        check_fields(self, "events")
        require(
            (self.kind == "attach") == (self.mass > 0),
            f"events: mass must be positive for kind attach and 0 for another [kg]; "
            f"got {self.mass}.",
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
