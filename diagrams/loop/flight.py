"""Common parts of every tracking experiment: its configuration and its closed loop."""

import copy
import dataclasses as dc
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import ApplySimulatorConfig, GetIntegrationSchemes, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from diagrams.batch.failed_run import FailedRun
from diagrams.loop.controllers import ControllerConfig, add_controller
from diagrams.loop.events import Event, beginnings, payloads
from diagrams.loop.faults import NO_FAULTS, Faults
from diagrams.loop.real_vehicle import DRAKE, REAL_VEHICLE, RealVehicle
from diagrams.loop.reality import RealityConfig
from diagrams.loop.scaled import scaled
from diagrams.loop.track_limits import require_flyable
from np_drake.command_delay import LONGEST_DELAY
from np_drake.effects.combine import mass_properties
from np_drake.effects.pendulum import Payload
from np_drake.files.yaml_file import Read, load_checked
from np_drake.references.config import ReferenceConfig, make_reference
from np_drake.residual_models.oracle import TrueModel
from np_drake.vehicle import Vehicle
from systems.recorder import Recorder, add_recorder
from systems.sensor_faults import add_sensor_faults
from systems.sensor_rig import add_sensor_rig

GROUND = 0.0  # height below which a vehicle counts as lost: the simulator has no ground, flights do [m]
MOST_ROWS = 10**6  # of a record, at one a period, which takes 700 MB; own choice: 5 hours at 50 Hz
FINEST_STEP = 1e-6  # of the simulator [s]; own choice
ARENA = 50.0  # farther than this from the origin a vehicle counts as lost [m]


class LostVehicle(FailedRun):
    """Early end of a flight.

    signals: until then, in the form of `Recorder.read`.
    """

    signals: dict[str, np.ndarray]


@dc.dataclass
class FlightConfig:
    """Tracking experiment: a ramp, then `duration` seconds that are scored."""

    name: str = "circle"
    duration: float = 50.0  # scored, after the ramp [s]
    scaled: bool = False  # the file's values are those for the paper's vehicle and scale with this one
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
        """Return self after checking all values.

        Raises: ValueError: where one is impossible.
        """
        for part in (self.vehicle, self.reality, self.reference, self.controller):
            part.check()
        if not re.fullmatch(r"\w[\w.-]*", self.name):
            raise ValueError(
                f"FlightConfig: name must be letters, digits, '_', '-' and '.'; got {self.name!r}."
            )
        if not 0 < self.duration < np.inf:
            raise ValueError(f"FlightConfig: duration must be positive and finite [s]; got {self.duration}.")
        if self.end > MOST_ROWS * self.controller.period:
            raise ValueError(
                f"FlightConfig: duration must be at most {MOST_ROWS * self.controller.period:g} s with the ramp and at "
                f"a period of {self.controller.period:g} s; got {self.end:g}. Fly it in parts."
            )
        if self.controller.kind == "oracle":
            self._check_oracle()
        # What fails in flight may fail altogether: that is no mistake of the scenario.
        lift = (
            4 * self.vehicle.max_rotor_thrust * self.reality.thrust_at(self.vehicle, self.end, failing=False)
        )
        if self.carried_mass * self.vehicle.gravity > 0.9 * lift:
            raise ValueError(
                f"FlightConfig: {self.carried_mass:.4g} kg are more than the rotors can carry ({lift:.3g} N). "
                "Name a lighter payload, or none, for the default scales with the vehicle."
            )
        self._check_simulator()
        if self.reference.is_file:
            self._check_track()
        return self

    def _check_oracle(self) -> None:
        reality, longest = self.reality, LONGEST_DELAY * self.controller.period
        if reality.payload.tether == "rod":
            raise ValueError("FlightConfig: the oracle knows cable and no tether; got a rod.")
        if reality.dead_time > longest:
            raise ValueError(
                f"FlightConfig: the oracle knows delays up to {longest:g} s; got {reality.dead_time:g}."
            )

    def _check_track(self) -> None:
        vehicle, thrust = (
            self.vehicle.with_mass(self.carried_mass),
            self.reality.thrust_at(self.vehicle, self.end),
        )
        try:
            require_flyable(
                make_reference(self.reference),
                vehicle,
                self.controller.mpc,
                end=self.end,
                arena=ARENA,
                thrust=thrust,
            )
        except ValueError as error:
            raise ValueError(f"{self.reference.track}: {error}") from error

    def _check_simulator(self) -> None:
        scheme, step = self.simulator.integration_scheme, self.simulator.max_step_size
        if scheme not in GetIntegrationSchemes() or not FINEST_STEP <= step < np.inf:
            raise ValueError(
                f"FlightConfig: simulator must name a scheme of Drake's and a step of at least {FINEST_STEP:g} s; "
                f"got {scheme}, {step}."
            )
        if not self.simulator.use_error_control and step > self.largest_step:
            raise ValueError(
                f"FlightConfig: simulator.max_step_size must be at most {self.largest_step:.2g} s for this cable and "
                f"these motors; got {step}. Take a smaller step or error control."
            )

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields for another process, Drake's settings of the simulator by name."""
        fields = SimulatorConfig.__fields__
        return vars(self) | {"simulator": {f.name: getattr(self.simulator, f.name) for f in fields}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state | {"simulator": SimulatorConfig(**state["simulator"])})

    @property
    def carried_mass(self) -> float:
        """Mass of quadrotor and payload [kg]."""
        payload = self.reality.hung
        own = mass_properties(self.vehicle, self.reality.mass_effects()).mass
        return own + (payload.mass if payload.tether != "none" else 0.0)

    @property
    def largest_step(self) -> float:
        """Stability limit of a fixed-step runge_kutta3: 1.7 over the fastest rate of cable and motors [s].

        The cable moves the payload against the quadrotor, which yields by its mass and, where the cable pulls across
        the hook's lever, by turning: 1 / reduced = 1 / m_P + 1 / m + |p_BoTo_B|² / J.
        """
        payload, rates = self.reality.hung, [1e-3]
        if payload.tether == "cable":
            reduced = 1 / (1 / payload.mass + hook_mobility(self.vehicle, payload.hook))
            rates += [np.sqrt(payload.stiffness / reduced), payload.damping / reduced]
        rates += [1 / lag for lag in (*self.reality.lags, self.vehicle.rotor_time_constant) if lag > 0]
        return float(1.7 / max(rates))

    def true_model(self, events: Sequence[Event] = ()) -> TrueModel:
        """Return the model of the real vehicle for the oracle, which knows the events too."""
        payload, believed = self.reality.hung, self.controller.believed(self.vehicle)
        hook = (payload.hook[0], payload.hook[1], payload.hook[2])
        bob = Payload(payload.mass, payload.length, hook, payload.air_damping)
        hung = None if payload.tether == "none" else bob
        reality = self.reality
        return TrueModel(
            believed,
            hung,
            reality.wrench_effects(),
            [e for e in reality.actuator_effects() if e.dead_time == 0.0],
            reality.dead_time,
            reality.onsets,
            reality.mass_effects(),
            reality.hangs_at,
            payloads(hung, events),
        )

    def check_and_step(self) -> "FlightConfig":
        """Return a checked copy whose fixed step of the simulator is within `largest_step`."""
        simulator = copy.copy(self.simulator)
        simulator.max_step_size = min(simulator.max_step_size, 0.95 * self.largest_step)
        return dc.replace(self, simulator=simulator).check()

    @property
    def end(self) -> float:
        """End of the flight [s]."""
        return self.reference.lead + self.duration


def hook_mobility(vehicle: Vehicle, hook: Sequence[float]) -> float:
    """Return the acceleration of the hook over a pull across its lever, 1 / m + |p_BoTo_B|² / J [1/kg]."""
    return float(1 / vehicle.mass + np.sum(np.square(hook)) / np.linalg.eigvalsh(vehicle.J)[0])


def default_flight(vehicle: Vehicle) -> FlightConfig:
    """Return the default scenario of `vehicle`: that of the paper's, scaled by size, mass and time."""
    return scaled(FlightConfig(vehicle=vehicle))


def load_flight(filename: str, vehicle: Vehicle | None = None) -> FlightConfig:
    """Read a scenario file (YAML).

    Defaults scale with the vehicle, and what the file names stands in SI, unless it says `scaled: true`. The CSV file
    of a track lies relative to the scenario file; where the latter names no duration, the flight has the track's own.
    Args: vehicle: flies in place of the file's.
    Raises: ValueError: one line with file and field, on bad content.
    """

    def complete(read: Read) -> FlightConfig:
        named = read(FlightConfig())
        own = vehicle or named.vehicle.check()
        if named.scaled and named.reality.effects:
            raise ValueError("reality.effects stand in SI and do not scale; leave `scaled` out.")
        if named.scaled:
            return scaled(dc.replace(named, vehicle=own))
        flight = dc.replace(read(dc.replace(default_flight(own), duration=np.nan)), vehicle=own)
        if flight.reference.is_file:
            flight.reference.track = str(Path(filename).parent / flight.reference.track)
            flight.reference.check()
        if np.isnan(flight.duration):
            natural = flight.reference.own_duration
            flight.duration = default_flight(own).duration if natural is None else natural
        return flight

    return load_checked(FlightConfig, filename, "scenario file", complete)


class Watch(Protocol):
    """Viewer that looks at a flight while it is simulated, may push the vehicle, and may end the flight.

    period: time between two looks [s].   rate: real-time rate at which the flight runs; 0 for as fast as possible [1].
    """

    period: float
    rate: float

    def begin(self, diagram: Diagram, context: Context) -> None:
        """See the flight before it begins."""

    def look(self, context: Context) -> bool:
        """See the flight, and return whether it goes on."""


def make_flight_diagram(
    config: FlightConfig, *, pushed: bool = False, faults: Faults = NO_FAULTS, real: RealVehicle = DRAKE
) -> tuple[Diagram, Recorder]:
    """Return reference, vehicle, sensors, controller and recorder as one Diagram, and the recorder.

    Args: pushed: whether forces from outside may act (`make_tethered_quadrotor`).   faults: of sensors and solver;
    no fault of its own reaches the oracle, which still knows the events.   real: makes the vehicle.
    """
    config.check()
    builder = DiagramBuilder()
    period = config.controller.period
    vehicle = builder.AddNamedSystem(
        REAL_VEHICLE, real.make(config.vehicle, config.reality, command_period=period, pushed=pushed)
    )
    sensors = config.reality.sensor_effects()
    rig = add_sensor_rig(builder, vehicle, config.vehicle, sensors, period=period)
    knows = config.controller.kind == "oracle"
    if faults.measurement and not knows:
        rig = add_sensor_faults(builder, rig, faults.measurement, period=period)
    ports = add_controller(
        builder,
        config.controller,
        config.vehicle,
        make_reference(config.reference),
        rig,
        truth=vehicle,
        true_model=config.true_model(faults.events),
        solver_faults=() if knows else faults.solver,
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


def initialise(
    diagram: Diagram, context: Context, config: FlightConfig, seed: int, real: RealVehicle = DRAKE
) -> None:
    """Set the noise seed, and hover at the start of the reference motion."""
    diagram.SetRandomContext(context, RandomGenerator(seed))
    start = make_reference(config.reference).sample(np.zeros(1))[0, 0]
    real.hover(diagram.GetSubsystemByName(REAL_VEHICLE), context, config.reality, start)


def simulate(
    config: FlightConfig,
    *,
    seed: int,
    monitor=None,
    events: Sequence[Event] = (),
    faults: Faults = NO_FAULTS,
    tolerance: float = np.inf,
    watch: Watch | None = None,
    real: RealVehicle = DRAKE,
) -> dict[str, np.ndarray]:
    """Simulate the experiment and return the recorded signals (see `Recorder.read`).

    Args:
        monitor: called with the flight's time [s] about every second, for progress.
        events: changes of the vehicle, each applied at its time, before the controller's own event of that instant.
        faults: of sensors and solver, and events that belong to faults.
        tolerance: distance from the reference beyond which the flight ends, looked at about every second [m].
        watch: looks at the flight, sets its pace and may end it early.
        real: makes the vehicle that flies.
    Raises: LostVehicle: if the integrator gives up, or the vehicle leaves arena or tolerance, or is below ground;
    ValueError: on what `real` cannot do.
    """
    faults = dc.replace(faults, events=(*events, *faults.events))
    events = faults.events
    if events and not real.takes_events:
        raise ValueError(f"{config.name}: events must be none for this simulator; fly Drake's vehicle.")
    diagram, recorder = make_flight_diagram(config, pushed=watch is not None, faults=faults, real=real)
    simulator = Simulator(diagram)
    ApplySimulatorConfig(config.simulator, simulator)
    context = simulator.get_mutable_context()
    initialise(diagram, context, config, seed, real)
    # Half a period beyond the end: the recorder passes the last row on at the end itself.
    end = config.end + 0.5 * config.controller.period
    vehicle, reference = diagram.GetSubsystemByName(REAL_VEHICLE), make_reference(config.reference)
    due = {event.time: event for event in events}
    if len(due) < len(events) or any(not 0 < t < config.end for t in due):
        raise ValueError(
            f"{config.name}: events must have times of their own within the flight; got {[*due]} [s]."
        )
    begun = beginnings(config.vehicle, config.reality, config.end)

    def lost(why: str) -> LostVehicle:
        error = LostVehicle(f"{config.name}: {why}")
        error.signals = recorder.read(diagram, context)
        return error

    looks = [] if watch is None else np.arange(watch.period, config.end, watch.period).tolist()
    if watch is not None:
        simulator.set_target_realtime_rate(watch.rate)
        watch.begin(diagram, context)
    for t in sorted({*np.arange(1.0, config.end, 1.0).tolist(), *due, *begun, *looks, end}):
        try:
            simulator.AdvanceTo(t)
        except RuntimeError as error:
            raise lost(f"the simulation ended before {t:.1f} s: {error}") from error
        p_WB = vehicle.GetOutputPort("x").Eval(vehicle.GetMyContextFromRoot(context))[:3]
        if not np.linalg.norm(p_WB) < ARENA:
            raise lost(f"{config.controller.kind} lost the vehicle before {t:.1f} s.")
        if p_WB[2] < GROUND:
            raise lost(f"{config.controller.kind} flew into the ground before {t:.1f} s.")
        if not np.linalg.norm(p_WB - reference.sample(np.array([t]))[0, 0]) < tolerance:
            raise lost(f"{config.controller.kind} was off its reference at {t:.1f} s.")
        for event in [*begun.get(t, ()), *([due[t]] if t in due else [])]:
            event.apply(vehicle, context)
        if monitor is not None:
            monitor(min(t, config.end))
        if watch is not None and not watch.look(context):
            break
    return recorder.read(diagram, context)
