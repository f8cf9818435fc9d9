"""Sensor faults between the sensors and all that reads them."""

from collections.abc import Sequence

import numpy as np
from pydrake.systems.framework import BasicVector, Diagram, DiagramBuilder, LeafSystem

from np_drake.control.faults import READING, READING_SIZE, MeasurementFault

_SIZES = {name: where.stop - where.start for name, where in READING.items()}


class SensorFaults(LeafSystem):
    """Samples of the sensors as they are delivered under faults, the first fault first.

    .. pydrake_system::

        name: SensorFaults
        input_ports:
        - x
        - acceleration
        - rotor_speed
        output_ports:
        - x
        - acceleration
        - rotor_speed

    | port | size | meaning | unit |
    |---|---|---|---|
    | x (in, out) | 13 | measured state, as sensed and as delivered; NaN where a value is missing | |
    | acceleration (in, out) | 6 | [a in W, al in B] | m/s², rad/s² |
    | rotor_speed (in, out) | 4 | | rad/s |

    State: the last readings (depth, 23), the newest first, and the number of the newest (1), -1
    before any.
    Event: periodic, every `period`. Between two events the input of now passes for the sample of
        the last.

    Args:
        faults: first to last.
        period: between samples [s].
    """  # noqa: E501

    def __init__(self, faults: Sequence[MeasurementFault], *, period: float):
        super().__init__()
        self._faults, self._period = tuple(faults), period
        self._depth = 2 + max((fault.oldest(period) for fault in self._faults), default=0)
        self._input_ports = {
            name: self.DeclareVectorInputPort(name, size) for name, size in _SIZES.items()
        }
        self.DeclareDiscreteState(BasicVector(np.zeros(self._depth * READING_SIZE)))
        self.DeclareDiscreteState(BasicVector([-1.0]))
        held = {self.xd_ticket(), self.time_ticket()}
        # x alone must not pull accelerations: they feed through from the forces.
        for name in READING:
            inputs = {self._input_ports[name].ticket()}
            needed = inputs if name == "x" else {self.all_input_ports_ticket()}
            self.DeclareVectorOutputPort(name, _SIZES[name], self._calc(name), held | needed)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update_readings)

    def _now(self, context, *, state_only: bool = False) -> np.ndarray:
        """Return the reading of now; without all but x where only the state is asked for."""
        reading = np.zeros(READING_SIZE)
        for name, where in READING.items():
            if name == "x" or not state_only:
                reading[where] = self._input_ports[name].Eval(context)
        return reading

    def _sample(self, context, now: np.ndarray, k: int, columns: list[int]) -> np.ndarray:
        """Return these columns of sample k, or of the oldest that is kept."""
        newest = int(context.get_discrete_state(1).value()[0])
        if newest < 0:
            return now[columns]
        back = min(max(newest - max(k, 0), 0), newest, self._depth - 1)
        return (
            context.get_discrete_state(0).value().reshape(self._depth, READING_SIZE)[back, columns]
        )

    def _delivered(self, context, now: np.ndarray) -> np.ndarray:
        t = context.get_time()
        k, reading = int(t / self._period + 1e-6), now
        for fault in self._faults:
            if not fault.acts(t):
                continue
            source, columns = fault.delivered(k, self._period), list(fault.columns)
            if source != k:
                reading = reading.copy()
                reading[columns] = self._sample(context, now, source, columns)
            reading = fault.reads(reading)
        return reading

    def _update_readings(self, context, discrete_state) -> None:
        kept = context.get_discrete_state(0).value()
        k = int(context.get_time() / self._period + 1e-6)
        discrete_state.set_value(0, np.concatenate([self._now(context), kept[:-READING_SIZE]]))
        discrete_state.set_value(1, [float(k)])

    def _calc(self, name: str):
        def calc(context, output) -> None:
            delivered = self._delivered(context, self._now(context, state_only=name == "x"))
            output.SetFromVector(delivered[READING[name]])

        return calc


def add_sensor_faults(
    builder: DiagramBuilder, sensors: Diagram, faults: Sequence[MeasurementFault], *, period: float
) -> SensorFaults:
    """Add the faults behind the sensors (`make_sensor_model`), whose ports they have.

    Args:
        builder: of the diagram.
        sensors: which measure.
        faults: first to last.
        period: between samples [s].
    """
    system = builder.AddNamedSystem("sensor_faults", SensorFaults(faults, period=period))
    for name in READING:
        builder.Connect(sensors.GetOutputPort(name), system.GetInputPort(name))
    return system
