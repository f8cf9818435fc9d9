"""What every tracking experiment shares: its configuration and its closed loop."""

import dataclasses as dc

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from diagrams.controllers import ControllerConfig, add_controller
from np_drake.effects.base import ActuatorEffect, MeasurementEffect, WrenchEffect
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.pendulum import Payload
from np_drake.effects.sensor_noise import SensorNoise
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.references.config import ReferenceConfig, make_reference
from np_drake.residual_models.oracle import TrueModel
from np_drake.vehicle import MeasurementNoise, Vehicle
from np_drake.yaml_file import load_checked
from systems.initial_state import set_hover
from systems.recorder import Recorder, add_recorder
from systems.sensor_rig import add_sensor_rig
from systems.tethered_quadrotor import PayloadConfig, make_tethered_quadrotor


@dc.dataclass
class RealityConfig:
    """In what the real vehicle differs from the one the controller knows."""

    payload: PayloadConfig = dc.field(default_factory=PayloadConfig)
    rotor_drag: float = 0.25  # on each body axis; 0 for none [N·s/m]
    motor_lag: float = 0.03  # time constant of the rotor speed; 0 for none [s]
    thrust_scale: float = 0.96  # real over nominal thrust [1]
    noise: MeasurementNoise = dc.field(default_factory=lambda: MeasurementNoise(attitude=0.003))

    def check(self) -> "RealityConfig":
        """Returns self; raises ValueError on an impossible effect."""
        self.payload.check()
        for name in ("rotor_drag", "motor_lag"):
            if not getattr(self, name) >= 0:
                raise ValueError(f"RealityConfig: {name} must not be negative; got {getattr(self, name)}.")
        if not self.thrust_scale > 0:
            raise ValueError(f"RealityConfig: thrust_scale must be positive; got {self.thrust_scale}.")
        return self

    def wrench_effects(self) -> list[WrenchEffect]:
        """The effects that push the body."""
        d = self.rotor_drag
        return [LinearDrag(d, d, d)] if d > 0 else []

    def actuator_effects(self) -> list[ActuatorEffect]:
        """The effects between command and thrust, in the order of action."""
        effects: list[ActuatorEffect] = [MotorLag(self.motor_lag)] if self.motor_lag > 0 else []
        return effects + ([ThrustScale(self.thrust_scale)] if self.thrust_scale != 1.0 else [])


@dc.dataclass
class FlightConfig:
    """A tracking experiment: ramp, then `duration` seconds that are scored."""

    name: str = "circle"
    duration: float = 50.0  # scored, after the ramp [s]
    vehicle: Vehicle = dc.field(default_factory=Vehicle)
    reality: RealityConfig = dc.field(default_factory=RealityConfig)
    reference: ReferenceConfig = dc.field(default_factory=ReferenceConfig)
    controller: ControllerConfig = dc.field(default_factory=ControllerConfig)
    simulator: SimulatorConfig = dc.field(
        default_factory=lambda: SimulatorConfig(
            integration_scheme="runge_kutta3", max_step_size=0.004, use_error_control=False
        )
    )

    def check(self) -> "FlightConfig":
        """Returns self; raises ValueError where a figure is impossible."""
        for part in (self.vehicle, self.reality, self.reference, self.controller):
            part.check()
        if not self.duration > 0:
            raise ValueError(f"FlightConfig: duration must be positive [s]; got {self.duration}.")
        return self

    def true_model(self) -> TrueModel:
        """What the oracle is told."""
        payload, believed = self.reality.payload, self.controller.believed(self.vehicle)
        bob = Payload(payload.mass, payload.length, (payload.hook[0], payload.hook[1], payload.hook[2]))
        hung = None if payload.tether == "none" else bob
        return TrueModel(believed, hung, self.reality.wrench_effects(), self.reality.actuator_effects())

    @property
    def end(self) -> float:
        """End of the flight [s]."""
        return self.reference.ramp + self.duration


def load_flight(filename: str) -> FlightConfig:
    """Reads a scenario file (YAML). Raises ValueError with file and field on bad content."""
    return load_checked(FlightConfig, filename, "scenario file")


def make_flight_diagram(config: FlightConfig) -> tuple[Diagram, Recorder]:
    """Reference, vehicle, sensors, controller and recorder, named and connected."""
    config.check()
    builder = DiagramBuilder()
    vehicle = builder.AddSystem(make_real_vehicle(config.vehicle, config.reality))
    period = config.controller.period
    noise: list[MeasurementEffect] = [SensorNoise(config.reality.noise)]
    rig = add_sensor_rig(builder, vehicle, config.vehicle, noise, period=period)
    ports = add_controller(
        builder,
        config.controller,
        config.vehicle,
        make_reference(config.reference),
        rig,
        truth=vehicle,
        true_model=config.true_model(),
    )
    builder.Connect(ports["u"], vehicle.GetInputPort("u"))
    signals = {
        "x": rig.GetOutputPort("x"),
        "acceleration": rig.GetOutputPort("acceleration"),
        "rotor_speed": rig.GetOutputPort("rotor_speed"),
        **ports,
        "x_true": vehicle.GetOutputPort("x"),
        "acceleration_true": vehicle.GetOutputPort("acceleration"),
        "rotor_thrust": vehicle.GetOutputPort("rotor_thrust"),
        "plant_state": vehicle.GetOutputPort("plant_state"),
    }
    recorder = add_recorder(builder, signals, period=period)
    diagram = builder.Build()
    diagram.set_name(config.name)
    return diagram, recorder


def make_real_vehicle(vehicle: Vehicle, reality: RealityConfig) -> Diagram:
    """The plant with the effects that `reality` switches on."""
    return make_tethered_quadrotor(
        vehicle,
        reality.payload,
        wrench_effects=reality.wrench_effects(),
        actuator_effects=reality.actuator_effects(),
    )


def initialise(diagram: Diagram, context: Context, config: FlightConfig, seed: int) -> None:
    """Noise seed, and hover at the start of the reference motion."""
    diagram.SetRandomContext(context, RandomGenerator(seed))
    plant = diagram.GetSubsystemByName("tethered_quadrotor").GetSubsystemByName("plant")
    start = make_reference(config.reference).sample(np.zeros(1))[0, 0]
    set_hover(plant, plant.GetMyMutableContextFromRoot(context), config.reality.payload, start)


def simulate(config: FlightConfig, *, seed: int, monitor=None) -> dict[str, np.ndarray]:
    """Flies the experiment; returns the recorded signals (see `Recorder.read`).

    Args: monitor: called with the flight's time [s] about every second, for progress.
    """
    diagram, recorder = make_flight_diagram(config)
    simulator = Simulator(diagram)
    ApplySimulatorConfig(config.simulator, simulator)
    context = simulator.get_mutable_context()
    initialise(diagram, context, config, seed)
    # Half a period beyond the end: the recorder passes the last row on at the end itself.
    end = config.end + 0.5 * config.controller.period
    for t in [*np.arange(1.0, config.end, 1.0), end]:
        simulator.AdvanceTo(t)
        if monitor is not None:
            monitor(min(t, config.end))
    return recorder.read(diagram, context)
