"""Sensors of motion capture and IMU: noise sources and measurement effects as one subsystem."""

from collections.abc import Sequence

from pydrake.common import RandomDistribution
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, RandomSource, ZeroOrderHold

from np_drake.effects.base import MeasurementEffect
from np_drake.vehicle import Vehicle
from systems.measurement_effects import MeasurementEffects

# The draw changes between two sampling instants, so that controller and log read the same noise at an instant.
_DRAW_OFFSET = 0.4  # of a period


def make_sensor_rig(vehicle: Vehicle, effects: Sequence[MeasurementEffect], *, period: float) -> Diagram:
    """Return the sensors, with the ports of `MeasurementEffects` except `white`.

    The noise is drawn every `period` [s], by the diagram's random seed. The seed is set by
    `diagram.SetRandomContext(context, RandomGenerator(seed))`.
    """
    builder = DiagramBuilder()
    readings = builder.AddNamedSystem("readings", MeasurementEffects(vehicle, effects))
    size = readings.white_size
    if size:
        source = builder.AddNamedSystem("white", RandomSource(RandomDistribution.kGaussian, size, period))
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
    diagram.set_name("sensor_rig")
    return diagram


def add_sensor_rig(
    builder: DiagramBuilder,
    real_vehicle: Diagram,
    vehicle: Vehicle,
    effects: Sequence[MeasurementEffect],
    *,
    period: float,
) -> Diagram:
    """Add the sensors and connect them to the real vehicle (`make_tethered_quadrotor`).

    Args: period: of the noise [s].
    """
    rig = builder.AddSystem(make_sensor_rig(vehicle, effects, period=period))
    for source, target in (
        ("x", "x_true"),
        ("acceleration", "acceleration_true"),
        ("nominal_rotor_thrust", "nominal_rotor_thrust"),
    ):
        builder.Connect(real_vehicle.GetOutputPort(source), rig.GetInputPort(target))
    return rig
