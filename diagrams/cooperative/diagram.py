"""Cooperative transport: n quadrotors carry one payload, each with its own controller and no view of the others."""

import time

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from diagrams.batch.failed_run import FailedRun
from diagrams.cooperative.config import CooperativeConfig
from diagrams.loop.controllers import add_controller, make_residual_model
from diagrams.loop.flight import ARENA
from np_drake.effects.sensor_noise import SensorNoise
from np_drake.references.base import Reference
from np_drake.references.formation import closest_approach, fly_at
from np_drake.references.stops import Stops
from np_drake.residual_model import ResidualModel
from np_drake.residual_models.failing import Failing
from systems.cooperative_quadrotors import make_cooperative_quadrotors
from systems.initial_state import set_formation
from systems.recorder import Recorder, add_recorder
from systems.sensor_rig import make_sensor_rig


def center_of_formation(config: CooperativeConfig) -> Reference:
    """Return the motion of the formation's centre, from rest to rest along x about the origin."""
    ends = np.array([[-config.distance / 2, 0.0, config.height], [config.distance / 2, 0.0, config.height]])
    return Stops(ends, np.array([config.start]), np.array([config.transport]))


def make_cooperative_diagram(config: CooperativeConfig) -> tuple[Diagram, Recorder]:
    """Return one plant with sensors, reference, estimator, predictor and MPC of each vehicle, and the recorder."""
    config.check()
    builder = DiagramBuilder()
    fleet = builder.AddSystem(
        make_cooperative_quadrotors(
            config.vehicle,
            config.reality.payload,
            count=config.vehicles,
            wrench_effects=config.reality.wrench_effects(),
            actuator_effects=config.reality.actuator_effects(),
        )
    )
    center, signals = center_of_formation(config), {}
    for i, corner in enumerate(config.corners):
        pilot = builder.AddSystem(_make_pilot(config, fly_at(center, corner), number=i))
        for name in ("x", "acceleration", "nominal_rotor_thrust"):
            builder.Connect(fleet.GetOutputPort(f"{name}_{i}"), pilot.GetInputPort(name))
        builder.Connect(pilot.GetOutputPort("u"), fleet.GetInputPort(f"u_{i}"))
        for k in range(pilot.num_output_ports()):
            port = pilot.get_output_port(k)
            signals[f"{port.get_name()}_{i}"] = port
        for name in ("x", "tether_wrench"):
            signals[f"{name}_{i}"] = fleet.GetOutputPort(f"{name}_{i}")
    signals["plant_state"] = fleet.GetOutputPort("plant_state")
    recorder = add_recorder(builder, signals, period=config.controller.period)
    diagram = builder.Build()
    diagram.set_name(config.name)
    return diagram, recorder


def _make_pilot(config: CooperativeConfig, reference: Reference, *, number: int) -> Diagram:
    """Return the systems of vehicle `number`; nothing in them reads the payload or another vehicle."""
    builder, period = DiagramBuilder(), config.controller.period
    rig = builder.AddSystem(
        make_sensor_rig(config.vehicle, [SensorNoise(config.reality.noise)], period=period)
    )
    ports = add_controller(
        builder, config.controller, config.vehicle, reference, rig, model=_model(config, number)
    )
    for name, port in (("x", "x_true"), ("acceleration", "acceleration_true")):
        builder.ExportInput(rig.GetInputPort(port), name)
    builder.ExportInput(rig.GetInputPort("nominal_rotor_thrust"), "nominal_rotor_thrust")
    for name, source in ports.items():
        builder.ExportOutput(source, name)
    diagram = builder.Build()
    diagram.set_name(f"pilot_{number}")
    return diagram


def _model(config: CooperativeConfig, number: int) -> ResidualModel | None:
    model = make_residual_model(config.controller, config.controller.believed(config.vehicle))
    if model is None or number != 0 or config.fault == "none":
        return model
    return Failing(model, fault=config.fault, onset=config.settle)


def initialise(diagram: Diagram, context: Context, config: CooperativeConfig, seed: int) -> None:
    """Set the noise seed, vehicles level at their corners and the payload hanging between them."""
    diagram.SetRandomContext(context, RandomGenerator(seed))
    plant = diagram.GetSubsystemByName("cooperative_quadrotors").GetSubsystemByName("plant")
    center = center_of_formation(config).sample(np.zeros(1))[0, 0]
    set_formation(
        plant, plant.GetMyMutableContextFromRoot(context), config.reality.payload, center + config.corners
    )


def simulate(config: CooperativeConfig, *, seed: int, monitor=None) -> tuple[dict[str, np.ndarray], float]:
    """Simulate the experiment and return the recorded signals (see `Recorder.read`) and the processor time [s].

    Processor time, since wall time would include the load of other programs.
    Args: monitor: called with the flight's time [s] about every second, for progress.
    Raises: FailedRun: if the integrator gives up, a vehicle leaves the arena or two come too close.
    """
    diagram, recorder = make_cooperative_diagram(config)
    simulator = Simulator(diagram)
    ApplySimulatorConfig(config.simulator, simulator)
    context = simulator.get_mutable_context()
    initialise(diagram, context, config, seed)
    fleet = diagram.GetSubsystemByName("cooperative_quadrotors")
    began = time.process_time()
    for t in [*np.arange(1.0, config.end, 1.0), config.end + 0.5 * config.controller.period]:
        try:
            simulator.AdvanceTo(t)
        except RuntimeError as error:
            raise FailedRun(f"{config.name}: the simulation ended before {t:.1f} s: {error}") from error
        x = fleet.GetOutputPort("plant_state").Eval(fleet.GetMyContextFromRoot(context))
        if not np.linalg.norm(x) < ARENA:
            raise FailedRun(f"{config.name}: a vehicle or the payload was lost before {t:.1f} s.")
        if monitor is not None:
            monitor(min(t, config.end))
    signals = recorder.read(diagram, context)
    spent = time.process_time() - began
    p = np.stack([signals[f"x_{i}"][:, :3] for i in range(config.vehicles)])
    if closest_approach(p) < config.safe_distance:
        raise FailedRun(f"{config.name}: two vehicles came within {closest_approach(p):.2f} m of each other.")
    return signals, spent
