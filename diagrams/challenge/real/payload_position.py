"""Position of a payload on a held-out flight, from its diagnosed tether and the vehicle's measured
motion.
"""

import dataclasses as dc
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from diagrams.challenge.real.logged_payload import logged_payload
from np_drake import attitude
from np_drake.diagnosis.residuals.flight_residuals import FlightResiduals
from np_drake.diagnosis.residuals.make_flight_residuals import make_flight_residuals
from np_drake.effects.base import Effect, Motion, WrenchEffect
from np_drake.effects.combine import split_effects, total_wrench
from np_drake.effects.pendulum import Path as Swing
from np_drake.effects.pendulum import Payload, hanging, hook_velocity, path_many
from np_drake.flight_log import FlightLog
from np_drake.logs.importing.signals import Signal
from np_drake.vehicle import Vehicle

START = 2.0  # of the flight, to which the start state is fitted [s]
BEGINNINGS = (0.0, 0.3, -0.3)  # offsets over length from which the start state is searched [1]
REFINED = 2  # of these, the nearest
SWING_NOISE = 0.5  # of the payload's acceleration in the filter [m/s² per root Hz]
OFFSET_NOISE = 0.05  # drift of the force offset over the payload's weight [1 per root s]
FORCE_NOISE = 0.3  # of the residual force over the payload's weight [1]
FORCE_MEMORY = 0.1  # over which its errors go together [s]


@dc.dataclass(frozen=True)
class Drive:
    """What drives and corrects a pendulum, on a grid t (m,) [s] of one step.

    a_hook, v_hook: (m - 1, 3) of the hook in W, mean over each step [m/s², m/s].
    p_hook: (m, 3) in W [m]. force: (m, 2) force to the side that the nominal model and the other
        effects leave unexplained,
        in W [N].
    """

    t: np.ndarray
    a_hook: np.ndarray
    v_hook: np.ndarray
    p_hook: np.ndarray
    force: np.ndarray

    @property
    def step(self) -> float:
        """Step of the grid [s]."""
        return float(np.median(np.diff(self.t)))


Predictor = Callable[
    [Drive, Payload, float], np.ndarray
]  # (drive, payload, gravity) -> p_WPo (m, 3) [m]


def plumb(drive: Drive, payload: Payload, gravity: float) -> np.ndarray:
    """Return p_WPo of a payload at rest below its hook, (m, 3) [m].

    Args:
        gravity: of no matter here [m/s²].
    """
    return drive.p_hook - [0.0, 0.0, payload.length]


def make_drive(
    log: FlightLog, vehicle: Vehicle, payload: Payload, others: Sequence[WrenchEffect] = ()
) -> Drive:
    """Return what drives a payload under the vehicle of a log.

    Args:
        others: wrench effects beside the payload, which are subtracted from the residual force.
    """
    e = make_flight_residuals(log, vehicle)
    t = e.t
    v_hook = Signal(log.t, hook_velocity(payload.hook, log.x)).linear(t)
    p_hook = Signal(
        log.t, log.p + attitude.rotate(log.q, np.broadcast_to(payload.hook, log.p.shape))
    ).linear(t)
    # Over a step the difference of the velocity is the mean acceleration: no offset grows, as that
    # of an accelerometer.
    a_hook = np.diff(v_hook, axis=0) / np.diff(t)[:, None]
    force = residual_force(e)
    force -= wrench_of(log, vehicle, others, t)[:, :3]
    return Drive(t, a_hook, 0.5 * (v_hook[1:] + v_hook[:-1]), p_hook, force[:, :2])


def residual_force(e: FlightResiduals) -> np.ndarray:
    """Return the force that the nominal model leaves on the grid of a flight, (m, 3) in W [N]."""
    return (e.R_WB @ e.y[:, :3, None])[..., 0]


def wrench_of(
    log: FlightLog, vehicle: Vehicle, effects: Sequence[WrenchEffect], t: np.ndarray
) -> np.ndarray:
    """Return chi of wrench effects, (m, 6) [N, N·m]; the rotors share the thrust.

    Args:
        t: (m,) times on the clock of the log [s].
    """
    if not effects:
        return np.zeros((len(t), 6))
    x = Signal(log.t, log.x).linear(t)
    x[:, 3:7] /= np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
    thrust = np.repeat(0.25 * Signal(log.t, log.u[:, :1]).linear(t), 4, axis=1)
    return total_wrench(vehicle, effects, Motion(t, x, thrust))


def _swung(
    drive: Drive,
    payload: Payload,
    gravity: float,
    start: tuple[np.ndarray, np.ndarray],
    some: slice = slice(None),
) -> Swing:
    """Return the motion over some of the steps from starts r, r_rate, (m, 3) each [m, m/s]."""
    r, r_rate = start
    lengths, a, v = np.full(len(r), payload.length), drive.a_hook[some], drive.v_hook[some]
    return path_many(lengths, r, r_rate, a, drive.step, gravity, damping=payload.damping, v_hook=v)


def open_loop(drive: Drive, payload: Payload, gravity: float) -> np.ndarray:
    """Return p_WPo of the payload (m, 3) [m], its start state fitted to the residual force of the
    first seconds.

    Nothing after `START` corrects the swing. A constant force to the side is fitted beside the
    state: a tilt of the attitude makes one.

    Args:
        gravity: [m/s²].
    """
    count = min(len(drive.t) - 1, int(START / drive.step))
    measured = 0.5 * (drive.force[1 : count + 1] + drive.force[:count])
    scale = payload.length * np.array([1.0, 1.0, *[np.sqrt(gravity / payload.length)] * 2])
    natural = payload.mass * gravity

    def start(states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return hanging(scale[:2] * states[:, :2], scale[2:] * states[:, 2:], payload.length)

    def pulls(states: np.ndarray) -> np.ndarray:
        return (
            payload.mass
            * _swung(drive, payload, gravity, start(states), slice(count)).pull[..., :2]
        )

    def misfit(state: np.ndarray) -> np.ndarray:
        left = measured - pulls(state[None])[:, 0]
        return np.ravel(left - left.mean(axis=0)) / natural

    def slope(state: np.ndarray) -> np.ndarray:
        moved = np.concatenate([state[None], state + 1e-4 * np.eye(4)])
        own = pulls(moved)
        change = -(own[:, 1:] - own[:, :1]) / 1e-4
        change -= change.mean(axis=0)
        return change.transpose(0, 2, 1).reshape(-1, 4) / natural

    starts = np.array([[x, y, 0.0, 0.0] for x in BEGINNINGS for y in BEGINNINGS])
    left = measured[:, None] - pulls(starts)
    near = starts[np.argsort(np.var(left, axis=0).sum(axis=-1))[:REFINED]]
    fits = [least_squares(misfit, s, jac=slope, bounds=(-0.95, 0.95), max_nfev=40) for s in near]  # type: ignore[call-overload]
    best = min(fits, key=lambda fit: float(fit.cost)).x
    return drive.p_hook + _swung(drive, payload, gravity, start(best[None])).r[:, 0]


def observed(drive: Drive, payload: Payload, gravity: float) -> np.ndarray:
    """Return p_WPo of the payload (m, 3) [m] from an extended Kalman filter that the residual force
    corrects.

    State: offset and rate of the payload to the side [m, m/s], and a force offset to the side [N].
    Causal: the position at an instant uses nothing after it. The noises are own choices, in units
    of the payload's weight.

    Args:
        gravity: [m/s²].
    """
    weight, rate = payload.mass * gravity, np.sqrt(gravity / payload.length)
    s = np.zeros(6)
    P = (
        np.diag([0.3 * payload.length] * 2 + [0.3 * payload.length * rate] * 2 + [0.1 * weight] * 2)
        ** 2
    )
    Q = np.diag(
        [0.0] * 2
        + [SWING_NOISE**2 * drive.step] * 2
        + [(OFFSET_NOISE * weight) ** 2 * drive.step] * 2
    )
    R = (FORCE_NOISE * weight) ** 2 * np.eye(2) * max(1.0, FORCE_MEMORY / drive.step)
    small = 1e-5 * np.eye(6)
    at = [s[:2]]
    for k in range(len(drive.a_hook)):
        moved = np.concatenate([s[None], s + small])
        start = hanging(moved[:, :2], moved[:, 2:4], payload.length)
        after = _swung(drive, payload, gravity, start, slice(k, k + 1))
        ahead = np.concatenate([after.r[1, :, :2], after.r_rate[:, :2], moved[:, 4:]], axis=1)
        said = payload.mass * after.pull[0, :, :2] + moved[:, 4:]
        # Jacobians of motion and measurement, by forward differences.
        F, H = (ahead[1:] - ahead[0]).T / 1e-5, (said[1:] - said[0]).T / 1e-5
        # The pull is that of the step, whose state at its begin is corrected before it moves on.
        K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
        s_now = s + K @ (0.5 * (drive.force[k] + drive.force[k + 1]) - said[0])
        P = (np.eye(6) - K @ H) @ P
        s = ahead[0] + F @ (s_now - s)
        P = F @ P @ F.T + Q
        reach = np.linalg.norm(s[:2]) / (0.98 * payload.length)
        s[:2] /= max(reach, 1.0)
        at.append(s[:2].copy())
    offset = np.array(at)
    r, _ = hanging(offset, np.zeros_like(offset), payload.length)
    return drive.p_hook + r


def error(p: np.ndarray, t: np.ndarray, p_logged: np.ndarray, t_logged: np.ndarray) -> float:
    """Return the RMSE of a position against a logged one, where both are there [m].

    Args:
        p: (m, 3) position [m].
        t: (m,) its times [s].
        p_logged: (n, 3) logged position [m].
        t_logged: (n,) its times, on the same clock [s].
    """
    inside = (t >= t_logged[0]) & (t <= t_logged[-1])
    off = p[inside] - Signal(t_logged, p_logged).linear(t[inside])
    return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))


def position_errors(
    path: Path,
    logs: Sequence[FlightLog],
    vehicle: Vehicle,
    effects: Sequence[Effect],
    predictors: Mapping[str, Predictor],
) -> dict[str, float]:
    """Return the RMSE of the payload's position by predictor [m]; empty where no payload is among
    the effects.
    Raises: LogError: if the log holds no payload.
    """
    acting = split_effects(effects)
    if acting.payload is None or acting.payload.mass <= 0:
        return {}
    payload = acting.payload.payload
    found: dict[str, list[float]] = {name: [] for name in predictors}
    for log in logs:
        t, p = logged_payload(path, log)
        drive = make_drive(log, vehicle, payload, acting.wrench)
        for name, predict in predictors.items():
            found[name].append(error(predict(drive, payload, vehicle.gravity), drive.t, p, t))
    return {name: float(np.sqrt(np.mean(np.square(errors)))) for name, errors in found.items()}
