"""One planned flight of a vehicle with effects, as an exact log: in Drake, or in rotorpy."""

import dataclasses as dc
from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RotationMatrix
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from diagrams.batch.run import FailedRun, require
from diagrams.evidence.challenge.plans import Plan
from np_drake import attitude
from np_drake.control.cascade import CascadeGains, cascade
from np_drake.effects.base import Effect, Measurement, SensorEffect
from np_drake.effects.combine import EffectsByPlace, split_effects
from np_drake.effects.pendulum import hanging_still
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.flight_log import FlightLog
from np_drake.logs.clock import shift_state
from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadConfig, payload_config
from systems.tethered_quadrotor import make_tethered_quadrotor

SIMULATORS = ("drake", "rotorpy")
WARM_UP = 4.0  # hovering before the first row, in which integrators settle [s]
MARGIN = 0.3  # flown in Drake after the last row, for clocks that are off [s]
# A vehicle counts as lost farther from the plan [m], lower [m], or with a smaller cosine of its
# tilt [1].
FARTHEST = 6.0
LOWEST = 0.03
LEAST_UPRIGHT = -0.2
# of the cable: frequency [rad/s] and damping ratio [1]
CABLE_RATE = 250.0
CABLE_DAMPING = 0.3
# Steps of Drake's integrator [s]: one between rows 10 ms apart, jitter included, three with a
# cable; share of a lag.
STEP = 0.0112
CABLE_STEP = 0.0037
LAG_SHARE = 0.2


class DrakeWorld:
    """The plant of this project with one set of effects."""

    def __init__(self, vehicle: Vehicle, effects: Sequence[Effect]):
        """Build the plant."""
        places = split_effects(effects)
        self.dead_time = sum(effect.dead_time for effect in places.actuator)  # of commands [s]
        self._vehicle = vehicle
        self._payload = stiff_cable(places.payload, vehicle)
        self._real = make_tethered_quadrotor(
            vehicle,
            self._payload,
            wrench_effects=places.wrench,
            # As they act: first what changes how rotors turn, then what turning rotors give.
            actuator_effects=sorted(
                (e for e in places.actuator if e.dead_time == 0.0),
                key=lambda effect: not effect.turns_rotor,
            ),
            mass_effects=places.mass,
        )
        self._simulator = Simulator(self._real)
        config = SimulatorConfig(
            integration_scheme="runge_kutta3",
            max_step_size=_largest_step(vehicle, places),
            use_error_control=False,
        )
        ApplySimulatorConfig(config, self._simulator)
        self._root = self._simulator.get_mutable_context()
        self._plant = self._real.GetSubsystemByName("plant")
        self._context = self._plant.GetMyMutableContextFromRoot(self._root)
        self.command(vehicle.hover_input)

    def start(self, t: float, x: np.ndarray, before: "DrakeWorld | None" = None) -> None:
        """Put the vehicle into a state (13,) at t [s]; a payload hangs still under the moving hook.

        Rotors and acting command carry on from the world before.
        """
        self._root.SetTime(t)
        p_WB, q, v = np.split(x[:10], [3, 7])
        R_WB = RotationMatrix(Quaternion(q / np.linalg.norm(q)))
        pose = [*R_WB.ToQuaternion().wxyz(), *p_WB]
        velocity = [*attitude.rotate(q, x[10:13]), *v]
        payload = self._payload
        if payload.tether == "cable":
            stretch = payload.mass * self._vehicle.gravity / payload.stiffness
            below = hanging_still(payload.hook, x, payload.length + stretch)
            pose += [1.0, 0.0, 0.0, 0.0, *below[:3]]
            velocity += [0.0, 0.0, 0.0, *below[3:]]
        self._plant.SetPositionsAndVelocities(self._context, [*pose, *velocity])
        if before is not None:
            self.command(before._acting)
            if self._real.HasSubsystemNamed("actuators"):
                actuators = self._real.GetSubsystemByName("actuators")
                context = actuators.GetMyMutableContextFromRoot(self._root)
                actuators.rest_at(context, before._eval("nominal_rotor_thrust"))

    def _eval(self, port: str) -> np.ndarray:
        return self._real.GetOutputPort(port).Eval(self._root)

    def state(self) -> np.ndarray:
        """Return the state (13,) of Bo."""
        return self._eval("x").copy()

    def speed(self) -> np.ndarray:
        """Return the rotor speeds (4,) [rad/s]."""
        thrust = np.maximum(self._eval("nominal_rotor_thrust"), 0.0)
        return np.sqrt(thrust / self._vehicle.thrust_coefficient)

    def reading(self) -> np.ndarray:
        """Return (19,) state of Bo, its acceleration in W and dw/dt in B."""
        state = self._eval("plant_state")
        velocity = state[self._plant.num_positions() :]
        rate = self._plant.get_generalized_acceleration_output_port().Eval(self._context)
        q = state[:4] / np.linalg.norm(state[:4])
        w, al = (attitude.rotate_back(q, turn[:3]) for turn in (velocity, rate))
        return np.concatenate([state[4:7], q, velocity[3:6], w, rate[3:6], al])

    def command(self, u: np.ndarray) -> None:
        """Let a command (4,) act from now on [N, N·m]."""
        self._acting = u
        self._real.GetInputPort("u").FixValue(self._root, u)

    def integrate(self, t: float) -> None:
        """Fly on to t [s]. Raises FailedRun: if the integrator gives up."""
        try:
            self._simulator.AdvanceTo(t)
        except RuntimeError as error:
            raise FailedRun(f"challenge: the simulation ended before {t:.2f} s: {error}") from error


def _largest_step(vehicle: Vehicle, places: EffectsByPlace) -> float:
    """Return a step at which runge_kutta3 is stable and follows the lags to a few parts in a
    thousand [s].
    """
    sizes = [item for effect in places.actuator for item in effect.values.items()]
    lags = [lag for name, lag in sizes if name in ("time_constant", "time")]
    lags += [vehicle.rotor_time_constant] if vehicle.rotor_time_constant > 0 else []
    return min([STEP if places.payload is None else CABLE_STEP, *(LAG_SHARE * lag for lag in lags)])


def stiff_cable(effect: SuspendedPayload | None, vehicle: Vehicle) -> PayloadConfig:
    """Return the payload, if any, on a cable as stiff as the integrator's step allows."""
    payload = payload_config(effect)
    if payload.tether == "none":
        return payload
    reduced = payload.mass * vehicle.mass / (payload.mass + vehicle.mass)
    damping = 2 * CABLE_DAMPING * reduced * CABLE_RATE
    return dc.replace(payload, stiffness=reduced * CABLE_RATE**2, damping=damping)


@dc.dataclass(frozen=True)
class Simulation:
    """How a plan is flown.

    warm_up: hovering before the first row [s].
    noise: (13,) standard deviations of white noise in the state that the controller sees.
    """

    simulator: str = "drake"
    warm_up: float = WARM_UP
    noise: np.ndarray | float = 0.0

    def world(self, vehicle: Vehicle, effects: Sequence[Effect]) -> Any:
        """Return the plant: `DrakeWorld`, or one with its methods."""
        if self.simulator == "drake":
            return DrakeWorld(vehicle, effects)
        from diagrams.evidence.challenge.rotorpy_vehicle import RotorPyWorld

        return RotorPyWorld(vehicle, effects)


def fly(
    vehicle: Vehicle,
    plan: Plan,
    effects: Sequence[Effect] = (),
    *,
    t: np.ndarray,
    onset: float | None = None,
    background: Sequence[Effect] = (),
    simulation: Simulation = Simulation(),
) -> FlightLog:
    """Return the exact log of Bo: no noise; systematic sensor effects and the right-sided
    accelerations are in it.

    Args:
        t: (n,) instants of the rows [s]; the command is updated there too.
        onset: the effects act from the first row at or after it on [s], errors of sensors
            throughout; None: from the start.
        background: effects that act throughout and are no cause (a vehicle file that is a percent
            off).
    Raises: FailedRun: if the vehicle is lost; ValueError: on what is no effect, or two payloads.
    """
    sensors = [effect for effect in effects if isinstance(effect, SensorEffect)]
    offset = sum(sensor.clock_shift for sensor in sensors)
    # rotorpy reads at the instants of the other clock; Drake's rows are interpolated there.
    interpolates = simulation.simulator == "drake"
    step = float(np.median(np.diff(t)))
    margin = MARGIN if interpolates else max(offset, 0.0)
    before = t[0] - step * np.arange(round(simulation.warm_up / step), 0, -1)
    after = t[-1] + step * np.arange(1, 2 + int(np.ceil(margin / step)))
    rows = np.concatenate([before, t, after])
    split = 0 if onset is None else int(np.searchsorted(rows, onset - 1e-9))
    worlds = {split: simulation.world(vehicle, [*background, *effects])}
    if split:
        worlds[0] = simulation.world(vehicle, background)
    reads = rows[:-1] if interpolates else rows[len(before) : -1] + offset
    commands, states = _fly_rows(vehicle, worlds, plan, rows, reads, simulation.noise)
    first = 0 if interpolates else len(before)
    read = slice(first, first + len(states))
    reading = Measurement(states[:, :13], states[:, 13:16], states[:, 16:], commands[read, 4:])
    # Every error acts on the true attitude, so that of the attitude comes last.
    for sensor in sorted(sensors, key=lambda sensor: "qw" in sensor.corrupts):
        reading = sensor.measure(vehicle, reading, np.zeros((len(states), sensor.white_size)))
    p, q, v, w = np.split(reading.x, [3, 7, 10], axis=1)
    log = FlightLog(
        rows[read], p, q, v, w, commands[read, :4], reading.a, reading.al, reading.rotor
    )
    if interpolates and offset:
        log = shift_state(log, offset)
    first = int(np.searchsorted(log.t, t[0] - 1e-9))
    return log.rows(first, first + len(t))


class _Flight:
    """A flight under way, whose commands are kept back by the effects' dead time: exact for rows at
    any instants.
    """

    def __init__(self, world: Any, t: float, x: np.ndarray):
        self.world = world
        self._now = t  # [s]
        self._under_way: list[tuple[float, np.ndarray]] = []  # commands, and when they arrive [s]
        world.start(t, x)

    def change(self, world: Any) -> None:
        world.start(self._now, self.world.state(), self.world)
        self.world = world

    def give(self, u: np.ndarray) -> None:
        self._under_way.append((self._now + self.world.dead_time, u))
        self.advance(self._now)

    def advance(self, t: float) -> None:
        while self._under_way and self._under_way[0][0] <= t + 1e-9:
            arrival, u = self._under_way.pop(0)
            self._integrate(arrival if arrival < t - 1e-9 else t)
            self.world.command(u)
        self._integrate(t)

    def _integrate(self, t: float) -> None:
        if t > self._now + 1e-12:
            self.world.integrate(t)
            self._now = t


def _fly_rows(
    vehicle: Vehicle,
    worlds: dict[int, Any],
    plan: Plan,
    rows: np.ndarray,
    reads: np.ndarray,
    noise: np.ndarray | float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return (m - 1, 8) command and rotor speed at all rows but the last, (n, 19) states at those
    of `reads` that the flight reaches; `worlds` are by the row from which they fly.
    """
    gains = CascadeGains()
    integral = np.zeros(6)
    flight = _Flight(worlds[0], rows[0], plan.start(vehicle.gravity))
    errors = np.random.default_rng(0).normal(size=(len(rows) - 1, 13)) * noise
    steps = np.diff(rows, prepend=rows[0])
    commands: list[np.ndarray] = []
    readings: list[np.ndarray] = []
    for k, target in enumerate(plan.targets(vehicle.gravity, rows[:-1])):
        if k and k in worlds:
            flight.change(worlds[k])
        x = flight.world.state()
        u, integral = cascade(
            vehicle, gains, x=x + errors[k], target=target, integral=integral, step=steps[k]
        )
        flight.give(u)
        commands.append(np.concatenate([u, flight.world.speed()]))
        if not k % 10:
            upright = 1 - 2 * (x[4] ** 2 + x[5] ** 2)
            off = np.linalg.norm(x[:3] - target[:3])
            require(
                off < FARTHEST and x[2] > LOWEST and upright > LEAST_UPRIGHT,
                f"challenge: the vehicle was lost at {rows[k]:.2f} s.",
                FailedRun,
            )
        while len(readings) < len(reads) and reads[len(readings)] < rows[k + 1] - 1e-9:
            flight.advance(reads[len(readings)])
            readings.append(flight.world.reading())
        flight.advance(rows[k + 1])
    return np.array(commands), np.array(readings)
