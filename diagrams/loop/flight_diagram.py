"""The closed loop of a flight as one Drake Diagram, and its initial state.

diagram = make_flight_diagram(config)
simulator = make_simulator(diagram, config, seed=0)
simulator.AdvanceTo(config.end)
"""

import dataclasses as dc
from typing import Any

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, LeafSystem, OutputPort

from diagrams.loop.controller_config import AutopilotConfig
from diagrams.loop.controllers import add_controller, connect
from diagrams.loop.flight import FlightConfig, flown_by
from diagrams.loop.own_controller import Factory
from diagrams.loop.reality import REAL_VEHICLE, RealityConfig, make_real_vehicle
from np_drake import effects
from np_drake.autopilot.betaflight import Betaflight
from np_drake.effects.calibration import in_flight
from np_drake.vehicle import Vehicle
from systems import add_recorder, add_sensor_model
from systems.betaflight import BetaflightAutopilot
from systems.plant import set_hover
from systems.rate_loop import RateLoopAutopilot

# names as subsystems of a flight
RECORDER = "recorder"
AUTOPILOT = "autopilot"


def make_flight_diagram(config: FlightConfig, *, controller: Factory | None = None) -> Diagram:
    """Return reference, vehicle with its events, sensors, controller and recorder as one Diagram.

    Args:
        config: of the experiment.
        controller: makes a controller of one's own, in the place of the one that `config` names.
    """
    config = flown_by(config, controller).check().check_start()
    period = config.controller.period
    builder = DiagramBuilder()
    behind, reality = _as_flown(config.autopilot, config.vehicle, config.reality)
    vehicle = builder.AddNamedSystem(
        REAL_VEHICLE,
        make_real_vehicle(behind, reality, command_period=period, events=config.events),
    )
    tilt: list[Any] = [e for e in in_flight(config.vehicle) if isinstance(e, effects.ImuMounting)]
    sensors = [*tilt, *config.reality.sensor_effects()]
    rig = add_sensor_model(builder, vehicle, config.vehicle, sensors, period=period)
    signals = {name: rig.GetOutputPort(name) for name in ("x", "acceleration", "rotor_speed")}
    signals |= add_controller(
        builder,
        config.controller,
        config.vehicle,
        config.motion,
        rig,
        model=config.true_model() if config.controller.kind == "oracle" else None,
        factory=controller,
    )
    driven = signals["u"]
    if config.autopilot.flies:
        autopilot = _add_autopilot(builder, config, vehicle, signals["rates_thrust"])
        driven = autopilot.GetOutputPort("u")
        if autopilot.HasOutputPort("motors"):
            signals["motors"] = autopilot.GetOutputPort("motors")
    builder.Connect(driven, vehicle.GetInputPort("u"))
    signals |= {
        "x_true": vehicle.GetOutputPort("x"),
        "acceleration_true": vehicle.GetOutputPort("acceleration"),
        "rotor_thrust": vehicle.GetOutputPort("rotor_thrust"),
        "plant_state": vehicle.GetOutputPort("plant_state"),
    }
    add_recorder(builder, signals, period=period)
    diagram = builder.Build()
    diagram.set_name(config.name)
    return diagram


def _add_autopilot(
    builder: DiagramBuilder, config: FlightConfig, real: Diagram, rates_thrust: OutputPort
) -> LeafSystem:
    """Add the autopilot of a flight, and return it; its port `u` drives the rotors.

    Args:
        real: the vehicle that flies, whose true motion the autopilot's sensors see.
    Raises: ValueError: where the firmware is missing or refuses its settings.
    """
    vehicle = config.vehicle
    names = ["x"]
    system: LeafSystem
    if config.autopilot.kind == "rate_loop":
        system = RateLoopAutopilot(vehicle)
    else:
        system = BetaflightAutopilot(vehicle, Betaflight(vehicle, config.autopilot.betaflight))
        names.append("acceleration")
    builder.AddNamedSystem(AUTOPILOT, system)
    connect(builder, real, system, *names)
    builder.Connect(rates_thrust, system.GetInputPort("rates_thrust"))
    return system


def _as_flown(
    config: AutopilotConfig, vehicle: Vehicle, reality: RealityConfig
) -> tuple[Vehicle, RealityConfig]:
    """Return the vehicle and what acts on it behind an autopilot; lag and delay of the rotors are
    within a rate loop.
    """
    if config.kind != "rate_loop":
        return vehicle, reality
    late = (effects.MotorLag, effects.CommandDelay)
    others = [entry for entry in reality.effects if not isinstance(entry.made, late)]
    at_once = dc.replace(reality, motor_lag=0.0, command_delay=0.0, effects=others)
    return dc.replace(vehicle, rotor_time_constant=0.0), at_once


def firmware_of(diagram: Diagram) -> Betaflight | None:
    """Return the firmware of a flight of `make_flight_diagram`, None where it has none."""
    known = diagram.HasSubsystemNamed(AUTOPILOT)
    return getattr(diagram.GetSubsystemByName(AUTOPILOT), "firmware", None) if known else None


def make_simulator(diagram: Diagram, config: FlightConfig, *, seed: int = 0) -> Simulator:
    """Return Drake's Simulator of a flight by the integrator of `config`, at the flight's start.

    Args: as of `set_initial_state`.
    """
    simulator = Simulator(diagram)
    ApplySimulatorConfig(config.simulator, simulator)
    set_initial_state(diagram, simulator.get_mutable_context(), config, seed=seed)
    return simulator


def set_initial_state(
    diagram: Diagram, context: Context, config: FlightConfig, *, seed: int = 0
) -> None:
    """Set the seed of the noise, and hover at the start of the reference, with the payload at
    its static stretch.

    Args:
        diagram: of `make_flight_diagram`, or one with a subsystem `tethered_quadrotor`.
        context: its root context.
        config: of the experiment.
        seed: of the sensors' noise.
    """
    diagram.SetRandomContext(context, RandomGenerator(seed))
    start = config.motion.sample(np.zeros(1))[0, 0]
    plant = diagram.GetSubsystemByName(REAL_VEHICLE).GetSubsystemByName("plant")
    set_hover(plant, plant.GetMyMutableContextFromRoot(context), config.reality.hung, start)


def recorded(diagram: Diagram, context: Context) -> dict[str, np.ndarray]:
    """Return the signals that a flight has recorded so far, see `Recorder.read`.

    Args:
        diagram: of `make_flight_diagram`.
        context: its root context.
    """
    return diagram.GetSubsystemByName(RECORDER).read(diagram, context)
