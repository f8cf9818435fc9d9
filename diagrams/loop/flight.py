"""Configuration of a tracking experiment, and its scenario file."""

import copy
import dataclasses as dc
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.systems.analysis import GetIntegrationSchemes, SimulatorConfig

from diagrams.loop.autopilots import NONE, AutopilotConfig
from diagrams.loop.controller_config import ControllerConfig
from diagrams.loop.own_controller import Factory, beside, is_own, kind_of
from diagrams.loop.reality import RealityConfig
from diagrams.loop.scaled import scaled
from diagrams.loop.track_limits import require_flyable, warnings
from np_drake.autopilot.offboard import OffboardConfig
from np_drake.command_delay import LONGEST_DELAY
from np_drake.effects.calibration import in_flight
from np_drake.effects.combine import mass_properties, split_effects
from np_drake.effects.pendulum import Payload
from np_drake.files.yaml_file import filled, one_line, read_yaml
from np_drake.references.base import Reference
from np_drake.references.config import ReferenceConfig, make_reference
from np_drake.references.payload import PayloadTrack
from np_drake.residual_models.oracle import TrueModel
from np_drake.vehicle import Vehicle
from systems.payload_event import PayloadEvent

MOST_ROWS = 10**6  # of a record, at one a period, which takes 700 MB; own choice: 5 hours at 50 Hz
FINEST_STEP = 1e-6  # of the simulator [s]; own choice
LOOKS = 0.01  # between two looks at a motion [s]
# of a cable that is to stay taut, over the payload's weight; own choice: below it gusts slacken it
# [1]
LEAST_PULL = 0.2
LIFTED = 0.9  # of the rotors' thrust that may hang on them; own choice: the rest steers [1]
ARENA = 50.0  # farther than this from the origin a vehicle counts as lost [m]


@dc.dataclass
class FlightConfig:
    """Tracking experiment: a ramp, then `duration` seconds that are scored."""

    name: str = "circle"  # of the experiment and of its files
    duration: float = 50.0  # scored, after the ramp [s]
    scaled: bool = (
        False  # the file's values are those for the paper's vehicle and scale with this one
    )
    vehicle: Vehicle = dc.field(default_factory=Vehicle)  # as the controller believes it
    reality: RealityConfig = dc.field(default_factory=RealityConfig)  # what acts beyond that
    reference: ReferenceConfig = dc.field(default_factory=ReferenceConfig)  # motion to follow
    controller: ControllerConfig = dc.field(
        default_factory=ControllerConfig
    )  # its kind, MPC and timing
    autopilot: AutopilotConfig = dc.field(
        default_factory=AutopilotConfig
    )  # between controller and rotors
    offboard: OffboardConfig = dc.field(
        default_factory=OffboardConfig
    )  # of `np-drake node`; a simulation has none
    # What happens to the payload in flight, at times of their own.
    events: list[PayloadEvent] = dc.field(default_factory=list)
    # Drake's integrator and its step.
    simulator: SimulatorConfig = dc.field(
        default_factory=lambda: SimulatorConfig(
            integration_scheme="runge_kutta3", max_step_size=0.004, use_error_control=False
        )
    )

    def check(self) -> "FlightConfig":
        """Return self after checking all values.

        Raises: ValueError: where one is impossible.
        """
        for part in (
            self.vehicle,
            self.reality,
            self.reference,
            self.controller,
            self.autopilot,
            self.offboard,
        ):
            part.check()
        if not re.fullmatch(r"\w[\w.-]*", self.name):
            raise ValueError(
                f"FlightConfig: name must be letters, digits, '_', '-' and '.'; got {self.name!r}."
            )
        if not 0 < self.duration < np.inf:
            raise ValueError(
                f"FlightConfig: duration must be positive and finite [s]; got {self.duration}."
            )
        if self.end > MOST_ROWS * self.controller.period:
            raise ValueError(
                f"FlightConfig: duration must be at most "
                f"{MOST_ROWS * self.controller.period:g} s with the ramp and at "
                f"a period of {self.controller.period:g} s; got {self.end:g}. Fly it in parts."
            )
        self._check_events()
        self._check_autopilot()
        if self.controller.kind == "oracle":
            self._check_oracle()
        if self.carried_mass * self.vehicle.gravity > LIFTED * self.lift:
            raise ValueError(
                f"FlightConfig: {self.carried_mass:.4g} kg are more than the rotors can "
                f"carry ({self.lift:.3g} N). "
                "Name a lighter payload, or none, for the default scales with the vehicle."
            )
        self._check_simulator()
        if self.follows_payload:
            self._check_followed()
        if self.reference.is_file or self.reference.track == "multisine" or self.follows_payload:
            self._check_track()
        return self

    def _check_events(self) -> None:
        times = [event.check().time for event in self.events]
        if len({*times}) < len(times) or not all(t < self.end for t in times):
            raise ValueError(
                f"{self.name}: events must have times of their own within the flight; got "
                f"{times} [s]."
            )
        if times and self.reality.hung.tether != "cable":
            raise ValueError(
                f"{self.name}: events need a payload on a cable; got {self.reality.hung.tether}."
            )

    def _check_autopilot(self) -> None:
        rates, kind = self.controller.mpc.command == "rates", self.controller.kind
        if rates != self.autopilot.flies:
            raise ValueError(
                f"{self.name}: controller.mpc.command must be rates with an autopilot and "
                f"rotors without; got "
                f"{self.controller.mpc.command} and autopilot {self.autopilot.kind}."
            )
        if rates and kind in ("oracle", "cascade"):
            raise ValueError(
                f"{self.name}: autopilot: {kind} commands torque, which an autopilot does not take."
            )
        if rates and self.vehicle.rate_loop is None:
            raise ValueError(
                f"{self.name}: vehicle {self.vehicle.name!r} must have a rate_loop for an "
                f"autopilot; it has none."
            )

    def with_autopilot(self, kind: str) -> "FlightConfig":
        """Return the flight with an autopilot, whose controller commands body rates.

        Args:
            kind: of `AUTOPILOTS`.
        """
        mpc = dc.replace(self.controller.mpc, command="rates" if kind != NONE else "rotors")
        autopilot, controller = (
            dc.replace(self.autopilot, kind=kind),
            dc.replace(self.controller, mpc=mpc),
        )
        return dc.replace(self, autopilot=autopilot, controller=controller)

    def _check_oracle(self) -> None:
        reality, longest = self.reality, LONGEST_DELAY * self.controller.period
        if reality.payload.tether == "rod":
            raise ValueError("FlightConfig: the oracle knows cable and no tether; got a rod.")
        if reality.dead_time > longest:
            raise ValueError(
                f"FlightConfig: the oracle knows delays up to {longest:g} s; got "
                f"{reality.dead_time:g}."
            )

    def _check_followed(self) -> None:
        if self.reality.hung.tether != "cable":
            raise ValueError(
                f"{self.name}: reference.follow: payload needs a payload on a cable; got "
                f"{self.reality.hung.tether}."
            )
        released = [f"released at {t:g} s" for t in [self.cut_at] if t < np.inf]
        hung = [f"hung on at {t:g} s" for t in [self.reality.hangs_at] if t > 0]
        if told := " and ".join([*hung, *released]):
            raise ValueError(
                f"{self.name}: reference.follow: payload needs a payload that hangs all "
                f"the time; it is {told}. "
                "Follow the vehicle, or leave that out."
            )
        pull = self._payload_track.least_pull(np.arange(0.0, self.end, LOOKS))
        if pull < LEAST_PULL:
            raise ValueError(
                f"{self.name}: must keep the cable taut; its pull falls to {pull:.2g} of "
                f"the payload's weight, and at "
                f"least {LEAST_PULL:g} is needed. Take a lower speed."
            )

    def _check_track(self) -> None:
        vehicle, thrust = (
            self.vehicle.with_mass(self.carried_mass),
            self.reality.thrust_at(self.vehicle, self.end),
        )
        try:
            require_flyable(
                self.motion, vehicle, self.controller.mpc, end=self.end, arena=ARENA, thrust=thrust
            )
        except ValueError as error:
            raise ValueError(f"{self.reference.track}: {error}") from error

    def _check_simulator(self) -> None:
        scheme, step = self.simulator.integration_scheme, self.simulator.max_step_size
        if scheme not in GetIntegrationSchemes() or not FINEST_STEP <= step < np.inf:
            raise ValueError(
                f"FlightConfig: simulator must name a scheme of Drake's and a step of at "
                f"least {FINEST_STEP:g} s; "
                f"got {scheme}, {step}."
            )
        if not self.simulator.use_error_control and step > self.largest_step:
            raise ValueError(
                f"FlightConfig: simulator.max_step_size must be at most "
                f"{self.largest_step:.2g} s for this cable and "
                f"these motors; got {step}. Take a smaller step or error control."
            )

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields for another process, Drake's settings of the simulator by name."""
        fields = SimulatorConfig.__fields__
        return vars(self) | {"simulator": {f.name: getattr(self.simulator, f.name) for f in fields}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state | {"simulator": SimulatorConfig(**state["simulator"])})

    @property
    def track(self) -> Reference:
        """Motion that the scenario names: of the vehicle, or of its payload."""
        return make_reference(self.reference)

    @property
    def follows_payload(self) -> bool:
        """Whether the payload is to follow the track, and not the vehicle."""
        return self.reference.follow == "payload"

    @property
    def motion(self) -> Reference:
        """Motion of the vehicle that the controller follows."""
        return self._payload_track if self.follows_payload else self.track

    @property
    def _payload_track(self) -> PayloadTrack:
        hung = self.reality.hung
        return PayloadTrack(self.track, self.vehicle, length=hung.length, hook=hung.hook)

    @property
    def carried_mass(self) -> float:
        """Mass of quadrotor and payload [kg]."""
        payload = self.reality.hung
        own = mass_properties(self.vehicle, self.reality.mass_effects()).mass
        return own + (payload.mass if payload.tether != "none" else 0.0)

    @property
    def lift(self) -> float:
        """Thrust of all rotors at the end; what fails in flight may fail altogether, and does not
        count [N].
        """
        share = self.reality.thrust_at(self.vehicle, self.end, failing=False)
        return 4 * self.vehicle.max_rotor_thrust * share

    @property
    def largest_step(self) -> float:
        """Stability limit of a fixed-step runge_kutta3: 1.7 over the fastest rate of cable and
        motors [s].

        The cable moves the payload against the quadrotor, which yields by its mass and, where the
        cable pulls across
        the hook's lever, by turning: 1 / reduced = 1 / m_P + 1 / m + |p_BoTo_B|² / J.
        """
        payload, rates = self.reality.hung, [1e-3]
        if payload.tether == "cable":
            reduced = 1 / (1 / payload.mass + _hook_mobility(self.vehicle, payload.hook))
            rates += [np.sqrt(payload.stiffness / reduced), payload.damping / reduced]
        rates += [
            1 / lag for lag in (*self.reality.lags, self.vehicle.rotor_time_constant) if lag > 0
        ]
        return float(1.7 / max(rates))

    def true_model(self) -> TrueModel:
        """Return the model of the real vehicle for the oracle, which knows the events too."""
        reality, payload = self.reality, self.reality.hung
        x, y, z = payload.hook
        bob = Payload(payload.mass, payload.length, (x, y, z), payload.air_damping)
        hung = None if payload.tether == "none" else bob
        own = split_effects(in_flight(self.vehicle, beside=reality.actuator_effects()))
        actuators = [*reality.actuator_effects(), *own.actuator]
        return TrueModel(
            self.controller.believed(self.vehicle),
            hung,
            [*own.wrench, *reality.wrench_effects()],
            [e for e in actuators if e.dead_time == 0.0],
            sum(e.dead_time for e in actuators),
            reality.onsets,
            [*own.mass, *reality.mass_effects()],
            reality.hangs_at,
            self._payloads(hung),
        )

    def _payloads(self, first: Payload | None) -> list[tuple[float, Payload | None]]:
        """Return (time [s], payload from then on) of every event."""
        changes, payload = [], first
        for event in sorted(self.events, key=lambda event: event.time):
            if payload is not None and event.kind == "attach":
                payload = dc.replace(payload, mass=payload.mass + event.mass)
            elif event.kind == "release":
                payload = None
            changes.append((event.time, payload))
        return changes

    @property
    def cut_at(self) -> float:
        """When the cable is cut; infinite: never [s]."""
        return min((event.time for event in self.events if event.kind == "release"), default=np.inf)

    def warnings(self) -> list[str]:
        """Return sentences on waypoints that the track does not pass, and on legs that it
        leaves.
        """
        return warnings(self.reference, self.track, end=self.end)

    def check_and_step(self) -> "FlightConfig":
        """Return a checked copy whose fixed step of the simulator is within `largest_step`."""
        simulator = copy.copy(self.simulator)
        simulator.max_step_size = min(simulator.max_step_size, 0.95 * self.largest_step)
        return dc.replace(self, simulator=simulator).check()

    @property
    def end(self) -> float:
        """End of the flight [s]."""
        return self.reference.lead + self.duration


def _hook_mobility(vehicle: Vehicle, hook: Sequence[float]) -> float:
    """Return the acceleration of the hook over a pull across its lever, 1 / m + |p_BoTo_B|² / J
    [1/kg].
    """
    return float(1 / vehicle.mass + np.sum(np.square(hook)) / np.linalg.eigvalsh(vehicle.J)[0])


def flown_by(config: FlightConfig, factory: Factory | None) -> FlightConfig:
    """Return the scenario with the kind of the controller that `factory` makes; as it is where that
    is None.

    Args:
        config: of the experiment.
        factory: of a controller of one's own.
    """
    if factory is None:
        return config
    return dc.replace(config, controller=dc.replace(config.controller, kind=kind_of(factory)))


def default_flight(vehicle: Vehicle) -> FlightConfig:
    """Return the default scenario of `vehicle`: that of the paper's, scaled by size, mass and
    time.
    """
    return scaled(FlightConfig(vehicle=vehicle))


def load_flight(filename: str, vehicle: Vehicle | None = None) -> FlightConfig:
    """Read a scenario file (YAML).

    Defaults scale with the vehicle, and what the file names stands in SI, unless it says `scaled:
    true`. The CSV file of a track lies relative to the scenario file; where the latter names no
    duration, the flight has the track's own.

    Args:
        filename: of the scenario.
        vehicle: flies in place of the file's.
    Raises: ValueError: one line with file and field, on bad content.
    """
    with one_line(filename, "scenario file"):
        flight = _read(read_yaml(filename), vehicle, Path(filename).parent)
        flight = flight.with_autopilot(flight.autopilot.kind) if flight.autopilot.flies else flight
        if is_own(flight.controller.kind):
            flight.controller.kind = beside(flight.controller.kind, Path(filename).parent)
        return flight.check()


def _read(content: Any, vehicle: Vehicle | None, folder: Path) -> FlightConfig:
    """Return what a scenario file in `folder` names, over the defaults of its vehicle."""
    named = filled(FlightConfig(), content)
    own = vehicle or named.vehicle.check()
    if named.scaled and named.reality.effects:
        raise ValueError("reality.effects stand in SI and do not scale; leave `scaled` out.")
    if named.scaled:
        return scaled(dc.replace(named, vehicle=own))
    default = default_flight(own)
    flight = filled(dc.replace(default, duration=np.nan), content)
    flight.vehicle = own
    if flight.reference.is_file:
        flight.reference.track = str(folder / flight.reference.track)
        flight.reference.check()
    if np.isnan(flight.duration):
        natural = flight.reference.own_duration
        flight.duration = default.duration if natural is None else natural
    return flight
