"""Tether and payload that a trained model shows: by the mode of its forecast, or as it estimates them in flight."""

import dataclasses as dc
from collections import deque
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from np_drake.effects.pendulum import Payload
from np_drake.flight_log import FlightLog
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem, Mode
from np_drake.payload_filter.payload_estimate import PayloadEstimate, payload_estimate
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.skill.flight_walk import walk
from np_drake.skill.tether_length import GRAVITY, pendulum_length, pendulum_mode
from np_drake.training_data.sampled_flight import sampled_flight
from np_drake.training_data.segments import Segment
from np_drake.vehicle import Vehicle

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


def payload_on(model: Any, opened: tuple[FlightLog, Vehicle]) -> PayloadEstimate | None:
    """Return what a pendulum predictor believes of the payload at the end of a flight; None of another model."""
    if not isinstance(model, PayloadFilter):
        return None
    flight = sampled_flight(*opened, step=model.step, label=model.label)
    ((_, memory),) = deque(walk(model, flight), maxlen=1)
    return payload_estimate(memory)


def swing_of_flights(segments: Sequence[Segment]) -> Swing | None:
    """Return the swing of a system that is trained on the velocity alone, see `tether_length`; None without any."""
    return _of_mode(pendulum_length(list(segments)).mode)


def _of_mode(mode: Mode | None) -> Swing | None:
    if mode is None or mode.frequency == 0:
        return None
    return Swing(GRAVITY / (2 * np.pi * mode.frequency) ** 2, 2.0 / mode.time_constant)
