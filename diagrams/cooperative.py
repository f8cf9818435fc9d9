"""Cooperative transport: n quadrotors carry one payload, each with its own controller and blind to all the others.

`cooperative.yaml` beside this file.
"""

import dataclasses as dc
import time
from pathlib import Path

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from diagrams.controllers import ControllerConfig, add_controller, make_residual_model
from diagrams.failed_run import FailedRun
from diagrams.flight import ARENA, RealityConfig
from np_drake.effects.sensor_noise import SensorNoise
from np_drake.references.base import Reference
from np_drake.references.formation import closest_approach, fly_at, payload_drop, polygon
from np_drake.references.stops import Stops
from np_drake.residual_models.base import ResidualModel
from np_drake.residual_models.failing import FAULTS, Failing
from np_drake.vehicle import Vehicle
from np_drake.yaml_file import load_checked
from systems.cooperative_quadrotors import make_cooperative_quadrotors
from systems.initial_state import set_formation
from systems.recorder import Recorder, add_recorder
from systems.sensor_rig import make_sensor_rig
from systems.tethered_quadrotor import PayloadConfig

SCENARIO = Path(__file__).with_suffix(".yaml")
MOST_VEHICLES = 8


@dc.dataclass
class CooperativeConfig:
    """Settle, hover, move along x, hover; everything after the settling is scored."""

    name: str = "cooperative"
    vehicles: int = 3
    spacing: float = 0.9  # between neighbours of the formation [m]
    height: float = 2.0  # of the vehicles [m]
    distance: float = 2.0  # of the transport [m]
    settle: float = 3.0  # not scored [s]
    hover: float = 2.0  # before the transport [s]
    transport: float = 9.0  # top speed 35/16 of its mean [s]
    rest: float = 1.0  # after the transport, scored with it [s]
    fault: str = "none"  # none | zero | frozen: of predictor 0, from the first scored instant on
    vehicle: Vehicle = dc.field(default_factory=Vehicle)
    reality: RealityConfig = dc.field(
        default_factory=lambda: RealityConfig(payload=PayloadConfig(mass=0.5, length=1.2))
    )
    controller: ControllerConfig = dc.field(default_factory=lambda: ControllerConfig(kind="np", solver="sqp"))
    simulator: SimulatorConfig = dc.field(
        default_factory=lambda: SimulatorConfig(
            integration_scheme="runge_kutta3", max_step_size=0.004, use_error_control=False
        )
    )

    def check(self) -> "CooperativeConfig":
        """Returns self; raises ValueError where a figure is impossible."""
        for part in (self.vehicle, self.reality, self.controller):
            part.check()
        if not 1 <= self.vehicles <= MOST_VEHICLES:
            raise ValueError(f"cooperative: vehicles must be 1 to {MOST_VEHICLES}; got {self.vehicles}.")
        for name in ("height", "settle", "hover", "transport", "rest"):
            if not 0 < getattr(self, name) < np.inf:
                raise ValueError(f"cooperative: {name} must be positive; got {getattr(self, name)}.")
        if not 0 <= self.distance < ARENA:
            raise ValueError(f"cooperative: distance must be 0 to {ARENA:g} m; got {self.distance}.")
        if self.controller.kind not in ("nominal", "hold", "observer", "np"):
            raise ValueError(
                f"cooperative: each vehicle knows itself alone; no controller {self.controller.kind}."
            )
        if self.fault not in ("none", *FAULTS) or (self.fault != "none" and self.controller.kind != "np"):
            raise ValueError(
                f"cooperative: fault must be none, {' or '.join(FAULTS)}, the latter of an np; got {self.fault!r}."
            )
        if not self.spacing > self.safe_distance:
            raise ValueError(
                f"cooperative: spacing must exceed {self.safe_distance:.2f} m, where rotors touch; got {self.spacing}."
            )
        self._check_physics()
        return self

    def _check_physics(self) -> None:
        share = self.vehicle.mass + self.reality.payload.mass / self.vehicles
        lift = 4 * self.vehicle.max_rotor_thrust * self.reality.thrust_scale
        if share * self.vehicle.gravity > 0.9 * lift:
            raise ValueError(
                f"cooperative: {share} kg a vehicle are more than the rotors can carry ({lift:.0f} N)."
            )
        if self.reality.payload.tether != "cable":
            raise ValueError("cooperative: the payload must hang on cables.")
        payload_drop(self.radius, self.reality.payload.length, 0.0)
        step = self.simulator.max_step_size
        if not self.simulator.use_error_control and step > self.largest_step:
            raise ValueError(
                f"cooperative: simulator.max_step_size must be at most {self.largest_step:.2g} s for these cables; "
                f"got {step}."
            )

    @property
    def corners(self) -> np.ndarray:
        """(n, 3) of the formation about its centre [m]."""
        return polygon(self.vehicles, self.spacing)

    @property
    def radius(self) -> float:
        """Of the formation [m]."""
        return float(np.linalg.norm(self.corners[0]))

    @property
    def drop(self) -> float:
        """Height of the payload over the vehicles [m]; negative."""
        payload = self.reality.payload
        return payload_drop(self.radius, payload.length, payload.hook[2])

    @property
    def safe_distance(self) -> float:
        """Between two vehicles, below which rotors may touch [m]."""
        arm = np.linalg.norm(np.array(self.vehicle.rotor_positions)[:, :2], axis=1).max()
        return 2 * float(arm + self.vehicle.rotor_radius)

    @property
    def largest_step(self) -> float:
        """Below it a fixed-step runge_kutta3 is stable: 1.7 over the fastest rate of cables and motors [s].

        Cables along unit vectors d_i: the payload feels k sum(d_i d_i^T) / m, each vehicle k / M.
        """
        payload = self.reality.payload
        d = (self.corners - [0.0, 0.0, self.drop]) / np.hypot(self.radius, self.drop)
        mobility = 1 / self.vehicle.mass + float(np.linalg.eigvalsh(d.T @ d)[-1]) / payload.mass
        rates = [np.sqrt(payload.stiffness * mobility), payload.damping * mobility]
        rates += [1 / lag for lag in (self.reality.motor_lag, self.vehicle.rotor_time_constant) if lag > 0]
        return float(1.7 / max(rates))

    @property
    def start(self) -> float:
        """Of the transport [s]."""
        return self.settle + self.hover

    @property
    def end(self) -> float:
        """Of the flight [s]."""
        return self.start + self.transport + self.rest


def load_cooperative(filename: str | Path = SCENARIO) -> CooperativeConfig:
    """Reads a scenario file (YAML). Raises ValueError with file and field on bad content."""
    return load_checked(CooperativeConfig, str(filename), "scenario file")


def center_of_formation(config: CooperativeConfig) -> Reference:
    """The motion of the formation's centre, from rest to rest along x about the origin."""
    ends = np.array([[-config.distance / 2, 0.0, config.height], [config.distance / 2, 0.0, config.height]])
    return Stops(ends, np.array([config.start]), np.array([config.transport]))


def make_cooperative_diagram(config: CooperativeConfig) -> tuple[Diagram, Recorder]:
    """One plant, and to each vehicle a pilot of its own: sensors, reference, estimator, predictor and MPC."""
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
    """What vehicle `number` carries: nothing in it reads the payload or another vehicle."""
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
    """Noise seed; vehicles level at their corners, the payload hanging between them."""
    diagram.SetRandomContext(context, RandomGenerator(seed))
    plant = diagram.GetSubsystemByName("cooperative_quadrotors").GetSubsystemByName("plant")
    center = center_of_formation(config).sample(np.zeros(1))[0, 0]
    set_formation(
        plant, plant.GetMyMutableContextFromRoot(context), config.reality.payload, center + config.corners
    )


def simulate(config: CooperativeConfig, *, seed: int, monitor=None) -> tuple[dict[str, np.ndarray], float]:
    """Flies the experiment; returns the recorded signals (see `Recorder.read`) and the processor time [s].

    Processor time, since wall time would hold whatever else the machine does.
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
