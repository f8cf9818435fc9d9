"""What the input columns of a log hold: the kind of input, and when a row's command acts."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from diagrams.challenge.generate.sensor_quality import rows_of
from np_drake.effects.library import unobservable
from np_drake.flight_log import FlightLog
from np_drake.logs.import_sheet import Sheet
from np_drake.rotor_input import with_rotor_input
from np_drake.vehicle.vehicle import INPUTS, Vehicle

SEMANTICS = ("held_after", "held_before", "averaged", "sampled")  # of a row's command
FINER = 2  # commands in an interval of rows, where a row does not hold one command [1]
THROTTLE = 0.6  # exponent of the throttle over thrust [1]
# What the log states of the time at which a row's command acts: its deviation over the interval of
# rows [1]. Source: as np_drake.logs.importing, but that a mean over the interval acts somewhere in
# it; that the command acted before its row is not known, for who knows it shifts the commands.
TIMING = {"held_after": 0.0, "held_before": 0.5, "averaged": 12**-0.5, "sampled": 12**-0.5}
# Effects that are a shift of the commands' time, which only a log of held commands tells.
COMMAND_TIME = ("command_delay", "clock_offset")
# Out-of-library effects that the map of an input absorbs: the exponent of a throttle is fitted to
# the flight.
ABSORBED = {"normalised": ("bent_thrust_curve",)}


@dc.dataclass(frozen=True)
class LoggedInput:
    """The input of one case's logs.

    kind: as `FlightLog.input`.
    semantics: `held_after` (a row's command acts until the next row), `held_before` (it acted until
        this row, the log lags by one row), `averaged` (mean over the interval after the row),
        `sampled` (one of the commands in it).
    late: which of the commands in an interval is sampled, 0 … FINER - 1.
    """

    kind: str = "command"
    semantics: str = "held_after"
    late: int = 0

    @property
    def finer(self) -> int:
        """Return how many commands act in an interval of rows [1]."""
        return 1 if self.semantics.startswith("held") else FINER

    @property
    def held(self) -> bool:
        """Return whether the log holds commands that act from their row to the next."""
        return self.semantics == "held_after" and self.kind != "rotor_speed"

    def timing(self, step: float) -> float:
        """Return the deviation of the time at which a row's command acts, as the log states it [s].

        step: interval of the rows [s].
        Zero where a row's command is held, and where the input is no command.
        """
        return 0.0 if self.kind == "rotor_speed" else round(TIMING[self.semantics] * step, 6)

    def sheet(self, step: float) -> Sheet | None:
        """Return what lies beside a log with such rows: the uncertainty of its commands' time;
        None: nothing.
        """
        timing = self.timing(step)
        meaning = "unknown" if self.semantics == "held_before" else self.semantics
        return Sheet(timing, {"command": meaning}) if timing > 0 else None

    def instants(self, t: np.ndarray) -> np.ndarray:
        """Return the times (n * finer,) at which a command is given, of rows at t (n,) [s]."""
        if self.finer == 1:
            return t
        after = np.append(t, 2 * t[-1] - t[-2])
        return np.interp(np.arange(len(t) * self.finer) / self.finer, np.arange(len(after)), after)


def draw_logged_input(rng: np.random.Generator, names: Sequence[str]) -> LoggedInput:
    """Draw the input of a case's logs among those that can tell its effects."""
    hidden = {kind: {*unobservable(kind), *ABSORBED.get(kind, ())} for kind in INPUTS}
    kind = str(rng.choice([kind for kind in INPUTS if not hidden[kind] & set(names)]))
    timed = bool(set(COMMAND_TIME) & set(names))
    semantics = str(rng.choice(SEMANTICS[:1] if timed else SEMANTICS))
    return LoggedInput(kind, semantics, int(rng.integers(FINER)) if semantics == "sampled" else 0)


def per_row(log: FlightLog, finer: int) -> FlightLog:
    """Return every `finer`-th row with the mean of the commands until the next, as who knows all
    commands sees it.

    Args:
        finer: commands in an interval of rows [1].
    """
    return log if finer == 1 else as_logged(log, "averaged", finer)


def as_logged(log: FlightLog, semantics: str, finer: int, late: int = 0) -> FlightLog:
    """Return every `finer`-th row, with a command as these semantics log it.

    Args:
        semantics: as of `LoggedInput`.
        finer: commands in an interval of rows [1].
    """
    u, rows = log.u, np.arange(0, len(log), finer)
    if semantics == "held_before":
        u = np.concatenate([u[:1], u[:-1]])
    if semantics == "averaged":
        u = np.stack([np.roll(u, -i, axis=0) for i in range(finer)]).mean(axis=0)
    if semantics == "sampled":
        u = np.roll(u, -late, axis=0)
    return rows_of(dc.replace(log, u=u), rows)


def with_input(log: FlightLog, vehicle: Vehicle, kind: str) -> FlightLog:
    """Return the log with one kind of input, as a file is to hold it.

    Args:
        kind: as `FlightLog.input`.
    """
    if kind == "command":
        return log
    if kind == "rotor_speed":
        return dc.replace(log, input=kind)
    log = dc.replace(log, rotor=None)
    if kind == "thrust_only":
        return dc.replace(
            log, u=np.column_stack([log.u[:, 0], np.full((len(log), 3), np.nan)]), input=kind
        )
    share = np.maximum(log.u @ vehicle.unmixer.T, 0.0) / vehicle.max_rotor_thrust
    return dc.replace(log, throttle=share**THROTTLE, input="normalised")


def best_known(log: FlightLog, command: np.ndarray, vehicle: Vehicle, kind: str) -> FlightLog:
    """Return the log with the input of the true model, which knows all commands and no rotor's
    speed.

    Where rotor speed is the input it is what the log measures. A throttle's scale and exponent are
    known; a torque that the file does not hold is not.

    Args:
        command: (n, 4) of every row [N, N·m].
        kind: of the input, as `FlightLog.input`.
    """
    log = dc.replace(log, u=command, throttle=None, input="command")
    if kind == "rotor_speed":
        return with_rotor_input(log, vehicle)
    return with_input(log, vehicle, kind) if kind == "thrust_only" else log
