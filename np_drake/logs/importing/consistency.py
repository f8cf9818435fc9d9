"""Agreement of the quantities of a log with each other: which conventions it can have been written
in.

Kinematics ties position to velocity and attitude to body rates; gravity ties an accelerometer to
the vertical; and the specific force of a multirotor lies along its thrust axis. Each law is tested
axis by axis, over windows, where the axis moves enough.
"""

from collections.abc import Callable, Collection, Mapping

import numpy as np
from scipy import stats

from np_drake import attitude
from np_drake.logs.importing.convert import GRAVITY
from np_drake.logs.windows import Windows

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
CHANCE = 1e-3  # of an F test [1]; own choice
AXES = "xyz"
KINEMATIC = (
    "position",
    "attitude",
    "velocity",
)  # laws that tie a quantity to its rate, axis by axis
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
    for needed, law in laws_for(x):
        if over.fit:
            out |= law(over, everything, *(x[name] for name in needed))
    return out


def failing(own: Misfits) -> list[str]:
    """Return the laws that do not hold."""
    return [law for law, misfit in own.items() if misfit > FAILS]


def told_by_noise(t: np.ndarray, x: Mapping[str, np.ndarray], own: Misfits) -> list[str]:
    """Return the laws that fail about an axis though noise and drift of its sensor explain that: it
    tells nothing.

    One axis alone is among these where the others agree or move too little. Of two, each whose
    disagreement is no larger than chance makes it where the sensor is as noisy as about the third,
    by the log itself (F test). A law of the opposite sign is none of these.

    Args:
        t: (n,) evenly spaced times [s].
        x: quantities as `convert` returns them, at these times.
    """
    found = []
    wrong = [law for law in failing(own) if law.split()[0] in KINEMATIC]
    for kind in dict.fromkeys(law.split()[0] for law in wrong):
        failed = [law for law in wrong if law.startswith(kind)]
        others = [
            misfit
            for law, misfit in own.items()
            if law.startswith(f"{kind} ") and law not in failed
        ]
        if max(others, default=0.0) >= AGREES or max(own[law] for law in failed) >= OPPOSED:
            continue
        if len(failed) == 1 or (len(failed) == 2 and not _stands_out(t, x, kind, failed)):
            found += failed
    return found


def _stands_out(t: np.ndarray, x: Mapping[str, np.ndarray], kind: str, failed: list[str]) -> bool:
    """Return whether the disagreement about an axis that fails is larger than noise as about the
    third axis makes it.

    Args:
        t: (n,) [s].
        failed: it, about two axes.
    """
    over = Windows(t, WINDOW)
    state, rate = next(needed for needed, law in LAWS if law is _KINDS[kind])
    change = over.turn(x[state]) if kind == "attitude" else over.change(x[state])
    spread = np.var(change - over.integral(x[rate]), axis=0)  # the mean is a bias
    tested = [AXES.index(law[-1]) for law in failed]
    (third,) = {0, 1, 2} - set(tested)
    # Windows one after the other are taken as independent: a slower drift makes the test stricter.
    count = max(len(change) // over.rows - 1, 1)
    return bool(spread[tested].max() > spread[third] * stats.f.ppf(1 - CHANCE, count, count))


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
    dv, sum_ = over.change(v), over.integral(a)
    gravity = float(np.linalg.norm(np.mean(sum_ - dv, axis=0)) / over.spans[0] / GRAVITY)
    return _compared("velocity", dv, sum_, everything) | {"gravity": gravity}


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
    rest, moving = a[:, :2] - model, speed - speed.mean(axis=0)
    drag = max(0.0, -float(np.sum(rest * moving)) / max(float(np.sum(moving**2)), 1e-12))
    return out | _compared("lift", a[:, :2], model - drag * speed, everything)


def _compared(law: str, left: np.ndarray, right: np.ndarray, everything: bool) -> Misfits:
    out = {}
    for i in range(left.shape[1]):
        a, b = left[:, i] - left[:, i].mean(), right[:, i] - right[:, i].mean()
        size = max(_rms(a), _rms(b))
        if size > LEAST[law] or everything:
            out[f"{law} {AXES[i]}"] = _rms(a - b) / max(size, LEAST[law])
    return out


def _rms(value: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(value))))


_KINDS = {"position": _position, "attitude": _attitude, "velocity": _velocity}
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
