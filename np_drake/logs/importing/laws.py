"""Laws that tie the quantities of a log to each other: which conventions and units it can have.

Kinematics ties position to velocity and attitude to body rates; gravity ties an accelerometer to
the vertical; the specific force of a multirotor lies along its thrust axis. Each law is tested over
windows, where the axis moves enough. Thresholds of `check_units` are checked on 43 NeuroBEM flights
and 2900 simulated ones.
"""

from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np
import scipy

from np_drake import attitude
from np_drake.checks import require
from np_drake.flight_log import FlightLog
from np_drake.logs.errors import LogError, place
from np_drake.logs.importing.log_map import GRAVITY
from np_drake.rotor_input import rotor_wrench
from np_drake.vehicle import Vehicle


def stretches(mask: np.ndarray) -> np.ndarray:
    """Return first row and row after the last of every stretch in which a mask (n,) holds, (k,
    2).
    """
    return np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int))).reshape(
        -1, 2
    )


class Windows:
    """Windows that begin at each row and hold as many intervals, `rows`.

    fit: whether the log holds two of them.   spans: duration of each, (n - rows,) [s].

    Args:
        t: (n,) times of the rows [s].
        seconds: duration of a window [s].
    """

    def __init__(self, t: np.ndarray, seconds: float) -> None:
        self._t = t
        self.rows = max(1, round(seconds / float(np.median(np.diff(t)))))
        self.fit = len(t) > 2 * self.rows
        self.spans = self.change(t)

    def change(self, value: np.ndarray) -> np.ndarray:
        """Return the change of a quantity (n, k) over each window, (n - rows, k)."""
        return value[self.rows :] - value[: -self.rows]

    def integral(self, rate: np.ndarray) -> np.ndarray:
        """Return the integral of a rate (n, k) over each window, (n - rows, k), by the trapezoidal
        rule.
        """
        return self.change(scipy.integrate.cumulative_trapezoid(rate, self._t, axis=0, initial=0.0))

    def turn(self, q: np.ndarray) -> np.ndarray:
        """Return the sum of the small rotations of q (n, 4) in body axes over each window, (n -
        rows, 3) [rad].
        """
        turn = attitude.multiply(q[:-1] * [1.0, -1.0, -1.0, -1.0], q[1:])
        # A small rotation vector is twice the vector part of its quaternion, of the sign with w >
        # 0.
        small = 2 * turn[:, 1:] * np.sign(turn[:, :1])
        return self.change(np.concatenate([np.zeros((1, 3)), np.cumsum(small, axis=0)]))


# largest misfit of a law that holds [1]; own choice: wind, drag, noise, late sensors stay below
AGREES = 0.5
FAILS = 0.75  # misfit above which a law does not hold [1]; own choice
OPPOSED = 1.5  # misfit from which two sides are turned round, whatever else acts [1]; own choice
SCALE = f"above {FAILS:g} a law fails, 2 is the opposite"  # of a misfit, for messages
# share of the tilt that horizontal accelerations need, below which an attitude never tilts [1]; own
# choice
LEVEL = 0.1
WINDOW = 0.5  # over which changes and integrals are compared [s]; own choice
# RMS of an axis over a window below which it is not tested; own choice, some times usual noise
LEAST = {
    "position": 0.05,  # [m]
    "velocity": 0.25,  # [m/s]
    "attitude": 0.08,  # [rad]
    "lift": 0.5,  # [m/s²]
}
KINEMATIC = "position", "attitude", "velocity"  # laws that tie a quantity to its rate, axis by axis
Misfits = dict[str, float]


def misfits(t: np.ndarray, x: Mapping[str, np.ndarray], *, everything: bool = False) -> Misfits:
    """Return the misfit of every law that the log can test, by its name: 0 is agreement, 1 none, 2
    the opposite.

    It is the RMS of the disagreement over that of the larger side, means removed; for gravity the
    mean disagreement over g, for the sign of the thrust 0 or 2.

    Args:
        t: (n,) evenly spaced times [s].
        x: quantities as `convert` returns them, at these times.
        everything: also of axes that move too little to test the law, relative to what would be
            enough.
    """
    over = Windows(t, WINDOW)
    out: Misfits = {}
    for needed, law in laws_for(x) if over.fit else ():
        out |= law(over, everything, *(x[name] for name in needed))
    return out


def failing(by_law: Misfits) -> list[str]:
    """Return the laws that do not hold."""
    return [law for law, misfit in by_law.items() if misfit > FAILS]


def misfit_text(laws: Sequence[str], by_law: Misfits) -> str:
    """Return the misfits of some laws in words."""
    return f"misfit of {', '.join(f'{law} {by_law[law]:.2g}' for law in laws)} ({SCALE})"


def told_by_noise(by_law: Misfits) -> list[str]:
    """Return the laws that fail about one axis alone, where the others agree or move too little.

    Noise and drift of that axis' sensor explain it: it tells nothing. A law of the opposite sign is
    none of these.
    """
    laws = []
    for kind in KINEMATIC:
        axes = {law: misfit for law, misfit in by_law.items() if law.split()[0] == kind}
        ranked = sorted(axes, key=lambda law: -axes[law])
        others = [axes[law] for law in ranked[1:]]
        if ranked and FAILS < axes[ranked[0]] < OPPOSED and max(others, default=0.0) < AGREES:
            laws.append(ranked[0])
    return laws


def never_tilts(t: np.ndarray, x: Mapping[str, np.ndarray]) -> tuple[float, float] | None:
    """Return the spread of an attitude's tilt and that which horizontal accelerations need [rad];
    None where it tilts.

    A planar odometry has no roll and no pitch.

    Args:
        t: (n,) evenly spaced times [s].
        x: quantities as `convert` returns them, at these times.
    """
    over = Windows(t, WINDOW)
    if not over.fit or "velocity" not in x or "attitude" not in x:
        return None
    a = over.change(x["velocity"])[:, :2] / over.spans[:, None]
    # Of most windows: a single bad sample of the velocity needs no tilt.
    needed = float(np.median(np.linalg.norm(a - np.median(a, axis=0), axis=1))) / GRAVITY
    z = attitude.body_z(x["attitude"])[:, :2]
    tilt = float(np.median(np.linalg.norm(z - np.median(z, axis=0), axis=1)))
    return (tilt, needed) if tilt < LEVEL * needed and needed > LEAST["lift"] / GRAVITY else None


def _position(over: Windows, everything: bool, p: np.ndarray, v: np.ndarray) -> Misfits:
    return _compared("position", over.change(p), over.integral(v), everything)


def _attitude(over: Windows, everything: bool, q: np.ndarray, w: np.ndarray) -> Misfits:
    return _compared("attitude", over.turn(q), over.integral(w), everything)


def _velocity(over: Windows, everything: bool, v: np.ndarray, a: np.ndarray) -> Misfits:
    dv = over.change(v)
    sum_ = over.integral(a)
    return _compared("velocity", dv, sum_, everything) | {
        "gravity": float(np.linalg.norm(np.mean(sum_ - dv, axis=0)) / over.spans[0] / GRAVITY)
    }


def _weight(over: Windows, everything: bool, a: np.ndarray) -> Misfits:
    """Return the misfits of a specific force in body axes, all that a log without attitude has of
    gravity.

    The rotors push along the thrust axis. On the whole they carry the weight: a factor of g is as
    wrong as a unit.
    """
    s = a + [0.0, 0.0, GRAVITY]  # as `convert` leaves it without attitude
    size = max(float(np.median(np.linalg.norm(s, axis=1))), 1e-9)
    return {
        "upright": 1 - float(np.median(s[:, 2])) / size,
        "gravity": abs(np.log(size / GRAVITY)) / np.log(GRAVITY),
    }


def _thrust(over: Windows, everything: bool, thrust: np.ndarray) -> Misfits:
    return {"thrust": 2.0 * float(np.median(thrust) < 0)}


def _lift(over: Windows, everything: bool, v: np.ndarray, q: np.ndarray) -> Misfits:
    """Return the misfit of horizontal accelerations with a drag and a force along body z that
    carries the vertical one.

    The drag over mass is the one, not negative, with which they fit best; a steady wind falls out
    with the means.
    """
    span = over.spans[:, None]
    a = over.change(v) / span
    z = over.integral(attitude.body_z(q)) / span
    up = z[:, 2]
    out = {"upright": 2.0 * float(np.median(up) < 0)}
    if out["upright"]:
        return out
    model = ((a[:, 2] + GRAVITY) / np.maximum(up, 0.2))[:, None] * z[:, :2]
    speed = over.integral(v)[:, :2] / span
    # Least squares of the one coefficient, bounded below by zero.
    rest = a[:, :2] - model
    moving = speed - speed.mean(axis=0)
    drag = max(0.0, -float(np.sum(rest * moving)) / max(float(np.sum(moving**2)), 1e-12))
    return out | _compared("lift", a[:, :2], model - drag * speed, everything)


def _compared(law: str, change: np.ndarray, right: np.ndarray, everything: bool) -> Misfits:
    out = {}
    for i in range(change.shape[1]):
        a = change[:, i] - change[:, i].mean()
        b = right[:, i] - right[:, i].mean()
        size = max(_rms(a), _rms(b))
        if size > LEAST[law] or everything:
            out[f"{law} {'xyz'[i]}"] = _rms(a - b) / max(size, LEAST[law])
    return out


def _rms(value: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(value))))


Law = Callable[..., Misfits]  # of windows, everything, and the quantities that it needs
LAWS: tuple[tuple[tuple[str, ...], Law], ...] = (
    (("position", "velocity"), _position),
    (("attitude", "rates"), _attitude),
    (("velocity", "acceleration"), _velocity),
    (("velocity", "attitude"), _lift),
    (("thrust",), _thrust),
)


def laws_for(names: Collection[str]) -> list[tuple[tuple[str, ...], Law]]:
    """Return the laws that these quantities can test, with those that each needs."""
    laws = LAWS
    if "attitude" not in names:  # of the accelerometer nothing is known in W
        laws = (*(pair for pair in LAWS if pair[1] is not _velocity), (("acceleration",), _weight))
    return [(needed, law) for needed, law in laws if all(name in names for name in needed)]


RATIO = 6.0  # above noise, wind-up or effects; below g, degrees or millimetres [1]
ALIKE = 0.5  # cosine below which two signals are not multiples of each other [1]
STILL = 1e-4  # ratio below which one of two signals is constant [1]
TURNS = 0.3  # spread of an axis' rate over a window below which its torque is not checked [rad/s]
TORQUE_WINDOWS = 8  # duration that a flight needs for a check of its torque [windows]
# of two integrals of one signal; at most 5.3 in valid flights, 3.4 where they turn [1]
TORQUE_RATIO = 30.0
# share of the rotation left by the opposite torque if the sign is wrong; 0.97 if valid [1]
OPPOSITE = 0.7
FASTEST_ROTOR = 5000.0  # [rad/s]; 48,000 rpm
SIGN = 0.25  # of the spreads below: an axis that moves so much shows its sign [1]; own choice
# share of thrust downwards on the whole, which tumbling flights do not have [1]; own choice
DOWN = 0.3
# share of a change that the opposite of its rate's integral leaves if a sign is wrong [1]
AGAINST = 0.3
# Spread below which nothing is checked [m, rad, m/s, rad/s].
LEAST_SPREAD = {"position": 0.2, "attitude": 0.2, "velocity": 0.5, "rates": 1.0}


def check_units(log: FlightLog, path: object, vehicle: Vehicle | None = None) -> None:
    """Check the units of all columns of a log.

    Args:
        vehicle: for the weight and the strength of the rotors; None skips these.
    Raises: LogError: if a column is off by orders of magnitude.
    """
    over = Windows(log.t, WINDOW)
    if over.fit:
        _compare(path, "px", "vx", over.change(log.p), over.integral(log.v), "position")
        turned = over.integral(log.w)
        _compare(path, "qw", "wx", over.turn(log.q), turned, "attitude")
        _check_convention(log.q, turned, over, path)
        if log.a is not None:
            _compare(path, "vx", "ax", over.change(log.v), over.integral(log.a), "velocity")
            gained = (log.v[-1, 2] - log.v[0, 2]) / (log.t[-1] - log.t[0])
            surplus = float(np.mean(log.a[:, 2]) - gained)
            require(
                abs(abs(surplus) - GRAVITY) >= 2.0,
                f"{place(path, column='az')}: acceleration must be dv/dt in W, without "
                f"gravity; its mean exceeds dv/dt by {surplus:.3g} m/s². "
                "Rotate the accelerometer's reading to W and subtract g.",
                LogError,
            )
        if log.al is not None:
            _compare(path, "wx", "alx", over.change(log.w), over.integral(log.al), "rates")
    if log.rotor is not None and np.abs(log.rotor).max() > FASTEST_ROTOR:
        raise LogError(
            f"{place(path, column='rotor1')}: rotor speed must be below {FASTEST_ROTOR:g} rad/s; "
            f"got {np.abs(log.rotor).max():.4g}. Is it in rpm?"
        )
    _check_lift(log, path)
    if vehicle is not None:
        _check_thrust(log, path, vehicle)
        if len(log) > TORQUE_WINDOWS * over.rows:
            _check_torque(log, path, vehicle, over)


def _compare(
    path: object, column: str, right: str, change: np.ndarray, sum_: np.ndarray, kind: str
) -> None:
    """Check that a quantity changes as the integral of its rate: axis by axis, where it moves
    enough, not as the opposite, in size too, and on the whole in unit and frame.
    """
    for i in range(3 if kind != "attitude" else 0):  # its sign is that of its convention
        c = change[:, i] - change[:, i].mean()
        s = sum_[:, i] - sum_[:, i].mean()
        size = float(np.std(c))
        if size > SIGN * LEAST_SPREAD[kind] and np.std(c + s) < AGAINST * size:
            rated = {"rates": "body rates"}.get(kind, kind)
            rate_column = f"{right[:-1]}{'xyz'[i]}"
            raise LogError(
                f"{place(path, column=rate_column)}: must be the rate of {rated}; over {WINDOW} "
                f"s it goes the opposite way. "
                f"Turn its sign, or that of {column[:-1]}{'xyz'[i]}; W has z up."
            )
    a = _spread(change)
    b = _spread(sum_)
    if max(a, b) < LEAST_SPREAD[kind] or RATIO * min(a, b) > max(a, b):
        return
    if min(a, b) > STILL * max(a, b) and _likeness(change, sum_) < ALIKE:
        return  # a sensor's bias that turns with the body, say
    raise LogError(
        f"{place(path, column=column)}: {kind} and its rate ({right} …) must agree; over "
        f"{WINDOW} s {column} … "
        f"changes {a:.2g}, the integral of {right} … {b:.2g}. One of them is not in SI units "
        "(m, m/s, rad/s, m/s²), or not in its frame."
    )


def _likeness(a: np.ndarray, b: np.ndarray) -> float:
    """Return the cosine between two (n, 3) about their means [1]; near one where they differ in
    their unit alone.
    """
    a = a - a.mean(axis=0)
    b = b - b.mean(axis=0)
    return float(abs(np.sum(a * b)) / max(np.linalg.norm(a) * np.linalg.norm(b), 1e-300))


def _check_convention(q: np.ndarray, turned: np.ndarray, over: Windows, path: object) -> None:
    """Check that no other convention of the quaternion agrees with body rates where its own does
    not.
    """
    misfit = _spread(over.turn(q) - turned)
    if misfit < 0.5 * max(_spread(turned), LEAST_SPREAD["attitude"]):
        return
    for convention, other in (
        ("in the order x, y, z, w", np.roll(q, 1, axis=1)),
        ("from W to body", q * [1.0, -1.0, -1.0, -1.0]),
    ):
        require(
            RATIO * _spread(over.turn(other) - turned) >= misfit,
            f"{place(path, column='qw')}: the quaternion must be w, x, y, z from body "
            f"to W; turned by body rates "
            f"it fits {convention}. Write it in this convention.",
            LogError,
        )


def _check_lift(log: FlightLog, path: object) -> None:
    """Check that thrust along body z points upwards in W on the whole, by its sign and by the
    attitude.
    """
    known = np.isfinite(log.u[:, 0])
    thrust = log.u[known, 0]
    up = attitude.body_z(log.q[known])[:, 2]
    if np.sum(thrust * up) >= -DOWN * np.sum(np.abs(thrust)):
        return
    require(
        np.mean(thrust) >= 0,
        f"{place(path, column='thrust')}: thrust must push along body z, upwards on the whole; "
        f"its mean is {np.mean(thrust):.3g} N. Turn the sign of thrust.",
        LogError,
    )
    raise LogError(
        f"{place(path, column='qw')}: thrust must carry the vehicle upwards; body z points "
        f"{np.mean(up):.2g} along z of W on the whole. Write attitude from body (z up) to W (z up)."
    )


def _check_thrust(log: FlightLog, path: object, vehicle: Vehicle) -> None:
    """Check that the upper range of thrust, commanded and from rotor speed, is comparable with
    weight.
    """
    weight = vehicle.mass * vehicle.gravity
    thrusts = {"thrust": log.u[:, 0]}
    if log.rotor is not None:
        thrusts["rotor1"] = rotor_wrench(vehicle, log.rotor)[:, 0]
    for column, thrust in thrusts.items():
        high = float(np.nanpercentile(np.abs(thrust), 95)) if np.isfinite(thrust).any() else weight
        require(
            weight / RATIO < high < RATIO * weight,
            f"{place(path, column=column)}: thrust must be comparable with the weight "
            f"of vehicle "
            f"{vehicle.name!r}, {weight:.3g} N; got {high:.3g} N. Is it in N (rotor "
            f"speed in rad/s), "
            "and the vehicle file the right one?",
            LogError,
        )


def _check_torque(log: FlightLog, path: object, vehicle: Vehicle, over: Windows) -> None:
    """Check torque against the change of angular momentum, J dw/dt + w x J w, in size and, axis by
    axis, in sign.

    A controller's torque against a disturbance correlates with the remaining rotation, as does its
    torque for a turn; where it is too late for a strong disturbance it opposes that rotation, but
    is a multiple of it.
    """
    momentum = log.w @ vehicle.J.T
    turn = over.change(momentum) + over.integral(np.cross(log.w, momentum))
    push = over.integral(np.nan_to_num(log.u[:, 1:]))
    turns = np.std(turn, axis=0) > TURNS * np.diag(vehicle.J)
    columns = ("tx", "ty", "tz")
    remedy = "Write it about the body axes of the rates."
    if log.input == "rotor_speed":
        columns = ("rotor1",) * 3
        remedy = (
            f"Are rotor_positions and rotor_directions of vehicle {vehicle.name!r} in the "
            f"log's order?"
        )
    a = _spread(push)
    b = _spread(turn)
    if turns.any() and TORQUE_RATIO * min(a, b) < max(a, b) and _likeness(push, turn) > ALIKE:
        raise LogError(
            f"{place(path, column=columns[0])}: torque must be what turns the vehicle; "
            f"over {WINDOW} s its integral "
            f"changes by {a:.2g} N·m·s, J w by {b:.2g}. Is torque in N·m, and J of vehicle "
            f"{vehicle.name!r} in kg·m²?"
        )
    for i in np.flatnonzero(turns):
        require(
            np.std(push[:, i] + turn[:, i]) >= OPPOSITE * np.std(turn[:, i]),
            f"{place(path, column=columns[i])}: torque must be what turns the vehicle; "
            f"about body {'xyz'[i]} it "
            f"goes against J dw/dt + w x J w. {remedy}",
            LogError,
        )


def _spread(value: np.ndarray) -> float:
    return float(np.sqrt(np.sum(np.var(value, axis=0))))
