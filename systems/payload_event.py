"""What happens to a payload on a cable in flight, as configuration."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

KINDS = ("attach", "impulse", "release")


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
        if self.kind not in KINDS:
            raise ValueError(f"events: kind must be one of {', '.join(KINDS)}; got {self.kind!r}.")
        if not 0 < self.time < np.inf:
            raise ValueError(f"events: time must be positive and finite [s]; got {self.time}.")
        if not 0 <= self.mass < np.inf or (self.kind == "attach") != (self.mass > 0):
            raise ValueError(
                f"events: mass must be positive for kind attach and 0 for another [kg]; "
                f"got {self.mass}."
            )
        if np.shape(self.impulse) != (3,) or not np.isfinite(self.impulse).all():
            raise ValueError(
                f"events: impulse must be three finite values [N·s]; got {self.impulse}."
            )
        if (self.kind == "impulse") != bool(np.any(self.impulse)):
            raise ValueError(
                f"events: impulse must be given for kind impulse alone [N·s]; got "
                f"{self.impulse} for {self.kind}."
            )
        return self


def attach(time: float, mass: float) -> PayloadEvent:
    """Return the event that more is hung on the payload.

    Args:
        time: at which it happens [s].
        mass: that is added [kg].
    """
    return PayloadEvent("attach", time, mass=mass)


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
