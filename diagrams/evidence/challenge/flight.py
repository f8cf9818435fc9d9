"""One planned flight of a vehicle with effects, as an exact log: in Drake, or in rotorpy."""

import dataclasses as dc
from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from diagrams.batch.run import FailedRun, require
from diagrams.evidence.challenge.plans import Plan
from np_drake import attitude
from np_drake.control.cascade import CascadeGains, cascade
from np_drake.effects.base import Effect, Measurement, SensorEffect
from np_drake.effects.combine import EffectsByPlace, split_effects
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
        self._plant = self._real.GetSubsystemByName("plant")
        self._simulator = Simulator(self._real)
        config = SimulatorConfig(
            integration_scheme="runge_kutta3",
            max_step_size=_largest_step(vehicle, places),
            use_error_control=False,
        )
        ApplySimulatorConfig(config, self._simulator)
        self._root = self._simulator.get_mutable_context()
        self.command(vehicle.hover_input)
        self._own = self._plant.GetMyMutableContextFromRoot(self._root)
        instance = self._plant.GetBodyByName("quadrotor").model_instance()
        acceleration = self._plant.get_generalized_acceleration_output_port(instance)
        self._ports = (self._plant.get_state_output_port(), acceleration)

    def start(self, t: float, x: np.ndarray, before: "DrakeWorld | None" = None) -> None:
        """Put the vehicle into a state (13,) at t [s]; a payload hangs still under the moving hook.

        Rotors and acting command carry on from the world before.
        """
        self._root.SetTime(t)
        q = x[3:7]
        v = x[7:10]
        w_W = attitude.rotate(x[3:7], x[10:13])
        R_WB = RotationMatrix(Quaternion(q / np.linalg.norm(q)))
        placed = {"quadrotor": (RigidTransform(R_WB, x[0:3]), SpatialVelocity(w_W, v))}
        if self._payload.tether == "cable":
            hook_W = attitude.rotate(q, np.array(self._payload.hook))
            stretch = self._payload.mass * self._vehicle.gravity / self._payload.stiffness
            p_WP = x[0:3] + hook_W - [0.0, 0.0, self._payload.length + stretch]
            v_WP = v + np.cross(w_W, hook_W)
            placed["payload"] = RigidTransform(p_WP), SpatialVelocity(np.zeros(3), v_WP)
        for name, (X_WB, V_WB) in placed.items():
            body = self._plant.GetBodyByName(name)
            self._plant.SetFreeBodyPose(self._own, body, X_WB)
            self._plant.SetFreeBodySpatialVelocity(context=self._own, body=body, V_JpJc=V_WB)
        if before is not None:
            self.command(before._acting)
            if self._real.HasSubsystemNamed("actuators"):
                actuators = self._real.GetSubsystemByName("actuators")
                own = actuators.GetMyMutableContextFromRoot(self._root)
                actuators.rest_at(own, before._eval("nominal_rotor_thrust"))

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
        state, rates = (port.Eval(self._own)[None] for port in self._ports)
        velocities = state[:, self._plant.num_positions() :]
        q = state[:, 0:4] / np.linalg.norm(state[:, 0:4], axis=1, keepdims=True)
        w, al = (attitude.rotate_back(q, turn[:, 0:3]) for turn in (velocities, rates))
        parts = [state[:, 4:7], q, velocities[:, 3:6], w, rates[:, 3:6], al]
        return np.concatenate(parts, axis=1)[0]

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
    stiffness = reduced * CABLE_RATE**2
    damping = 2 * CABLE_DAMPING * reduced * CABLE_RATE
    return dc.replace(payload, stiffness=stiffness, damping=damping)


def fly(
    vehicle: Vehicle,
    plan: Plan,
    effects: Sequence[Effect] = (),
    *,
    t: np.ndarray,
    onset: float | None = None,
    background: Sequence[Effect] = (),
    warm_up: float = WARM_UP,
    noise: np.ndarray | None = None,
    simulator: str = "drake",
) -> FlightLog:
    """Return the exact log of Bo: no noise; systematic sensor effects and the right-sided
    accelerations are in it.

    Args:
        t: (n,) instants of the rows [s]; the command is updated there too.
        onset: the effects act from the first row at or after it on [s], errors of sensors
            throughout; None: from the start.
        background: effects that act throughout and are no cause (a vehicle file that is a percent
            off).
        warm_up: hovering before the first row [s].
        noise: (13,) standard deviations of white noise in the state that the controller sees; None:
            it sees the state.
    Raises: FailedRun: if the vehicle is lost; ValueError: on what is no effect, or two payloads.
    """
    sensors = [effect for effect in effects if isinstance(effect, SensorEffect)]
    # rotorpy reads at the instants of the other clock; Drake's rows are interpolated there.
    offset = sum(sensor.clock_shift for sensor in sensors)
    interpolates = simulator == "drake"
    step = float(np.median(np.diff(t)))
    margin = MARGIN if interpolates else max(offset, 0.0)
    before = t[0] - step * np.arange(round(warm_up / step), 0, -1)
    after = t[-1] + step * np.arange(1, 2 + int(np.ceil(margin / step)))
    rows = np.concatenate([before, t, after])
    split = 0 if onset is None else int(np.searchsorted(rows, onset - 1e-9))
    make: type = DrakeWorld
    if simulator == "rotorpy":
        from diagrams.evidence.challenge.rotorpy_vehicle import RotorPyWorld

        make = RotorPyWorld
    worlds: dict[int, Any] = {split: make(vehicle, [*background, *effects])}
    if split:
        worlds[0] = make(vehicle, background)
    commands, states = _fly_rows(
        vehicle, worlds, plan, rows, rows[:-1] if interpolates else t + offset, noise
    )
    read_at = rows[:-1]
    if not interpolates:
        first = int(np.searchsorted(rows, t[0] - 1e-9))
        read_at = t
        commands = commands[first : first + len(t)]
    reading = Measurement(states[:, :13], states[:, 13:16], states[:, 16:], commands[:, 4:])
    # Every error acts on the true attitude, so that of the attitude comes last.
    for sensor in sorted(sensors, key=lambda sensor: "qw" in sensor.corrupts):
        reading = sensor.measure(vehicle, reading, np.zeros((len(read_at), sensor.white_size)))
    p, q, v, w = np.split(reading.x, [3, 7, 10], axis=1)
    log = FlightLog(read_at, p, q, v, w, commands[:, :4], reading.a, reading.al, reading.rotor)
    if interpolates and offset:
        log = shift_state(log, offset)
    first = int(np.searchsorted(log.t, t[0] - 1e-9))
    return log.rows(first, first + len(t))


class _Flight:
    """A flight under way, whose commands are kept back by the effects' dead time: exact for rows at
    any instants.
    """

    def __init__(self, world: Any, t: float, x: np.ndarray):
        # t: now [s]
        self.world = world
        self.t = t
        self._under_way: list[tuple[float, np.ndarray]] = []  # commands, and when they arrive [s]
        world.start(t, x)

    def change(self, world: Any) -> None:
        world.start(self.t, self.world.state(), self.world)
        self.world = world

    def give(self, u: np.ndarray) -> None:
        self._under_way.append((self.t + self.world.dead_time, u))
        self.advance(self.t)

    def advance(self, t: float) -> None:
        while self._under_way and self._under_way[0][0] <= t + 1e-9:
            arrival, u = self._under_way.pop(0)
            self._integrate(arrival if arrival < t - 1e-9 else t)
            self.world.command(u)
        self._integrate(t)

    def _integrate(self, t: float) -> None:
        if t > self.t + 1e-12:
            self.world.integrate(t)
            self.t = t


def _fly_rows(
    vehicle: Vehicle,
    worlds: dict[int, Any],
    plan: Plan,
    rows: np.ndarray,
    reads: np.ndarray,
    noise: np.ndarray | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return (m - 1, 8) command and rotor speed at all rows but the last, (n, 19) states at
    `reads`; `worlds` are by the row from which they fly.
    """
    gains = CascadeGains()
    integral = np.zeros(6)
    flight = _Flight(worlds[0], rows[0], plan.start(vehicle.gravity))
    errors = np.zeros((len(rows) - 1, 13))
    if noise is not None:
        errors = np.random.default_rng(0).normal(size=errors.shape) * noise
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
