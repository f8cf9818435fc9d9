"""What goes wrong in a flight, by place in the diagram."""

import dataclasses as dc

from diagrams.loop.events import Event
from np_drake.faults.measurement import MeasurementFault
from np_drake.faults.solver import SolverFault


@dc.dataclass(frozen=True)
class Faults:
    """Faults of one flight; those of rotors and air are effects with an onset (`RealityConfig.effects`).

    measurement: between the sensors and all that reads them.   solver: of the MPC.   events: of the payload.
    """

    measurement: tuple[MeasurementFault, ...] = ()
    solver: tuple[SolverFault, ...] = ()
    events: tuple[Event, ...] = ()


NO_FAULTS = Faults()
