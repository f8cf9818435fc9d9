"""Sensor model of motion capture and IMU: measurement effects and their noise sources as one
subsystem.

Without effects the sensors are ideal and the true motion passes.
"""

from collections.abc import Sequence

import numpy as np
from pydrake.common import RandomDistribution
from pydrake.common.value import Value
from pydrake.systems.framework import Diagram, DiagramBuilder, LeafSystem, ValueProducer
from pydrake.systems.primitives import ConstantVectorSource, RandomSource, ZeroOrderHold

from np_drake.effects.base import Measurement, MeasurementEffect
from np_drake.vehicle import Vehicle

# The draw changes between two sampling instants, so that controller and log read the same noise at
# an instant.
_DRAW_OFFSET = 0.4  # of a period


class MeasurementEffects(LeafSystem):
    """Chain of measurement effects through which the true motion passes.

    .. pydrake_system::

        name: MeasurementEffects
        input_ports:
        - x_true
        - acceleration_true
        - nominal_rotor_thrust
        - white
        output_ports:
        - x
        - acceleration
        - rotor_speed

    | port | size | meaning | unit |
    |---|---|---|---|
    | x_true, x | 13 | state, true and as read | |
    | acceleration_true, acceleration | 6 | [a in W, al in B] | m/s², rad/s² |
    | nominal_rotor_thrust | 4 | thrust coefficient times the square of the actual rotor speed | N |
    | white | sum of white_size | standard normal draws, held between samples | 1 |
    | rotor_speed | 4 | as read | rad/s |

    Args:
        vehicle: whose thrust coefficient turns thrust into rotor speed.
        effects: from the true motion to the reading, in this order.
    Raises: ValueError: on an effect that shifts the clock, which no causal sensor can do.
    """

    def __init__(self, vehicle: Vehicle, effects: Sequence[MeasurementEffect]):
        super().__init__()
        shifted = [e.identifier for e in effects if getattr(e, "clock_shift", 0.0) != 0.0]
        if shifted:
            raise ValueError(
                f"MeasurementEffects: a reading must not look into the future; got "
                f"{', '.join(shifted)}. "
                "Shift the recorded log instead (np_drake.logs.clock.shift_state)."
            )
        self._vehicle = vehicle
        self._effects = list(effects)
        self.white_size = sum(e.white_size for e in effects)
        self._x_port = self.DeclareVectorInputPort("x_true", 13)
        self._acceleration_port = self.DeclareVectorInputPort("acceleration_true", 6)
        self._thrust_port = self.DeclareVectorInputPort("nominal_rotor_thrust", 4)
        self._white_port = self.DeclareVectorInputPort("white", self.white_size)
        inputs = {self.all_input_ports_ticket()}
        # Acceleration and rotor speed of one instant are of the same pass through the effects.
        self._reading = self.DeclareCacheEntry(
            "reading", ValueProducer(allocate=Value[object], calc=self._calc_reading), inputs
        )
        # x alone must not pull accelerations: they feed through from the forces.
        state_inputs = {self._x_port.ticket(), self._white_port.ticket()}
        self.DeclareVectorOutputPort("x", 13, self._calc_x, state_inputs)
        self.DeclareVectorOutputPort("acceleration", 6, self._calc_acceleration, inputs)
        self.DeclareVectorOutputPort("rotor_speed", 4, self._calc_rotor_speed, inputs)

    def _measure(self, context, rest: np.ndarray, thrust: np.ndarray) -> Measurement:
        rotor = np.sqrt(np.maximum(thrust, 0.0) / self._vehicle.thrust_coefficient)
        reading = Measurement(self._x_port.Eval(context), rest[:3], rest[3:], rotor)
        white = self._white_port.Eval(context)
        start = 0
        for effect in self._effects:
            reading = effect.measure(
                self._vehicle, reading, white[start : start + effect.white_size]
            )
            start += effect.white_size
        return reading

    def _calc_reading(self, context, value) -> None:
        value.set_value(
            self._measure(
                context, self._acceleration_port.Eval(context), self._thrust_port.Eval(context)
            )
        )

    def _calc_x(self, context, output) -> None:
        output.SetFromVector(self._measure(context, np.zeros(6), np.zeros(4)).x)

    def _calc_acceleration(self, context, output) -> None:
        reading = self._reading.Eval(context)
        output.SetFromVector(np.concatenate([reading.a, reading.al]))

    def _calc_rotor_speed(self, context, output) -> None:
        output.SetFromVector(self._reading.Eval(context).rotor)


def make_sensor_model(
    vehicle: Vehicle, effects: Sequence[MeasurementEffect], *, period: float
) -> Diagram:
    """Return the sensors, with the ports of `MeasurementEffects` except `white`.

    The noise is drawn by the diagram's random seed, which `diagram.SetRandomContext(context,
    RandomGenerator(seed))` sets.

    Args:
        vehicle: whose thrust coefficient turns thrust into rotor speed.
        effects: from the true motion to the reading, in this order.
        period: of the noise [s].
    """
    builder = DiagramBuilder()
    readings = builder.AddNamedSystem("readings", MeasurementEffects(vehicle, effects))
    size = readings.white_size
    if size:
        source = builder.AddNamedSystem(
            "white", RandomSource(RandomDistribution.kGaussian, size, period)
        )
        hold = builder.AddNamedSystem("draw", ZeroOrderHold(period, size, _DRAW_OFFSET * period))
        builder.Connect(source.get_output_port(), hold.get_input_port())
        builder.Connect(hold.get_output_port(), readings.GetInputPort("white"))
    else:
        source = builder.AddNamedSystem("white", ConstantVectorSource([]))
        builder.Connect(source.get_output_port(), readings.GetInputPort("white"))
    for name in ("x_true", "acceleration_true", "nominal_rotor_thrust"):
        builder.ExportInput(readings.GetInputPort(name), name)
    for name in ("x", "acceleration", "rotor_speed"):
        builder.ExportOutput(readings.GetOutputPort(name), name)
    diagram = builder.Build()
    diagram.set_name("sensor_model")
    return diagram


def add_sensor_model(
    builder: DiagramBuilder,
    real_vehicle: Diagram,
    vehicle: Vehicle,
    effects: Sequence[MeasurementEffect],
    *,
    period: float,
) -> Diagram:
    """Add the sensors and connect them to the real vehicle.

    Args:
        builder: of the diagram that gets the sensors.
        real_vehicle: of `make_tethered_quadrotor`.
        vehicle: as of `make_sensor_model`.
        effects: as of `make_sensor_model`.
        period: of the noise [s].
    """
    sensors = builder.AddSystem(make_sensor_model(vehicle, effects, period=period))
    for source, target in (
        ("x", "x_true"),
        ("acceleration", "acceleration_true"),
        ("nominal_rotor_thrust", "nominal_rotor_thrust"),
    ):
        builder.Connect(real_vehicle.GetOutputPort(source), sensors.GetInputPort(target))
    return sensors
