"""The simulator `rotorpy`: an exact log of one planned flight with effects, in another library's
vehicle.

Rigid body, rotors, motors and steady wind are rotorpy's, the tether and the gusts are written here;
every other effect
acts by its own function, as in Drake.
Source: Folk, Paulos and Kumar 2023 (RotorPy), as a library.
"""

import math
from collections.abc import Sequence

import numpy as np

from diagrams.challenge.simulators.flight_plan import Plan, require_flying
from diagrams.challenge.simulators.rotorpy.conversion import (
    SPEED,
    Q,
    acceleration_from_rotorpy,
    from_rotorpy,
    rotor_speeds,
    to_rotorpy,
)
from diagrams.challenge.simulators.rotorpy.vehicle import RealMultirotor
from np_drake.control.cascade import CascadeGains, cascade
from np_drake.effects.base import Effect, Measurement, SensorEffect
from np_drake.flight_log import FlightLog
from np_drake.vehicle import Vehicle

WARM_UP = 4.0  # hovering before the first row, in which integrators settle [s]
# Of the integrator, at most [s]: one between rows 10 ms apart, jitter included, two with a tether.
STEP, TETHER_STEP = 0.0112, 0.0056
LAG_SHARE = 0.5  # of a motor's time constant that a step may last [1]


class _Flight:
    """A flight under way. `speed` (4,) of the rotors now [rad/s]; `t` now [s]."""

    def __init__(self, vehicle: Vehicle, real: RealMultirotor, t: float, x: np.ndarray):
        self._vehicle, self._gains, self.t = vehicle, CascadeGains(), t
        self._integral, self._updated = np.zeros(6), t
        # Commanded rotor speeds, and when they arrive [s].
        self._under_way: list[tuple[float, np.ndarray]] = []
        self._command = rotor_speeds(vehicle, vehicle.hover_input)
        self._board(real, x, self._command)

    def _board(self, real: RealMultirotor, x: np.ndarray, speed: np.ndarray) -> None:
        self.real, self._rate = real, np.zeros(0)
        s = to_rotorpy(x, real.center, speed)
        self._s = np.concatenate([s, real.hidden_at_rest(self.t, s)])
        self._step = min(TETHER_STEP if real.swings else STEP, LAG_SHARE * real.tau_m)

    def change(self, real: RealMultirotor) -> None:
        """The vehicle is another one from now on: Bo, rotors and commands under way carry on."""
        self._board(real, self.state(), self.speed)

    @property
    def speed(self) -> np.ndarray:
        """Return the rotor speeds (4,) [rad/s]."""
        return self._s[SPEED].copy()

    def state(self) -> np.ndarray:
        """Return the state (13,) of Bo."""
        return from_rotorpy(self._s, self.real.center)

    def control(self, target: np.ndarray) -> np.ndarray:
        """Return the controller's command (4,) from now on [N, N·m]; it arrives after the dead
        time.
        """
        u, self._integral = cascade(
            self._vehicle,
            self._gains,
            x=self.state(),
            target=target,
            integral=self._integral,
            step=self.t - self._updated,
        )
        self._updated = self.t
        self._under_way.append((self.t + self.real.dead_time, rotor_speeds(self._vehicle, u)))
        self._deliver()
        return u

    def reading(self) -> np.ndarray:
        """Return (19,) state of Bo, its acceleration in W and dw/dt in B, as the acting command
        makes them.
        """
        acceleration = acceleration_from_rotorpy(self._s, self._rate_now(), self.real.center)
        return np.concatenate([self.state(), acceleration])

    def advance(self, t: float) -> None:
        """Flies on to `t` [s]; a command that arrives there acts."""
        while self._under_way and self._under_way[0][0] < t - 1e-9:
            self._integrate(self._under_way[0][0])
            self._deliver()
        self._integrate(t)
        self._deliver()

    def _deliver(self) -> None:
        while self._under_way and self._under_way[0][0] <= self.t + 1e-9:
            self._command, self._rate = self._under_way.pop(0)[1], np.zeros(0)
            if not self.real.lags:
                self._s[SPEED] = self._command

    def _rate_now(self) -> np.ndarray:
        if not self._rate.size:  # not known yet
            self._rate = self.real.rate(self.t, self._s, self._command)
        return self._rate

    def _integrate(self, t: float) -> None:
        """Classical Runge-Kutta of fourth order in equal steps."""
        if t <= self.t + 1e-12:
            return
        rate, command = self.real.rate, self._command
        steps = math.ceil((t - self.t) / self._step - 1e-6)
        h = (t - self.t) / steps
        for _ in range(steps):
            s, k1, middle = self._s, self._rate_now(), self.t + 0.5 * h
            k2 = rate(middle, s + 0.5 * h * k1, command)
            k3 = rate(middle, s + 0.5 * h * k2, command)
            k4 = rate(self.t + h, s + h * k3, command)
            self._s = s + h / 6 * (k1 + 2 * (k2 + k3) + k4)
            self._s[Q] /= math.sqrt(float(self._s[Q] @ self._s[Q]))
            self.t, self._rate = self.t + h, np.zeros(0)
        self.t = t


def fly(
    vehicle: Vehicle,
    plan: Plan,
    effects: Sequence[Effect] = (),
    *,
    t: np.ndarray,
    onset: float | None = None,
    background: Sequence[Effect] = (),
    warm_up: float = WARM_UP,
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

    Raises: FailedRun: if the vehicle is lost; ValueError: on what is no effect, or two payloads.
    """
    sensors = [effect for effect in effects if isinstance(effect, SensorEffect)]
    offset = sum(sensor.clock_shift for sensor in sensors)
    rows = _instants(t, max(offset, 0.0), warm_up)
    split = 0 if onset is None else int(np.searchsorted(rows, onset - 1e-9))
    real = RealMultirotor(vehicle, [*background, *effects])
    first = RealMultirotor(vehicle, background) if split else real
    x = np.concatenate([plan.start(vehicle.gravity), np.zeros(6)])
    flight = _Flight(vehicle, first, rows[0], x)
    targets = plan.targets(vehicle.gravity, rows)
    commands, states = _fly_rows(flight, targets, rows, t + offset, split, real if split else None)
    start = int(np.searchsorted(rows, t[0] - 1e-9))
    u, speed = commands[start : start + len(t), :4], commands[start : start + len(t), 4:]
    return _sensed(
        vehicle, sensors, t, u, Measurement(states[:, :13], states[:, 13:16], states[:, 16:], speed)
    )


def _sensed(
    vehicle: Vehicle,
    sensors: Sequence[SensorEffect],
    t: np.ndarray,
    u: np.ndarray,
    truth: Measurement,
) -> FlightLog:
    """Return the log as sensors read it; every error acts on the true attitude, so that of the
    attitude comes last.
    """
    reading = truth
    for sensor in sorted(sensors, key=lambda sensor: "qw" in sensor.corrupts):
        reading = sensor.measure(vehicle, reading, np.zeros((len(t), 0)))
    p, q, v, w = np.split(reading.x, [3, 7, 10], axis=1)
    return FlightLog(t, p, q, v, w, u, reading.a, reading.al, reading.rotor)


def _instants(t: np.ndarray, margin: float, warm_up: float) -> np.ndarray:
    """Return the rows (m,) [s]: those before the log, its own, and those after until its last state
    has been read.
    """
    step = float(np.median(np.diff(t)))
    before = t[0] - step * np.arange(round(warm_up / step), 0, -1)
    return np.concatenate([before, t, t[-1] + step * np.arange(1, 2 + int(np.ceil(margin / step)))])


def _fly_rows(
    flight: _Flight,
    targets: np.ndarray,
    rows: np.ndarray,
    reads: np.ndarray,
    split: int,
    later: RealMultirotor | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return (m - 1, 8) command and rotor speed at all rows but the last, (n, 19) states at
    `reads`.
    """
    commands: list[np.ndarray] = []
    states: list[np.ndarray] = []
    for k, target in enumerate(targets[:-1]):
        if later is not None and k == split:
            flight.change(later)
        u = flight.control(target)
        commands.append(np.concatenate([u, flight.speed]))
        if not k % 10:
            require_flying(flight.state(), target, flight.t)
        while len(states) < len(reads) and reads[len(states)] < rows[k + 1] - 1e-9:
            flight.advance(reads[len(states)])
            states.append(flight.reading())
        flight.advance(rows[k + 1])
    return np.array(commands), np.array(states)
