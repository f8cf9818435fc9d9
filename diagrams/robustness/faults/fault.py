"""A fault as plain data, and what it becomes in the loop."""

import dataclasses as dc
from collections.abc import Callable, Sequence
from typing import Any

from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_diagram import Faults
from np_drake.effects.effect_entry import EffectEntry
from np_drake.faults.measurement import MeasurementFault
from np_drake.faults.solver import SolverFault
from systems.payload_event import PayloadEvent

Part = MeasurementFault | SolverFault | EffectEntry | PayloadEvent  # by the place in the loop where it acts


@dc.dataclass(frozen=True)
class Fault:
    """Fault of a flight.

    kind: name of a `Kind`.   onset: [s].   duration: [s]; None: it lasts.   values: what else the kind draws, SI.
    """

    kind: str
    onset: float
    duration: float | None
    values: dict[str, Any]

    @property
    def span(self) -> dict[str, Any]:
        """Onset and duration [s] of a fault that ends."""
        return {"onset": self.onset, "duration": self.duration or 0.0}


@dc.dataclass(frozen=True)
class Kind:
    """Kind of fault.

    place: sensors | solver | rotors | payload | air | battery.   draw: `numpy.random.Generator` -> (duration or None,
    values).   make: fault and flight -> its part.   says: the distribution, in words.
    """

    name: str
    place: str
    draw: Callable[[Any], tuple[float | None, dict[str, Any]]]
    make: Callable[[Fault, FlightConfig], Part]
    says: str


def apply(config: FlightConfig, parts: Sequence[Part]) -> tuple[FlightConfig, Faults]:
    """Return the flight with the effects and events among the parts, and the other parts by place.

    Args:
        config: of the flight without faults.
        parts: what the faults become in it.
    """
    effects = [part for part in parts if isinstance(part, EffectEntry)]
    reality = dc.replace(config.reality, effects=[*config.reality.effects, *effects])
    faults = Faults(
        measurement=tuple(part for part in parts if isinstance(part, MeasurementFault)),
        solver=tuple(part for part in parts if isinstance(part, SolverFault)),
    )
    events = [*config.events, *(part for part in parts if isinstance(part, PayloadEvent))]
    return dc.replace(config, reality=reality, events=events).check(), faults
