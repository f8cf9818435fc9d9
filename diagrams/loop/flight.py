"""Configuration of a tracking experiment, and its scenario file."""

import copy
import dataclasses as dc
import logging
import re
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.systems.analysis import GetIntegrationSchemes, SimulatorConfig

from diagrams.batch.run import require
from diagrams.loop.controller_config import NONE, AutopilotConfig, ControllerConfig
from diagrams.loop.own_controller import Factory, is_own, kind_of, with_file
from diagrams.loop.reality import RealityConfig
from diagrams.loop.scaled import scaled
from np_drake.autopilot.offboard import OffboardConfig
from np_drake.command_delay import LONGEST_DELAY
from np_drake.effects.combine import mass_properties
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.pendulum import Payload
from np_drake.files.yaml_file import filled, one_line, read_yaml
from np_drake.references.base import Reference
from np_drake.references.config import ReferenceConfig, make_reference
from np_drake.references.flatness import targets
from np_drake.residual_models.oracle import TrueModel
from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadEvent

logger = logging.getLogger(__name__)
MOST_ROWS = 10**6  # of a record, at one a period, which takes 700 MB; own choice: 5 hours at 50 Hz
FINEST_STEP = 1e-6  # of the simulator [s]; own choice
SLOW = 0.1  # of the step that was set: a warning; own choice [1]
RATE = 100.0  # at which a motion is looked at [Hz]
MOST_INSTANTS = 200_000  # of a motion that are looked at
LIFTED = 0.9  # of the rotors' thrust that may hang on them; own choice: the rest steers [1]
WIDER = "Take a lower speed, a larger track or a longer ramp."  # where it has a name
ARENA = 50.0  # farther than this from the origin a vehicle counts as lost [m]


@dc.dataclass
class FlightConfig:
    """Tracking experiment: a ramp, then `duration` seconds that are scored."""

    name: str = "circle"  # of the experiment and its files; letters, digits, `_`, `-`, `.`
    duration: float = 50.0  # scored, after the ramp; of a track with an end: until there [s]
    # the file's values are those for the paper's vehicle and scale with this one
    scaled: bool = False
    # that flies, and as the controller assumes it where `controller.vehicle` names no other
    vehicle: Vehicle = dc.field(default_factory=Vehicle)
    reality: RealityConfig = dc.field(default_factory=RealityConfig)  # what acts beyond that
    reference: ReferenceConfig = dc.field(default_factory=ReferenceConfig)  # motion to follow
    # its kind, MPC and timing
    controller: ControllerConfig = dc.field(default_factory=ControllerConfig)
    # what stands between controller and rotors
    autopilot: AutopilotConfig = dc.field(default_factory=AutopilotConfig)
    # of `np-drake node`; a simulation has none
    offboard: OffboardConfig = dc.field(default_factory=OffboardConfig)
    # what happens to the payload in flight
    events: list[PayloadEvent] = dc.field(default_factory=list)
    # Drake's integrator and its step
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
        require(
            re.fullmatch(r"\w[\w.-]*", self.name) is not None,
            f"FlightConfig: name must be letters, digits, '_', '-' and '.'; got {self.name!r}.",
        )
        require(
            0 < self.duration < np.inf,
            f"FlightConfig: duration must be positive and finite [s]; got {self.duration}.",
        )
        longest = MOST_ROWS * self.controller.period
        require(
            self.end <= longest,
            f"FlightConfig: duration must be at most {longest:g} s with the ramp and at a period "
            f"of {self.controller.period:g} s; got {self.end:g}. Fly it in parts.",
        )
        times = [event.check().time for event in self.events]
        tether = self.reality.hung.tether
        require(
            len({*times}) == len(times) and all(t < self.end for t in times),
            f"{self.name}: events must have times of their own within the flight; got {times} [s].",
        )
        require(
            not times or tether == "cable",
            f"{self.name}: events need a payload on a cable; got {tether}.",
        )
        self._check_controller()
        require(
            self.carried_mass * self.vehicle.gravity <= LIFTED * self.lift,
            f"FlightConfig: {self.carried_mass:.4g} kg are more than the rotors can carry "
            f"({self.lift:.3g} N). "
            "Name a lighter payload, or none, for the default scales with the vehicle.",
        )
        scheme = self.simulator.integration_scheme
        step = self.simulator.max_step_size
        require(
            scheme in GetIntegrationSchemes() and FINEST_STEP <= step < np.inf,
            f"FlightConfig: simulator must name a scheme of Drake's and a step of at least "
            f"{FINEST_STEP:g} s; got {scheme}, {step:.3g}. A softer or heavier cable takes longer "
            "ones.",
        )
        require(
            self.simulator.use_error_control or step <= self.largest_step,
            f"FlightConfig: simulator.max_step_size must be at most {self.largest_step:.2g} s for "
            f"this cable and these motors; got {step}. Take a smaller step, a softer "
            "cable or error control.",
        )
        self._check_track()
        return self

    def check_start(self) -> "FlightConfig":
        """Return self after checking that the payload is hung above the ground, which the simulator
        does not have.

        Raises: ValueError: where it is not.
        """
        hung = self.reality.hung
        t = self.reality.hangs_at
        height = self.motion.sample(np.array([t]))[0, 0, 2]
        require(
            hung.tether == "none" or hung.reach <= height,
            f"{self.name}: the payload must hang above the ground at {t:g} s; its lowest point is "
            f"{hung.reach - height:.2f} m below it, on {hung.length:.3g} m from {height:.3g} m. "
            "Raise reference.height, or shorten the tether (reality.payload.length).",
        )
        return self

    def _check_controller(self) -> None:
        """Check that the controller commands what flies, and that an oracle can know it."""
        kind = self.controller.kind
        rates = self.controller.mpc.command == "rates"
        require(
            rates == self.autopilot.flies,
            f"{self.name}: controller.mpc.command must be rates with an autopilot and rotors "
            f"without; got {self.controller.mpc.command} and autopilot {self.autopilot.kind}.",
        )
        require(
            not rates or kind not in ("oracle", "cascade"),
            f"{self.name}: autopilot: {kind} commands torque, which an autopilot does not take.",
        )
        require(
            not rates or self.vehicle.rate_loop is not None,
            f"{self.name}: vehicle {self.vehicle.name!r} must have a rate_loop for an autopilot; "
            "it has none.",
        )
        oracle = kind == "oracle"
        longest = LONGEST_DELAY * self.controller.period
        payload = self.reality.payload
        require(
            not oracle or (payload.tether != "rod" and not payload.rope_mass),
            "FlightConfig: the oracle knows a cable without mass and no tether; got a rod or "
            "rope_mass.",
        )
        require(
            not oracle or self.reality.dead_time <= longest,
            f"FlightConfig: the oracle knows delays up to {longest:g} s; got "
            f"{self.reality.dead_time:g}.",
        )

    def in_reality(self, reality: RealityConfig) -> "FlightConfig":
        """Return the flight in another reality, as much higher as its payload hangs lower there."""
        lower = reality.hung.reach - self.reality.hung.reach
        more = max(lower, 0.0) if reality.hung.tether != "none" else 0.0
        reference = dc.replace(self.reference, height=self.reference.height + more)
        return dc.replace(self, reality=reality, reference=reference)

    def with_autopilot(self, kind: str) -> "FlightConfig":
        """Return the flight with an autopilot, whose controller commands body rates.

        Args:
            kind: of `AUTOPILOTS`.
        """
        command = "rates" if kind != NONE else "rotors"
        changed = {"autopilot": {"kind": kind}, "controller": {"mpc": {"command": command}}}
        return filled(self, changed)

    def _check_track(self) -> None:
        """Check the motion against ground, arena, the controller's bounds and the rotors."""
        vehicle = self.vehicle.with_mass(self.carried_mass)
        mpc = self.controller.mpc
        t = np.linspace(0.0, self.end, min(int(self.end * RATE) + 2, MOST_INSTANTS))
        flat = self.motion.sample(t)
        force = flat[2] + [0.0, 0.0, vehicle.gravity]
        upright = force[:, 2] / np.maximum(np.linalg.norm(force, axis=1), 1e-9)
        thrust = targets(vehicle, flat, np.zeros((len(t), 6)))[1] @ vehicle.unmixer.T
        rotors = thrust / self.reality.thrust_at(self.vehicle, self.end)
        of_file = self.reference.is_file
        size = np.linalg.norm(flat[2], axis=1)
        slower = "Take a lower speed, or more time between the rows." if of_file else WIDER
        smoother = "Take a lower speed, or smoother positions with more digits."
        smoother = smoother if of_file else WIDER
        bounds = (
            (
                -flat[0, :, 2],
                0.0,
                "stay above the ground; is {:.3g} m below it",
                "Raise its points.",
            ),
            (
                np.linalg.norm(flat[0], axis=1),
                ARENA,
                f"stay within {ARENA:g} m of the origin; is {{:.4g}} m away",
                "Move it.",
            ),
            (
                np.abs(flat[1]).max(axis=1),
                mpc.max_speed,
                f"be within controller.mpc.max_speed, {mpc.max_speed:.3g} m/s; demands {{:.3g}} "
                "m/s",
                slower,
            ),
            (
                rotors.max(axis=1),
                vehicle.max_rotor_thrust,
                f"be within max_rotor_thrust, {vehicle.max_rotor_thrust:.3g} N; demands {{:.3g}} N "
                "of a rotor for {:.3g} m/s²",
                smoother,
            ),
            (
                np.arccos(np.clip(upright, -1.0, 1.0)),
                mpc.max_tilt,
                f"be within controller.mpc.max_tilt, {mpc.max_tilt:.3g} rad; demands {{:.3g}} rad",
                slower,
            ),
            (-rotors.min(axis=1), 0.0, "pull no rotor down; demands {:.3g} N of one", smoother),
        )
        for values, bound, what, remedy in bounds:
            k = np.argmax(values)
            broken = f"must {what.format(values[k], size[k])} at {t[k]:.2f} s. {remedy}"
            require(values[k] <= bound, f"{self.reference.track}: {broken}")

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields for another process, Drake's settings of the simulator by name."""
        fields = SimulatorConfig.__fields__
        return vars(self) | {"simulator": {f.name: getattr(self.simulator, f.name) for f in fields}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state | {"simulator": SimulatorConfig(**state["simulator"])})

    @property
    def motion(self) -> Reference:
        """Motion of the vehicle that the controller follows."""
        return make_reference(self.reference)

    @property
    def carried_mass(self) -> float:
        """Mass of quadrotor and payload [kg]."""
        payload = self.reality.hung
        mass = mass_properties(self.vehicle, self.reality.mass_effects()).mass
        return mass + (payload.mass + payload.rope_mass if payload.tether != "none" else 0.0)

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
        cable pulls across the hook's lever, by turning:
        1 / reduced = 1 / m_P + 1 / m + |p_BoTo_B|² / J.
        """
        payload = self.reality.hung.check()
        rates = [1e-3]
        if payload.tether == "cable":
            turning = np.sum(np.square(payload.hook)) / np.linalg.eigvalsh(self.vehicle.J)[0]
            mass, stiffness, damping = payload.fastest
            reduced = 1 / (1 / mass + 1 / self.vehicle.mass + turning)
            rates += [np.sqrt(stiffness / reduced), damping / reduced]
        rates += [
            1 / lag for lag in (*self.reality.lags, self.vehicle.rotor_time_constant) if lag > 0
        ]
        return float(1.7 / max(rates))

    def true_model(self) -> TrueModel:
        """Return the model of the real vehicle for the oracle, which knows the events too."""
        reality = self.reality
        payload = self.reality.hung
        x, y, z = payload.hook
        bob = Payload(payload.mass, payload.length, (x, y, z), payload.air_damping)
        hung = None if payload.tether == "none" else bob
        places = reality.with_calibration(self.vehicle)
        actuators = places.actuator
        if self.vehicle.rotor_time_constant and not any(isinstance(e, MotorLag) for e in actuators):
            actuators.insert(0, MotorLag(self.vehicle.rotor_time_constant))
        return TrueModel(
            self.controller.believed(self.vehicle),
            hung,
            places.wrench,
            [e for e in actuators if e.dead_time == 0.0],
            sum(e.dead_time for e in actuators),
            reality.onsets,
            places.mass,
            reality.hangs_at,
            self._payloads(hung),
        )

    def _payloads(self, first: Payload | None) -> list[tuple[float, Payload | None]]:
        """Return (time [s], payload from then on) of every event."""
        changes = []
        payload = first
        for event in sorted(self.events, key=lambda event: event.time):
            if payload is not None and event.kind == "attach":
                payload = dc.replace(payload, mass=payload.mass + event.mass)
            elif event.kind == "release":
                payload = None
            changes.append((event.time, payload))
        return changes

    def check_and_step(self) -> "FlightConfig":
        """Return a checked copy whose fixed step of the simulator is within `largest_step`; one
        that makes the flight slow is said.
        """
        simulator = copy.copy(self.simulator)
        largest = 0.95 * self.largest_step
        if largest < SLOW * simulator.max_step_size:
            logger.warning(
                "%s: simulator.max_step_size becomes %.2g s for this cable and these motors, in "
                "place of %g s; that is slow. A softer cable or fewer segments take longer steps.",
                self.name,
                largest,
                simulator.max_step_size,
            )
        simulator.max_step_size = min(simulator.max_step_size, largest)
        return dc.replace(self, simulator=simulator).check()

    @property
    def end(self) -> float:
        """End of the flight [s]."""
        return self.reference.lead + self.duration


def flown_by(config: FlightConfig, factory: Factory | None) -> FlightConfig:
    """Return the scenario with the kind of the controller that `factory` makes; as it is where that
    is None.

    Args:
        config: of the experiment.
        factory: of a controller of one's own.
    """
    return filled(config, {"controller": {"kind": kind_of(factory)}}) if factory else config


def default_flight(vehicle: Vehicle) -> FlightConfig:
    """Return the default scenario of `vehicle`: that of the paper's, scaled by size, mass and
    time.
    """
    return scaled(FlightConfig(vehicle=vehicle))


def load_flight(
    filename: str, vehicle: Vehicle | None = None, *, checked: bool = True
) -> FlightConfig:
    """Read a scenario file (YAML).

    Defaults scale with the vehicle, and what the file names stands in SI, unless it says `scaled:
    true`. The CSV file of a track lies relative to the scenario file; where the latter names no
    duration, the flight has the track's own.

    Args:
        filename: of the scenario.
        vehicle: flies in place of the file's.
        checked: False: fields of the file may still change, and `check` comes after.
    Raises: ValueError: one line with file and field, on bad content.
    """
    with one_line(filename, "scenario file"):
        flight = _read(read_yaml(filename), vehicle, Path(filename).parent)
        flight = flight.with_autopilot(flight.autopilot.kind) if flight.autopilot.flies else flight
        if is_own(flight.controller.kind):
            flight.controller.kind = with_file(flight.controller.kind, Path(filename).parent)
        return flight.check() if checked else flight


def _read(content: Any, vehicle: Vehicle | None, folder: Path) -> FlightConfig:
    """Return what a scenario file in `folder` names, over the defaults of its vehicle."""
    named = filled(FlightConfig(), content)
    flies = vehicle or named.vehicle.check()
    require(
        not named.scaled or not named.reality.effects,
        "reality.effects stand in SI and do not scale; leave `scaled` out.",
    )
    if named.scaled:
        return scaled(dc.replace(named, vehicle=flies))
    default = default_flight(flies)
    flight = filled(dc.replace(default, duration=np.nan), content)
    flight.vehicle = flies
    if "height" not in (content.get("reference") or {}):
        flight.reference.height = default.in_reality(flight.reality.check()).reference.height
    if flight.reference.is_file:
        flight.reference.track = str(folder / flight.reference.track)
        flight.reference.check()
    if np.isnan(flight.duration):
        natural = flight.reference.own_duration
        flight.duration = default.duration if natural is None else natural
    return flight
