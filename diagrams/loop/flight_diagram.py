"""The closed loop of a flight as one Drake Diagram, and its initial state.

diagram = make_flight_diagram(config)
simulator = Simulator(diagram)
ApplySimulatorConfig(config.simulator, simulator)
set_initial_state(diagram, simulator.get_mutable_context(), config, seed=0)
simulator.AdvanceTo(config.end)
"""

from typing import Any

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from diagrams.loop.autopilots import add_autopilot, as_flown
from diagrams.loop.controllers import add_controller
from diagrams.loop.flight import FlightConfig, flown_by
from diagrams.loop.own_controller import Factory
from diagrams.loop.real_vehicle import DRAKE, REAL_VEHICLE, RealVehicle
from np_drake.effects.calibration import in_flight
from np_drake.effects.imu_mounting import ImuMounting
from systems.recorder import add_recorder
from systems.sensor_model import add_sensor_model

RECORDER = "recorder"  # its name as a subsystem of a flight


def make_flight_diagram(
    config: FlightConfig,
    *,
    pushed: bool = False,
    real: RealVehicle = DRAKE,
    controller: Factory | None = None,
) -> Diagram:
    """Return reference, vehicle with its events, sensors, controller and recorder as one Diagram.

    Args:
        config: of the experiment.
        pushed: whether forces from outside may act (`make_tethered_quadrotor`).
        real: makes the vehicle that flies.
        controller: makes a controller of one's own, in the place of the one that `config` names.
    """
    config = flown_by(config, controller).check()
    period = config.controller.period
    builder = DiagramBuilder()
    behind, reality = as_flown(config.autopilot, config.vehicle, config.reality)
    vehicle = builder.AddNamedSystem(
        REAL_VEHICLE,
        real.make(behind, reality, command_period=period, pushed=pushed, events=config.events),
    )
    tilt: list[Any] = [e for e in in_flight(config.vehicle) if isinstance(e, ImuMounting)]
    sensors = [*tilt, *config.reality.sensor_effects()]
    rig = add_sensor_model(builder, vehicle, config.vehicle, sensors, period=period)
    ports = add_controller(
        builder,
        config.controller,
        config.vehicle,
        config.motion,
        rig,
        truth=vehicle,
        true_model=config.true_model(),
        factory=controller,
    )
    driven, autopilot = ports["u"], {}
    if config.autopilot.flies:
        system = add_autopilot(
            builder, config.autopilot, config.vehicle, vehicle, ports["rates_thrust"]
        )
        driven = system.GetOutputPort("u")
        autopilot = (
            {"motors": system.GetOutputPort("motors")} if system.HasOutputPort("motors") else {}
        )
    builder.Connect(driven, vehicle.GetInputPort("u"))
    signals = {
        "x": rig.GetOutputPort("x"),
        "acceleration": rig.GetOutputPort("acceleration"),
        "rotor_speed": rig.GetOutputPort("rotor_speed"),
        **ports,
        **autopilot,
        "x_true": vehicle.GetOutputPort("x"),
        "acceleration_true": vehicle.GetOutputPort("acceleration"),
        "rotor_thrust": vehicle.GetOutputPort("rotor_thrust"),
        "plant_state": vehicle.GetOutputPort("plant_state"),
    }
    add_recorder(builder, signals, period=period)
    diagram = builder.Build()
    diagram.set_name(config.name)
    return diagram


def set_initial_state(
    diagram: Diagram,
    context: Context,
    config: FlightConfig,
    *,
    seed: int = 0,
    real: RealVehicle = DRAKE,
) -> None:
    """Set the seed of the noise, and hover at the start of the reference motion.

    Args:
        diagram: of `make_flight_diagram`, or one with a subsystem `tethered_quadrotor`.
        context: its root context.
        config: of the experiment.
        seed: of the sensors' noise.
        real: made the vehicle.
    """
    diagram.SetRandomContext(context, RandomGenerator(seed))
    start = config.motion.sample(np.zeros(1))[0, 0]
    real.hover(diagram.GetSubsystemByName(REAL_VEHICLE), context, config.reality, start)


def recorded(diagram: Diagram, context: Context) -> dict[str, np.ndarray]:
    """Return the signals that a flight has recorded so far, see `Recorder.read`.

    Args:
        diagram: of `make_flight_diagram`.
        context: its root context.
    """
    return diagram.GetSubsystemByName(RECORDER).read(diagram, context)
