"""Open-loop flight of the Drake vehicle from a given state along given commands, built once and
started often.
"""

import dataclasses as dc
import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from np_drake import attitude
from np_drake.effects.base import Effect, WrenchEffect
from np_drake.effects.combine import split_effects
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.motor_lag import at_once
from np_drake.effects.pendulum import tether_force
from np_drake.rigid_body import P, Q, V, W
from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadConfig, as_light, payload_config
from systems.tethered_quadrotor import make_tethered_quadrotor

LARGEST_STEP = 0.01  # of the integrator [s]: 1e-6 m after 1 s at 1.6 rad/s, 2 mm at 10 rad/s
_LAGS = 6  # time constants after which a motor's initial speed no longer matters; own choice [1]


@dc.dataclass(frozen=True)
class Commands:
    """Commands u (n, 4) [N, N·m], row k acting from t_k (n,) [s] until t_(k+1)."""

    t: np.ndarray
    u: np.ndarray

    def at(self, time: float) -> np.ndarray:
        """Return the command (4,) that acts just after `time` [s]; the first row before the
        first.
        """
        return self.u[max(int(np.searchsorted(self.t, time + 1e-9, side="right")) - 1, 0)]

    def changes(self, start: float, stop: float) -> np.ndarray:
        """Return the times strictly between start and stop at which another row begins to act [s].

        Args:
            start: [s].
            stop: [s].
        """
        first, last = np.searchsorted(self.t, [start + 1e-9, stop - 1e-9])
        return self.t[first:last]

    def later(self, dead_time: float) -> "Commands":
        """Return the commands, arriving `dead_time` [s] later."""
        return Commands(self.t + dead_time, self.u) if dead_time else self


class Swing(NamedTuple):
    """State of the payload at the hook, in W.

    r: (3,) payload from hook [m].
    r_rate: its rate (3,) [m/s].
    a_hook: (3,) acceleration of the hook [m/s²].
    """

    r: np.ndarray
    r_rate: np.ndarray
    a_hook: np.ndarray


class Rollout:
    """One vehicle with one set of effects, each by its wrapper, and the payload as a body.

    Sensors are not part of it.
    """

    def __init__(self, vehicle: Vehicle, effects: Sequence[Effect]):
        self._vehicle = vehicle
        parts = split_effects(effects)
        hung = parts.payload if parts.payload is not None and parts.payload.mass > 0 else None
        self._payload = hung.payload if hung else None
        config = as_light(payload_config(hung))
        self._stiffness = config.stiffness
        self._dead_time = sum(e.delay for e in parts.actuator if isinstance(e, CommandDelay))  # [s]
        actuators = [
            e for e in parts.actuator if not isinstance(e, CommandDelay) and not at_once(e)
        ]
        self._diagram = make_tethered_quadrotor(
            vehicle,
            config,
            wrench_effects=[_steady(effect) for effect in parts.wrench],
            actuator_effects=actuators,
            mass_effects=parts.mass,
        )
        lags = [getattr(effect, "time_constant", 0.0) for effect in actuators if effect.state_size]
        lags += [vehicle.rotor_time_constant]
        self.lead = _LAGS * sum(lags) + sum(effect.dead_time for effect in actuators)  # [s]
        self._simulator = Simulator(self._diagram)
        ApplySimulatorConfig(_integrator(vehicle, config, lags), self._simulator)
        self._root = self._simulator.get_mutable_context()
        self._default = self._diagram.CreateDefaultContext()
        self._plant = self._diagram.GetSubsystemByName("plant")
        self._plant_context = self._plant.GetMyMutableContextFromRoot(self._root)
        self._u = self._diagram.GetInputPort("u")
        self._x = self._diagram.GetOutputPort("x")

    def fly(
        self, x: np.ndarray, commands: Commands, times: np.ndarray, swing: Swing | None = None
    ) -> np.ndarray:
        """Return state and payload (len(times) - 1, 16) at times[1:] [s] of a flight that is in `x`
        (13,) at times[0].

        The last three columns are p_WP [m], NaN without a payload. Motors and delays have run on
        the commands before times[0] for `lead` seconds. NaN once the vehicle is lost.

        Args:
            x: (13,) state at times[0].
            times: increasing [s].
            swing: state of the payload at times[0]; None without one.
        """
        commands = commands.later(self._dead_time)
        begin = max(times[0] - self.lead, min(commands.t[0], times[0]))
        self._root.SetTimeStateAndParametersFrom(self._default)
        self._root.SetTime(begin)
        states = np.full((len(times) - 1, 16), np.nan)
        try:
            self._place(x, swing)
            self._simulator.Initialize()
            self._advance(commands, begin, times[0])
            self._place(x, swing)
            for k, (start, stop) in enumerate(itertools.pairwise(times)):
                self._advance(commands, start, stop)
                states[k, :13] = self._x.Eval(self._root)
                if self._payload is not None:
                    states[k, 13:] = self._plant.GetPositions(self._plant_context)[11:14]
        except RuntimeError:
            pass  # the integrator gave up: the vehicle was lost
        return states

    def _advance(self, commands: Commands, start: float, stop: float) -> None:
        """Advance from start to stop, the command held between its rows."""
        for time, until in itertools.pairwise(
            [start, *commands.changes(start, stop).tolist(), stop]
        ):
            self._u.FixValue(self._root, commands.at(time))
            self._simulator.AdvanceTo(until)

    def _place(self, x: np.ndarray, swing: Swing | None) -> None:
        """Set the vehicle to x (13,) and the payload to its swing; motors and delays are left as
        they are.
        """
        positions, velocities = [x[Q], x[P]], [attitude.rotate(x[Q], x[W]), x[V]]
        if self._payload is not None and swing is not None:
            hook = attitude.rotate(x[Q], np.array(self._payload.hook))
            rate = np.cross(velocities[0], hook)
            pull = tether_force(self._payload, *swing, self._vehicle.gravity, x[V] + rate)
            stretch = 1.0 + np.linalg.norm(pull) / (self._stiffness * self._payload.length)
            positions += [np.array([1.0, 0.0, 0.0, 0.0]), x[P] + hook + stretch * swing.r]
            velocities += [np.zeros(3), x[V] + rate + swing.r_rate]
        self._plant.SetPositionsAndVelocities(
            self._plant_context, np.concatenate([*positions, *velocities])
        )


def _steady(effect: WrenchEffect) -> WrenchEffect:
    """Return the mean wind for a gusty wind, since the flight's gusts are unknown, and any other
    effect as it is.
    """
    return dc.replace(effect, deviation=0.0) if isinstance(effect, GustyWind) else effect


def _integrator(vehicle: Vehicle, payload: PayloadConfig, lags: Sequence[float]) -> SimulatorConfig:
    """Return fixed steps, within the stability of runge_kutta3 for cable and motors."""
    rates = [1.7 / LARGEST_STEP, *(1 / lag for lag in lags if lag > 0)]
    if payload.tether == "cable":
        reduced = payload.mass * vehicle.mass / (payload.mass + vehicle.mass)
        rates += [np.sqrt(payload.stiffness / reduced), payload.damping / reduced]
    return SimulatorConfig(
        integration_scheme="runge_kutta3",
        max_step_size=float(1.7 / max(rates)),
        use_error_control=False,
    )
