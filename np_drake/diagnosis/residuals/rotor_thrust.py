"""Rotor thrust of a log: commands passed through actuator effects, at the rows and as means between
them.
"""

import itertools
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from np_drake import attitude
from np_drake.effects.base import ActuatorEffect
from np_drake.effects.calibration import in_flight
from np_drake.effects.motor_lag import MotorLag
from np_drake.estimation.noise import white_noise
from np_drake.flight_log import FlightLog
from np_drake.logs.importing.signals import REPEATED, Signal
from np_drake.training_data.accelerations import most_likely
from np_drake.vehicle import Vehicle

THRUST_SUBSTEPS = 4  # substeps in an interval of the log; own choice
# Weights of the means over the last three steps, latest first: the value of the parabola with these
# means at the end.
FROM_MEANS = (11 / 6, -7 / 6, 1 / 3)
# Share of fast thrust to which the motion responds, above which it is no noise [1]; own choice.
ANSWERED = 0.5
LEAST_ROWS = 5  # of a piece whose noise shows: a fourth difference
SURE_DEVIATIONS = 2.0  # standard deviations of a lower bound [1]


class Rotors:
    """Rotor model of one flight; what does not depend on effects is computed once."""

    def __init__(self, log: FlightLog, vehicle: Vehicle):
        self._log = log
        self._vehicle = vehicle
        self._step = log.step / THRUST_SUBSTEPS
        self._row_t = log.t - log.t[0]
        self._t = np.arange(0.0, self._row_t[-1] + 0.5 * self._step, self._step)
        self._measured = log.input == "rotor_speed"
        # Telemetry that is slower than the rows repeats its readings.
        repeated = len(log.u) > 1 and np.mean(np.all(np.diff(log.u, axis=0) == 0, axis=1))
        self._steps = self._measured and bool(repeated > REPEATED)
        place = self._row_t / self._step
        self._row = np.clip(np.round(place).astype(int), 0, len(self._t) - 1)
        self._before = np.clip(place.astype(int), 0, len(self._t) - 1)
        self._share = (place - self._before)[:, None]

    def thrust(
        self, effects: Sequence[ActuatorEffect], *, shift: float = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return thrust (n, 4) at the rows, right-sided, and its means (n-1, 4) between rows [N].

        Commands are held between rows. The calibration of the vehicle file acts first, and its lag
        unless `effects` contain one. Measured rotor speed is interpolated, unless it steps, and
        passes propeller effects only.

        Args:
            effects: actuator effects in the order in which they act.
            shift: time by which commands are delayed against the log [s].
        """
        chain = [e for e in effects if not (self._measured and (e.turns_rotor or e.dead_time))]
        lags = [e for e in chain if isinstance(e, MotorLag)]
        if self._measured or not (lags or shift):
            thrust = self._respond(self._nominal, chain)
        else:
            thrust = self._respond(self._command_means(shift), [*self._file_effects(lags), *chain])
        lag = max(
            (e.time_constant for e in lags),
            default=0.0 if self._measured else self._vehicle.rotor_time_constant,
        )
        at_rows = thrust[self._row]
        if lag > 0:  # a kink at a row: extrapolated from before
            steps = enumerate(FROM_MEANS, start=1)
            at_rows = sum(c * thrust[np.maximum(self._row - k, 0)] for k, c in steps)
        return at_rows, self._mean(thrust)

    def _file_effects(self, others: Sequence[MotorLag]) -> list[ActuatorEffect]:
        """Return the effects of the vehicle file that thrust has yet to pass: its lag, unless there
        are others.
        """
        chain = [
            e
            for e in in_flight(self._vehicle, measured=self._measured, others=others)
            if isinstance(e, ActuatorEffect)
        ]
        lag = 0.0 if self._measured or others else self._vehicle.rotor_time_constant
        uneven = any(isinstance(e, MotorLag) for e in chain)
        return [MotorLag(lag), *chain] if lag > 0 and not uneven else chain

    def _respond(self, thrust: np.ndarray, effects: Sequence[ActuatorEffect]) -> np.ndarray:
        for effect in effects:
            thrust = effect.respond(self._vehicle, self._t, thrust)
        return thrust

    @cached_property
    def _nominal(self) -> np.ndarray:
        """(m, 4) thrust of the vehicle as its file describes it, at substeps [N]."""
        smooth = self._measured and not self._steps
        asked = (
            Signal(self._row_t, self._read[0]).linear(self._t)
            if smooth
            else self._command_means(0.0)
        )
        return self._respond(asked, self._file_effects([]))

    def _mean(self, thrust: np.ndarray) -> np.ndarray:
        """Return the mean thrust (n-1, 4) between rows [N]."""
        later = (
            np.concatenate([thrust[1:], thrust[-1:]])
            if self._measured and not self._steps
            else thrust
        )
        part = 0.5 * self._step * (thrust + later)
        total = np.zeros((len(part) + 1, 4))
        np.cumsum(part, axis=0, out=total[1:])
        at = total[self._before] + self._share * part[self._before]
        return np.diff(at, axis=0) / np.diff(self._row_t)[:, None]

    @property
    def noise(self) -> np.ndarray:
        """(4,) deviation of thrust and torques due to noise in rotor speed [N, N·m]; zero for
        commands.
        """
        return self._read[1] if self._measured and not self._steps else np.zeros(4)

    @cached_property
    def _read(self) -> tuple[np.ndarray, np.ndarray]:
        """Rotor thrust (n, 4) at the rows [N] and the deviation (4,) of noise in thrust and
        torques [N, N·m].

        Thrust and torques are filtered, as each has a spectrum of its own. Where the measured
        motion responds to the apparent noise, the readings are unfiltered, with zero noise.
        """
        log = self._log
        vehicle = self._vehicle
        noise = white_noise(_measured_pieces(log))
        likely = most_likely(log.u, noise, log.step)
        # A lower bound on the share of fast thrust and torque (n, 4) to which the motion responds
        # [1].
        fast = log.u - likely
        given = 0.5 * (fast[1:] + fast[:-1])
        answer = np.zeros_like(given)
        answer[:, 1:] = np.diff(log.w, axis=0) / np.diff(log.t)[:, None] @ vehicle.J.T
        if log.a is not None:
            force = vehicle.mass * attitude.rotate_back(log.q, log.a)[:, 2]
            answer[:, 0] = 0.5 * (force[1:] + force[:-1])
        rough = np.mean(np.diff(answer, axis=0) ** 2, axis=0) / 3
        weight = np.divide(1.0, rough, out=np.zeros(4), where=rough > 0)
        known = max(float(np.sum(weight * given**2)), 1e-300)
        if (
            float(np.sum(weight * given * answer)) / known - SURE_DEVIATIONS / np.sqrt(known)
        ) > ANSWERED:
            return log.u @ vehicle.unmixer.T, np.zeros(4)
        return likely @ vehicle.unmixer.T, noise

    def _command_means(self, shift: float) -> np.ndarray:
        """Return the mean (m, 4) over substeps of a command that is held between rows and beyond
        both ends [N].
        """
        command = np.maximum(self._log.u @ self._vehicle.unmixer.T, 0.0)
        t = self._row_t
        total = np.concatenate(
            [np.zeros((1, 4)), np.cumsum(command[:-1] * np.diff(t)[:, None], axis=0)]
        )
        knots = np.concatenate([[t[0] - 1e3], t, [t[-1] + 1e3]])
        total = np.concatenate([command[:1] * -1e3, total, total[-1:] + command[-1:] * 1e3])
        edges = np.append(self._t, self._t[-1] + self._step) - shift
        return np.diff(Signal(knots, total).linear(edges), axis=0) / self._step


def _measured_pieces(log: FlightLog) -> list[np.ndarray]:
    """Return thrust and torques without the rows that a reader put into gaps, which are smooth, in
    pieces [N, N·m].
    """
    edges = np.concatenate([[-1], np.flatnonzero(log.in_gap), [len(log)]])
    pieces = [log.u[a + 1 : b] for a, b in itertools.pairwise(edges) if b - a > LEAST_ROWS]
    return pieces or [log.u]
