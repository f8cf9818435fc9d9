"""One vehicle of rotorpy's under the cascaded controller, advanced from instant to instant."""

import math

import numpy as np

from diagrams.challenge.simulators.rotorpy.conversion import (
    acceleration_from_rotorpy,
    from_rotorpy,
    rotor_speeds,
    to_rotorpy,
)
from diagrams.challenge.simulators.rotorpy.vehicle import SPEED, Q, RealMultirotor
from np_drake.control.cascade import CascadeGains, cascade
from np_drake.vehicle import Vehicle

# Of the integrator, at most [s]: one between rows 10 ms apart, jitter included, two with a tether.
STEP, TETHER_STEP = 0.0112, 0.0056
LAG_SHARE = 0.5  # of a motor's time constant that a step may last [1]


class Flight:
    """A flight under way. `speed` (4,) of the rotors now [rad/s]; `t` now [s]."""

    def __init__(self, vehicle: Vehicle, real: RealMultirotor, t: float, x: np.ndarray):
        self._vehicle, self._gains, self.t = vehicle, CascadeGains(), t
        self._integral, self._updated = np.zeros(6), t
        self._under_way: list[
            tuple[float, np.ndarray]
        ] = []  # commanded rotor speeds, and when they arrive [s]
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
        """Return the controller's command (4,) from now on [N, N·m]; it arrives after the dead time."""
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
        """Return (19,) state of Bo, its acceleration in W and dw/dt in B, as the acting command makes them."""
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
