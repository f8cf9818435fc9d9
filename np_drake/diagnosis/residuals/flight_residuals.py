"""Residuals of a flight from its log, and what flights must be like to be diagnosed together."""

import dataclasses as dc
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from np_drake import attitude
from np_drake.checks import require
from np_drake.diagnosis.residuals.resampling import (
    GRID_STEP,
    TAPS,
    Grid,
    Resampler,
    bridge,
    make_grid,
)
from np_drake.diagnosis.residuals.rotor_thrust import Rotors
from np_drake.diagnosis.residuals.smoothing import (
    Instants,
    make_instants,
    smooth_attitude,
    velocity_before,
)
from np_drake.effects.base import Effect
from np_drake.estimation.noise import NoiseModel
from np_drake.estimation.regression import Gram
from np_drake.flight_log import FlightLog
from np_drake.logs.importing.signals import Signal
from np_drake.rigid_body import Q, V, W
from np_drake.vehicle import Vehicle

FORCE = slice(0, 3)
TORQUE = slice(3, 6)
WRENCH = slice(0, 6)
POSITION = slice(6, 9)
VELOCITY = slice(9, 12)
ATTITUDE = slice(12, 15)
ALONG_THRUST = 11  # of the velocity: dv/dt - a along body z
SIZE = 15


@dc.dataclass(frozen=True)
class FlightResiduals:
    """Residuals of one flight on a grid, with the signals from which regressors are made."""

    log: FlightLog
    vehicle: Vehicle
    grid: Grid
    y: np.ndarray  # (m, 15) residuals; 0 in channels that the log does not tell
    rows: Instants  # at which force is measured
    mids: Instants  # at which torque is measured
    thrust_rows: np.ndarray  # (n, 4) of nominal rotors at `rows` [N]
    thrust_mids: np.ndarray  # (n-1, 4) the same at `mids`, the mean over an interval [N]
    # (m, 6) wrench of nominal rotors, and what the calibration of the file gives, in B [N, N·m]
    nominal: np.ndarray
    w: np.ndarray  # (m, 3) body rates in B [rad/s]
    attitude_noise: float  # white attitude noise found [rad]
    turned: bool  # `a` was rotated to W with the attitude readings, not with the smoothed attitude
    # (m,) rows that do not count and are interpolated: in gaps, at rest on the ground, and those of
    # `find_outliers`, once it has been applied
    outliers: np.ndarray
    joined: np.ndarray  # (m,) rows of a held-out flight that joined the fit (adaptive split)
    # The flight continues after these rows, so that an effect absent here may begin later.
    goes_on: bool = False
    # From before what is asked: an effect that changed since then is absent from it.
    earlier: bool = False
    # Whether the log tells the rotors' torque; without it the torque channels are empty.
    knows_torque: bool = True
    # (m, 15) what a fitted calibration of the vehicle gives, already taken from y; 0: nothing
    calibrated: np.ndarray | float = 0.0
    # Share of torque, about each axis, that the motion shows [1]; y and `nominal` count with it.
    torque_gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    # Effects of the file's calibration that act in every model, beyond those of the rotors.
    fixed: tuple[Effect, ...] = ()
    # (m, 6) their part of `nominal`, with all of its torque; 0: nothing [N, N·m]
    given: np.ndarray | float = 0.0

    @property
    def name(self) -> str:
        """Name of the flight."""
        return self.log.name

    @property
    def shown(self) -> np.ndarray:
        """(6,) share of force and torque that the motion shows [1]."""
        return np.array([1.0, 1.0, 1.0, *self.torque_gain])

    @property
    def uncalibrated(self) -> np.ndarray:
        """(m, 15) residuals without the calibration of the vehicle by a fit."""
        return self.y + self.calibrated

    @property
    def against_file(self) -> np.ndarray:
        """(m, 15) residuals against the vehicle file, without any calibration."""
        y = self.uncalibrated.copy()
        y[:, WRENCH] += self.nominal - self.nominal / self.shown
        return self.known(y)

    @property
    def untold(self) -> list[slice]:
        """Channels that the log does not tell: torque, and states that were integrated beside their
        rates.
        """
        lacks = self.log.lacks
        channels = (
            (POSITION, "height" in lacks or "velocity" in lacks),
            (VELOCITY, "velocity" in lacks),
            (ATTITUDE, "attitude" in lacks),
            (TORQUE, not self.knows_torque),
        )
        return [channel for channel, lacking in channels if lacking]

    @property
    def weight(self) -> float:
        """Weight of the nominal vehicle [N]."""
        return self.vehicle.mass * self.vehicle.gravity

    @property
    def measured_rotors(self) -> bool:
        """Whether the input is measured rotor speed rather than a command."""
        return self.log.input == "rotor_speed"

    @property
    def t(self) -> np.ndarray:
        """(m,) times of the grid [s]."""
        return self.grid.t

    @cached_property
    def from_rows(self) -> Resampler:
        """Resampler from the instants of force to the grid: read at the rows, or as a mean without
        accelerations.
        """
        return (
            self.from_mids if self.log.a is None else Resampler.of_instants(self.grid, self.log.t)
        )

    @cached_property
    def from_mids(self) -> Resampler:
        """Resampler from the instants of torque to the grid."""
        return Resampler.of_intervals(self.grid, self.log.t)

    @cached_property
    def rotors(self) -> Rotors:
        """Rotor model that turns the commands of the log into thrust."""
        return Rotors(self.log, self.vehicle)

    @cached_property
    def wrench_states(self) -> tuple[np.ndarray, np.ndarray]:
        """(n, 13) states at `rows` and `mids` of wrench effects, without accelerations with
        velocities before.
        """
        if self.log.a is not None:
            return self.rows.x, self.mids.x
        x = self.mids.x.copy()
        thrust = self.thrust_mids @ self.vehicle.mixer[0]
        x[:, V] = velocity_before(
            self.mids.t, np.diff(self.log.t), x[:, V], x[:, Q], thrust, self.vehicle, self.grid.step
        )
        return x, x

    @cached_property
    def rotor_noise(self) -> np.ndarray:
        """(15,) deviation of the channels due to noise in measured rotor speed, taken as white; 0
        for commands.
        """
        f_tau = self.rotors.noise * np.sqrt(self.log.step / self.grid.step)
        return np.concatenate([[0.0, 0.0], f_tau, np.zeros(SIZE - 6)])

    @cached_property
    def made(self) -> dict[Any, Any]:
        """Cache of what follows from motion and rotors: by what made it, and of what. By a small
        sensor error, (m, 15, k) what it leaves for a unit of each parameter.
        """
        return {}

    @cached_property
    def q(self) -> np.ndarray:
        """(m, 4) attitude on the grid."""
        near = attitude.one_hemisphere(self.rows.q, self.rows.q[0])
        q = Signal(self.rows.t, near).linear(self.t)
        return attitude.normalised(q)

    @cached_property
    def R_WB(self) -> np.ndarray:
        """(m, 3, 3) attitude on the grid as rotation matrices."""
        return attitude.rotation_matrix(self.q)

    @cached_property
    def ahead(self) -> np.ndarray:
        """(m, 4) thrust and torques of nominal rotors at rows, less their mean around the rows [N,
        N·m].

        A held command leads by half a row. Zero without accelerations: all values are then means.
        """
        if self.log.a is None:
            return np.zeros((len(self.t), 4))
        mixer = self.vehicle.mixer
        return self.from_rows(self.thrust_rows @ mixer.T) - self.from_mids(
            self.thrust_mids @ mixer.T
        )

    @cached_property
    def after(self) -> np.ndarray:
        """(m,) mean thrust of nominal rotors until the next row, less that at the row, over the
        mass [m/s²].
        """
        u_rows = self.thrust_rows @ self.vehicle.mixer.T
        u_mids = self.thrust_mids @ self.vehicle.mixer.T
        return self.from_mids(u_mids[:, 0] - u_rows[:-1, 0]) / self.vehicle.mass

    @cached_property
    def gyroscopic(self) -> np.ndarray:
        """(m, 3) w x J w with the inertia of the vehicle file, in B [N·m]."""
        return np.cross(self.w, self.w @ self.vehicle.J.T)

    @cached_property
    def driving(self) -> np.ndarray:
        """(m-1, 3, 4) `a` [m/s²] and `lever` [1/s²], in W, at the middles of the grid's steps."""
        return self._between(self.rows.a, self.rows.lever)

    @cached_property
    def moving(self) -> np.ndarray:
        """(m-1, 3, 4) velocity [m/s] and `sweep` [1/s], in W, at the middles of the grid's
        steps.
        """
        return self._between(self.rows.x[:, V], self.rows.sweep)

    def _between(self, vector: np.ndarray, matrix: np.ndarray) -> np.ndarray:
        """Return (m-1, 3, 4) vector (n, 3) and matrix (n, 3, 3) at the rows, at the middles of the
        grid's steps.
        """
        values = np.concatenate([vector[..., None], matrix], axis=-1)
        middle = 0.5 * (self.t[1:] + self.t[:-1])
        return Signal(self.rows.t, values.reshape(-1, 12)).linear(middle).reshape(-1, 3, 4)

    def head(self, rows: int) -> "FlightResiduals":
        """Return the flight truncated after at least `rows` rows of the grid, which do not change
        by the cut.
        """
        known = np.append(np.flatnonzero(~self.outliers[rows - 1 :]), len(self.t))
        n = rows + int(known[0]) + TAPS  # past interpolated outliers and the reach of the low-pass
        if n >= len(self.t):
            return self
        grid = dc.replace(
            self.grid, t=self.t[:n], fine=self.grid.fine[: (n - 1) * self.grid.factor + 1]
        )
        by_row = ("y", "nominal", "w", "outliers", "joined", "calibrated", "given")
        cut = {name: getattr(self, name)[:n] for name in by_row if np.ndim(getattr(self, name))}
        return dc.replace(self, grid=grid, **cut)

    def revised(self, **fields: Any) -> "FlightResiduals":
        """Return the flight with other residuals, outliers or marks; what follows from its motion
        is kept.
        """
        for name in ("from_rows", "from_mids", "rotors", "made"):
            getattr(self, name)  # which both flights share from now on
        revised = dc.replace(self, **fields)
        vars(revised).update({**vars(self), **vars(revised)})
        return revised

    def begun(self, onset: float | None) -> np.ndarray:
        """Return a step (m, 15) that is one from `onset` [s] on (None and -inf: always), smeared as
        each channel is.
        """
        if onset is None or not np.isfinite(onset):
            return np.full((len(self.t), SIZE), float(onset is None or onset < 0))
        force, others = (
            to((instants.t >= onset - 1e-9).astype(float))
            for to, instants in ((self.from_rows, self.rows), (self.from_mids, self.mids))
        )
        return _by_channel(force, others)

    def rise(self) -> np.ndarray:
        """Return the step response (2 k + 1, 15) of the grid about its middle row, for evenly
        spaced log rows.
        """
        fine = self.grid.fine
        middle = len(self.t) // 2
        half = min(TAPS if self.grid.factor > 1 else 1, middle - 1)
        mids = fine + 0.5 * (fine[1] - fine[0])
        force, others = (
            Resampler.of_instants(self.grid, t)((t >= self.t[middle] - 1e-9).astype(float))
            for t in (mids if self.log.a is None else fine, mids)
        )
        return _by_channel(force, others)[middle - half : middle + half + 1]

    def known(self, values: np.ndarray) -> np.ndarray:
        """Return channels (m, 15) with zeros in those that the log does not tell."""
        if not self.untold:
            return values
        values = values.copy()
        for channels in self.untold:
            values[:, channels] = 0.0
        return values

    def bridged(self, values: np.ndarray) -> np.ndarray:
        """Return channels or columns (m, ...) with outlier rows interpolated."""
        return bridge(values, self.outliers)

    def white(self, noise: NoiseModel, values: np.ndarray) -> np.ndarray:
        """Return channels or columns (m, 15, ...) with outlier rows interpolated, whitened to (m -
        p, ...).

        Args:
            values: (m, 15, ...) channels or columns.
        """
        return noise.whiten(self.bridged(values), self.name)

    def gram(
        self, noise: NoiseModel, columns: Sequence[np.ndarray], target: np.ndarray | None = None
    ) -> Gram:
        """Return the Gram matrix of whitened columns.

        Args:
            columns: groups (m, 15, k_i).
            target: (m, 15) channels; default: y.
        """
        y = self.y if target is None else target
        products = noise.products([self.bridged(X) for X in (*columns, y[..., None])], self.name)
        return Gram(products[:-1, :-1], products[:-1, -1])


def _by_channel(force: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return (m, 15) channels from a value for force (m,) and one for all channels measured between
    rows (m,).
    """
    return np.repeat(np.stack([force, others], axis=1), [3, SIZE - 3], axis=1)


LEAST_DURATION = 3.0  # least duration of a flight [s]; own choice
# rotor time constants after which commands before the log no longer matter [1]; own choice
SETTLING = 7.0
CLEAR = 0.3  # height over the ground up to which take-off and landing reach [m]; own choice
# thrust over its median [1] and speed [m/s] below which the ground carries; own choice
GROUNDED_THRUST = 0.5
GROUNDED_SPEED = 0.2
TOUCH = 0.5  # time about standing in which the ground still pushes [s]; own choice
# initial thrust error over hover thrust, above which rotors had not settled [1]; own choice
OFF = 0.4


def make_flight_residuals(
    log: FlightLog, vehicle: Vehicle, step: float | None = None, since: float | None = None
) -> FlightResiduals:
    """Compute the residuals of one flight.

    Args:
        step: step of the grid, where flights are to share it [s]; default: that of the log.
        since: time from which rows count [s]; default: when rotor thrust follows from the commands
            alone.
    Raises: ValueError: if the flight is too short for a grid.
    """
    require(
        log.t[-1] - log.t[0] >= LEAST_DURATION,
        f"diagnose: {log.name} must last at least {LEAST_DURATION:g} s; got "
        f"{log.t[-1] - log.t[0]:.3g} s. "
        "Give a longer flight.",
    )
    knows_torque = bool(np.isfinite(log.u[:, 1:]).any() or not np.isfinite(log.u[:, 0]).any())
    log = log if knows_torque else dc.replace(log, u=np.nan_to_num(log.u))
    smooth, noise = smooth_attitude(log.t, log.q, log.w)
    q, turned = _attitude_for_force(log, smooth, vehicle.gravity)
    rows, mids = make_instants(log, smooth)
    thrust_rows, thrust_mids = Rotors(log, vehicle).thrust([])
    force, others = _channels(log, vehicle, q, mids, thrust_rows, thrust_mids)
    since = _settled(log, vehicle, force[:, 2:], others[:, :3]) if since is None else since
    first, last = (log.t[0], log.t[-1]) if vehicle.described else _clear_of_ground(log)
    grid = make_grid(log.t[(log.t >= max(since, first)) & (log.t <= last)], step)
    rest = (
        np.zeros(len(grid.t), bool)
        if vehicle.described
        else _at_rest(log, grid, thrust_rows @ vehicle.mixer[0])
    )
    from_mids = Resampler.of_intervals(grid, log.t)
    from_rows = from_mids if log.a is None else Resampler.of_instants(grid, log.t)
    u_rows = thrust_rows @ vehicle.mixer.T
    u_mids = thrust_mids @ vehicle.mixer.T
    f = u_mids[:, :1] if log.a is None else u_rows[:, :1]
    level = np.zeros((len(grid.t), 2))
    flight = FlightResiduals(
        log=log,
        vehicle=vehicle,
        grid=grid,
        y=np.concatenate([from_rows(force), from_mids(others)], axis=1),
        rows=rows,
        mids=mids,
        thrust_rows=thrust_rows,
        thrust_mids=thrust_mids,
        nominal=np.concatenate([level, from_rows(f), from_mids(u_mids[:, 1:])], axis=1),
        w=from_mids(mids.x[:, W]),
        attitude_noise=noise,
        turned=turned,
        outliers=rest | (np.interp(grid.t, log.t, log.in_gap) > 0),
        joined=np.zeros(len(grid.t), bool),
        knows_torque=knows_torque,
    )
    return dc.replace(flight, y=flight.known(flight.y))


def _clear_of_ground(log: FlightLog) -> tuple[float, float]:
    """Return the times between take-off and landing [s]: near the ground there are forces of
    contact.
    """
    z = log.p[:, 2]
    least = min(CLEAR, 0.5 * float(np.median(z)))
    above = log.t[z >= least]
    if "height" in log.lacks or not len(above) or above[-1] - above[0] < LEAST_DURATION:
        return float(log.t[0]), float(log.t[-1])
    return float(above[0]), float(above[-1])


def _at_rest(log: FlightLog, grid: Grid, f: np.ndarray) -> np.ndarray:
    """Return rows (m,) of the grid about times at which the vehicle stands on the ground: slow,
    with little thrust.

    Args:
        f: (n,) nominal thrust at the rows [N].
    """
    t = log.t[
        (f < GROUNDED_THRUST * np.median(f)) & (np.linalg.norm(log.v, axis=1) < GROUNDED_SPEED)
    ]
    if "velocity" in log.lacks or not len(t):
        return np.zeros(len(grid.t), bool)
    after = np.clip(np.searchsorted(t, grid.t), 0, len(t) - 1)
    near = np.minimum(np.abs(t[after] - grid.t), np.abs(t[np.maximum(after - 1, 0)] - grid.t))
    return near < TOUCH


def _settled(log: FlightLog, vehicle: Vehicle, thrust: np.ndarray, torque: np.ndarray) -> float:
    """Return the time from which rotor thrust follows from the commands alone [s].

    thrust (n, 1) [N] and torque (n-1, 3) [N·m]: residuals if rotors held the first command before
    the log began.
    """
    first = max(1, int(np.sum(log.t[1:] <= log.t[0] + GRID_STEP)))
    missed = (
        np.concatenate([thrust[:first].mean(axis=0), torque[:first].mean(axis=0)])
        @ vehicle.unmixer.T
    )
    if np.sqrt(np.mean(missed**2)) < OFF * (0.25 * vehicle.mass * vehicle.gravity):
        return float(log.t[0])
    lag = 0.0 if log.input == "rotor_speed" else vehicle.rotor_time_constant
    return float(min(log.t[0] + SETTLING * lag, log.t[-1] - LEAST_DURATION))


def _attitude_for_force(
    log: FlightLog, smooth: np.ndarray, gravity: float
) -> tuple[np.ndarray, bool]:
    """Return the attitude (n, 4) that rotates `a` back to the accelerometer's axes with least
    noise, and `turned`.
    """
    if log.a is None or smooth is log.q:
        return smooth, False
    g = np.array([0.0, 0.0, gravity])
    read, better = (
        np.mean(np.diff(attitude.rotate_back(q, log.a + g)[:, :2], n=2, axis=0) ** 2)
        for q in (log.q, smooth)
    )
    return (log.q, True) if read < better else (smooth, False)


def _channels(
    log: FlightLog,
    vehicle: Vehicle,
    q: np.ndarray,
    mids: Instants,
    thrust_rows: np.ndarray,
    thrust_mids: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the force channels (n, 3) at the instants of force and the others (n-1, 12) at those
    of torque.
    """
    dt = np.diff(log.t)[:, None]
    g = np.array([0.0, 0.0, vehicle.gravity])
    from_v = attitude.rotate_back(mids.q, np.diff(log.v, axis=0) / dt + g)
    u_mids = thrust_mids @ vehicle.mixer.T
    if log.a is None:
        s = from_v
        f = u_mids[:, 0]
        e_a = np.zeros((len(mids.t), 3))
    else:
        s = attitude.rotate_back(q, log.a + g)
        f = (thrust_rows @ vehicle.mixer.T)[:, 0]
        e_a = from_v - s[:-1]
        e_a[:, 2] -= (u_mids[:, 0] - f[:-1]) / vehicle.mass
    force = vehicle.mass * s
    force[:, 2] -= f
    w = mids.x[:, W]
    al = np.diff(log.w, axis=0) / dt
    torque = al @ vehicle.J.T + np.cross(w, w @ vehicle.J.T) - u_mids[:, 1:]
    e_v = attitude.rotate_back(mids.q, np.diff(log.p, axis=0) / dt - mids.x[:, V])
    turn = attitude.turn_between(log.q[:-1], log.q[1:])
    return force, np.concatenate([torque, e_v, e_a, turn / dt - w], axis=1)


def long_enough(logs: Sequence[FlightLog]) -> tuple[list[FlightLog], tuple[str, ...]]:
    """Return the flights that are long enough for residuals, and a line on each that is left out.

    All are returned where none is, so that the first is refused by its name.
    """
    kept = [log for log in logs if log.t[-1] - log.t[0] >= LEAST_DURATION]
    if not kept:
        return list(logs), ()
    return kept, tuple(
        f"{log.name}: {log.t[-1] - log.t[0]:.2g} s is too short and left out."
        for log in logs
        if log.t[-1] - log.t[0] < LEAST_DURATION
    )


def with_same_readings(logs: Sequence[FlightLog]) -> tuple[list[FlightLog], tuple[str, ...]]:
    """Return the flights with accelerations in all or in none, and a line where those of some are
    not used.
    """
    without = [log.name for log in logs if log.a is None]
    if not without or len(without) == len(logs):
        return list(logs), ()
    return [dc.replace(log, a=None) for log in logs], (
        f"accelerations are used of no flight: {without[0]} has none. Leave it out to use "
        f"those of the others.",
    )


def require_alike(who: str, logs: Sequence[FlightLog]) -> None:
    """Raise ValueError where flights share a name, or have different inputs; one line with the
    remedy.
    """
    names = [log.name for log in logs]
    if twice := {n for n in names if names.count(n) > 1}:
        raise ValueError(
            f"{who}: flights must have different names; got {sorted(twice)[0]!r} twice. "
            "Rename one, or give each flight once."
        )
    inputs = {log.input: log.name for log in reversed(logs)}
    if len(inputs) > 1:
        got = " and ".join(f"{kind} ({name})" for kind, name in sorted(inputs.items()))
        raise ValueError(
            f"{who}: all flights must have the same input; got {got}. Give each kind by itself, or "
            "name an input that all have in the vehicle file (input: …)."
        )


def require_flights(
    train: Sequence[FlightLog], held_out: Sequence[FlightLog], before: Sequence[FlightLog] = ()
) -> None:
    """Check names and inputs of the flights, and that no held-out flight is a training flight, nor
    one from before what is asked.
    Raises: ValueError: if the flights cannot be diagnosed together; one line with the remedy.
    """
    for name, logs in (("train", train), ("held_out", held_out)):
        require(logs, f"diagnose: {name} must hold at least one flight; got none.")
    require_alike("diagnose", [*train, *held_out, *before])
    for known, others in ((train, held_out), (before, [*train, *held_out])):
        seen = {log.name: _motion(log) for log in known}
        for log in others:
            motion = _motion(log)
            # More than half of the distinct rows are also in the known flight; a single row is no
            # motion.
            same = next(
                (name for name, rows in seen.items() if 2 * len(motion & rows) > len(motion) > 1),
                None,
            )
            if same is not None:
                raise ValueError(
                    f"diagnose: {log.name} is the same flight as {same}, to which effects are "
                    "fitted, and can judge none. Give one that was flown apart."
                )


def _motion(log: FlightLog) -> set[bytes]:
    """Return the distinct rows of p, v and w as bytes."""
    rows = np.concatenate([log.p, log.v, log.w], axis=1, dtype=float) + 0.0  # no zero has a sign
    return set(np.ascontiguousarray(rows).view(f"V{rows[:1].nbytes}").ravel().tolist())
