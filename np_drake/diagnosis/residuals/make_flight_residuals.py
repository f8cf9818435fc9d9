"""Residuals of a flight from its log, and what flights must be like to be diagnosed together."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.residuals.accelerations import Instants, make_instants
from np_drake.diagnosis.residuals.attitude_smoothing import smooth_attitude
from np_drake.diagnosis.residuals.flight_residuals import FlightResiduals, after_rows
from np_drake.diagnosis.residuals.resampling import STEP, Grid, make_grid
from np_drake.diagnosis.residuals.rotor_thrust import Rotors
from np_drake.flight_log import FlightLog
from np_drake.rigid_body import V, W
from np_drake.vehicle import Vehicle

LEAST_DURATION = 3.0  # least duration of a flight [s]; own choice
SETTLING = (
    7.0  # rotor time constants after which commands before the log no longer matter [1]; own choice
)
CLEAR = 0.3  # height over the ground up to which take-off and landing reach [m]; own choice
CARRIED, SLOW = (
    0.5,
    0.2,
)  # thrust over its median [1] and speed [m/s] below which the ground carries; own choice
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
    if log.t[-1] - log.t[0] < LEAST_DURATION:
        raise ValueError(
            f"diagnose: {log.name} must last at least {LEAST_DURATION:g} s; got "
            f"{log.t[-1] - log.t[0]:.3g} s. "
            "Give a longer flight."
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
    none, still = np.zeros(len(grid), bool), np.zeros((len(grid), 6))
    rest = none if vehicle.described else _at_rest(log, grid, thrust_rows @ vehicle.mixer[0])
    e = FlightResiduals(
        log,
        vehicle,
        grid,
        still,
        rows,
        mids,
        thrust_rows,
        thrust_mids,
        still,
        still,
        noise,
        turned,
        rest,
        none,
        knows_torque=knows_torque,
    )
    y = np.concatenate([e.from_rows(force), e.from_mids(others)], axis=1)
    u_rows, u_mids = thrust_rows @ vehicle.mixer.T, thrust_mids @ vehicle.mixer.T
    f = u_mids[:, :1] if log.a is None else u_rows[:, :1]
    nominal = np.concatenate([still[:, :2], e.from_rows(f), e.from_mids(u_mids[:, 1:])], axis=1)
    return dc.replace(e, y=e.known(y), nominal=nominal, w=e.from_mids(mids.x[:, W]))


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
    t = log.t[(f < CARRIED * np.median(f)) & (np.linalg.norm(log.v, axis=1) < SLOW)]
    if "velocity" in log.lacks or not len(t):
        return np.zeros(len(grid), bool)
    after = np.clip(np.searchsorted(t, grid.t), 0, len(t) - 1)
    near = np.minimum(np.abs(t[after] - grid.t), np.abs(t[np.maximum(after - 1, 0)] - grid.t))
    return near < TOUCH


def _settled(log: FlightLog, vehicle: Vehicle, thrust: np.ndarray, torque: np.ndarray) -> float:
    """Return the time from which rotor thrust follows from the commands alone [s].

    thrust (n, 1) [N] and torque (n-1, 3) [N·m]: residuals if rotors held the first command before
    the log began.
    """
    lag = 0.0 if log.input == "rotor_speed" else vehicle.rotor_time_constant
    first = max(1, int(np.sum(log.t[1:] <= log.t[0] + STEP)))
    missed = (
        np.concatenate([thrust[:first].mean(axis=0), torque[:first].mean(axis=0)])
        @ vehicle.unmixer.T
    )
    hover = 0.25 * vehicle.mass * vehicle.gravity
    if np.sqrt(np.mean(missed**2)) < OFF * hover:
        return float(log.t[0])
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
    roughness = [
        np.mean(np.diff(attitude.rotate_back(q, log.a + g)[:, :2], n=2, axis=0) ** 2)
        for q in (log.q, smooth)
    ]
    turned = roughness[0] < roughness[1]
    return (log.q if turned else smooth), bool(turned)


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
    rate = np.diff(log.v, axis=0) / dt
    from_v = attitude.rotate_back(mids.q, rate + g)
    u_mids = thrust_mids @ vehicle.mixer.T
    if log.a is None:
        s, f = from_v, u_mids[:, 0]
        e_a = np.zeros((len(mids.t), 3))
    else:
        s = attitude.rotate_back(q, log.a + g)
        f = (thrust_rows @ vehicle.mixer.T)[:, 0]
        e_a = from_v - s[:-1]
        e_a[:, 2] -= after_rows(f, u_mids[:, 0]) / vehicle.mass
    force = vehicle.mass * s
    force[:, 2] -= f
    w = mids.x[:, W]
    al = np.diff(log.w, axis=0) / dt
    torque = al @ vehicle.J.T + np.cross(w, w @ vehicle.J.T) - u_mids[:, 1:]
    e_v = attitude.rotate_back(mids.q, np.diff(log.p, axis=0) / dt - mids.x[:, V])
    turn = (
        attitude.rotation_vector(attitude.multiply(attitude.conjugate(log.q[:-1]), log.q[1:])) / dt
    )
    return force, np.concatenate([torque, e_v, e_a, turn - w], axis=1)


def long_enough(logs: Sequence[FlightLog]) -> tuple[list[FlightLog], tuple[str, ...]]:
    """Return the flights that are long enough for residuals, and a line on each that is left out.

    All are returned where none is, so that the first is refused by its name.
    """
    kept = [log for log in logs if log.t[-1] - log.t[0] >= LEAST_DURATION]
    if not kept:
        return list(logs), ()
    short = (log for log in logs if log.t[-1] - log.t[0] < LEAST_DURATION)
    return kept, tuple(
        f"{log.name}: {log.t[-1] - log.t[0]:.2g} s is too short and left out." for log in short
    )


def with_same_readings(logs: Sequence[FlightLog]) -> tuple[list[FlightLog], tuple[str, ...]]:
    """Return the flights with accelerations in all or in none, and a line where those of some are
    not used.
    """
    without = [log.name for log in logs if log.a is None]
    if not without or len(without) == len(logs):
        return list(logs), ()
    said = (
        f"accelerations are used of no flight: {without[0]} has none. Leave it out to use "
        f"those of the others."
    )
    return [dc.replace(log, a=None) for log in logs], (said,)


def require_flights(train: Sequence[FlightLog], held_out: Sequence[FlightLog]) -> None:
    """Check names and inputs of the flights, and that no held-out flight is a training flight.
    Raises: ValueError: if the flights cannot be diagnosed together; one line with the remedy.
    """
    for name, logs in (("train", train), ("held_out", held_out)):
        if not logs:
            raise ValueError(f"diagnose: {name} must hold at least one flight; got none.")
    names = [log.name for log in [*train, *held_out]]
    twice = {n for n in names if names.count(n) > 1}
    if twice:
        raise ValueError(
            f"diagnose: flights must have different names; got {sorted(twice)[0]!r} twice. "
            "Rename one, or give each flight once."
        )
    inputs = {log.input: log.name for log in reversed([*train, *held_out])}
    if len(inputs) > 1:
        got = " and ".join(f"{kind} ({name})" for kind, name in sorted(inputs.items()))
        raise ValueError(
            f"diagnose: all flights must have the same input; got {got}. Diagnose each "
            f"kind by itself, or name an "
            "input that all have in the vehicle file (input: …)."
        )
    seen = {log.name: _motion(log) for log in train}
    for log in held_out:
        own = _motion(log)
        # More than half of the distinct rows are also in the training flight; a single row is no
        # motion.
        same = next(
            (name for name, rows in seen.items() if 2 * len(own & rows) > len(own) > 1), None
        )
        if same is not None:
            raise ValueError(
                f"diagnose: {log.name} is the same flight as {same}, to which effects are "
                f"fitted, and can judge none. "
                "Give one that was flown apart."
            )


def _motion(log: FlightLog) -> set[bytes]:
    """Return the distinct rows of p, v and w as bytes."""
    rows = np.concatenate([log.p, log.v, log.w], axis=1, dtype=float) + 0.0  # no zero has a sign
    return set(np.ascontiguousarray(rows).view(f"V{rows[:1].nbytes}").ravel().tolist())
