"""Length and damping of the tether that a trained model shows, for those whose forecast swings."""

import dataclasses as dc
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from np_drake.effects.pendulum import Payload
from np_drake.lifting.metrics.tether_length import GRAVITY, pendulum_length, pendulum_mode
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem, Mode
from np_drake.lifting.training.segments import Segment

VELOCITY_ALONE = "velocity alone"


class Swing(NamedTuple):
    """Tether as a model has it.

    length: [m].   damping: drag of the payload over its mass and velocity [1/s].
    """

    length: float
    damping: float


def swing_of(model: Any) -> Swing | None:
    """Return the swing of a model: of its payload, or of the mode of its lifted linear system; None without either.

    The mode is that through which the lateral velocity moves the lateral force most.
    """
    payload = getattr(model, "payload", None)
    if isinstance(payload, Payload):
        return Swing(payload.length, payload.damping)
    system = getattr(getattr(model, "model", model), "system", None)
    if not isinstance(system, LiftedLinearSystem):
        return None
    by_velocity = dc.replace(system, B=system.B * [1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    return _of_mode(pendulum_mode(by_velocity))


def swing_of_flights(segments: Sequence[Segment]) -> Swing | None:
    """Return the swing of a system that is trained on the velocity alone, see `tether_length`; None without any."""
    return _of_mode(pendulum_length(list(segments)).mode)


def _of_mode(mode: Mode | None) -> Swing | None:
    if mode is None or mode.frequency == 0:
        return None
    return Swing(GRAVITY / (2 * np.pi * mode.frequency) ** 2, 2.0 / mode.time_constant)
