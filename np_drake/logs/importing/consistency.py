"""Agreement of the quantities of a log with each other: which conventions it can have been written in.

Kinematics ties position to velocity and attitude to body rates; gravity ties an accelerometer to the vertical; and the
specific force of a multirotor lies along its thrust axis. Each law is tested axis by axis, over windows, where the axis
moves enough.
"""

from collections.abc import Callable, Mapping

import numpy as np

from np_drake import attitude
from np_drake.logs.importing.convert import GRAVITY

WINDOW = 0.5  # over which changes and integrals are compared [s]; own choice
LEAST = {  # RMS of an axis over a window below which it is not tested; own choice, some times usual noise
    "position": 0.05,  # [m]
    "velocity": 0.25,  # [m/s]
    "attitude": 0.08,  # [rad]
    "lift": 0.5,  # [m/s²]
}
AXES = "xyz"
Misfits = dict[str, float]


def misfits(t: np.ndarray, x: Mapping[str, np.ndarray], *, everything: bool = False) -> Misfits:
    """Return the misfit of every law that the log can test, by its name: 0 is agreement, 1 none, 2 the opposite.

    It is the RMS of the disagreement over that of the larger side, means removed; for gravity the mean disagreement
    over g, for the sign of the thrust 0 or 2.

    Args:
        t: (n,) evenly spaced times [s].
        x: quantities as `convert` returns them, at these times.
        everything: also of axes that move too little to test the law, relative to what would be enough.
    """
    m = window_rows(t)
    out: Misfits = {}
    for needed, law in LAWS:
        if m and all(name in x for name in needed):
            out |= law(t, m, everything, *(x[name] for name in needed))
    return out


def window_rows(t: np.ndarray) -> int:
    """Return the number of intervals of a window; 0 where the log holds no two."""
    m = max(1, round(WINDOW / float(np.median(np.diff(t)))))
    return m if len(t) > 2 * m else 0


def _position(t: np.ndarray, m: int, everything: bool, p: np.ndarray, v: np.ndarray) -> Misfits:
    return _compared("position", _change(p, m), _integral(v, t, m), everything)


def _attitude(t: np.ndarray, m: int, everything: bool, q: np.ndarray, w: np.ndarray) -> Misfits:
    return _compared("attitude", _turn(q, m), _integral(w, t, m), everything)


def _velocity(t: np.ndarray, m: int, everything: bool, v: np.ndarray, a: np.ndarray) -> Misfits:
    dv, sum_ = _change(v, m), _integral(a, t, m)
    gravity = float(np.linalg.norm(np.mean(sum_ - dv, axis=0)) / (t[m] - t[0]) / GRAVITY)
    return _compared("velocity", dv, sum_, everything) | {"gravity": gravity}


def _thrust(t: np.ndarray, m: int, everything: bool, thrust: np.ndarray) -> Misfits:
    return {"thrust": 2.0 * float(np.median(thrust) < 0)}


def _lift(t: np.ndarray, m: int, everything: bool, v: np.ndarray, q: np.ndarray) -> Misfits:
    """Return the misfit of horizontal accelerations with a drag and a force along body z that carries the vertical one.

    The drag over mass is the one, not negative, with which they fit best; a steady wind falls out with the means.
    """
    span = t[m:] - t[:-m]
    a = _change(v, m) / span[:, None]
    z = _integral(attitude.body_z(q), t, m) / span[:, None]
    up = z[:, 2]
    out = {"upright": 2.0 * float(np.median(up) < 0)}
    if out["upright"]:
        return out
    model = ((a[:, 2] + GRAVITY) / np.maximum(up, 0.2))[:, None] * z[:, :2]
    speed = _integral(v, t, m)[:, :2] / span[:, None]
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


def _change(value: np.ndarray, m: int) -> np.ndarray:
    return value[m:] - value[:-m]


def _integral(rate: np.ndarray, t: np.ndarray, m: int) -> np.ndarray:
    """Return the integral of a rate (n, k) over m intervals, (n - m, k)."""
    area = 0.5 * (rate[1:] + rate[:-1]) * np.diff(t)[:, None]
    return _change(np.concatenate([np.zeros((1, rate.shape[1])), np.cumsum(area, axis=0)]), m)


def _turn(q: np.ndarray, m: int) -> np.ndarray:
    """Return the sum of small rotations in body axes over m intervals, (n - m, 3) [rad]."""
    turn = attitude.multiply(q[:-1] * [1.0, -1.0, -1.0, -1.0], q[1:])
    small = 2 * turn[:, 1:] * np.sign(turn[:, :1])
    return _change(np.concatenate([np.zeros((1, 3)), np.cumsum(small, axis=0)]), m)


Law = Callable[..., Misfits]  # of times, rows of a window, everything, and the quantities that it needs
LAWS: tuple[tuple[tuple[str, ...], Law], ...] = (
    (("position", "velocity"), _position),
    (("attitude", "rates"), _attitude),
    (("velocity", "acceleration"), _velocity),
    (("velocity", "attitude"), _lift),
    (("thrust",), _thrust),
)
