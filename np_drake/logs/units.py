"""Detection of units that are wrong by orders of magnitude, by comparing integrated with measured
quantities.

Over windows of half a second, the change of position is compared with the integral of velocity,
attitude with body rates, velocity with acceleration, each as a spread about its own mean (so a bias
is not a unit). Thrust is compared with weight, torque with the change of angular momentum and with
what rotors can give.
Source: own choice; thresholds checked on 43 NeuroBEM flights, those of torque also on 2760 to 2892
    simulated ones with
every effect of the library and many that it does not have.
"""

import numpy as np

from np_drake import attitude
from np_drake.flight_log import FlightLog
from np_drake.logs.errors import LogError, place
from np_drake.logs.windows import Windows
from np_drake.rotor_input import rotor_wrench
from np_drake.vehicle import Vehicle

WINDOW = 0.5  # [s]
RATIO = 6.0  # above noise, wind-up or effects; below g, degrees or millimetres [1]
ALIKE = 0.5  # cosine below which two signals are not multiples of each other [1]
STILL = 1e-4  # ratio below which one of two signals is constant [1]
TURNS = 0.3  # spread of an axis' rate over a window below which its torque is not checked [rad/s]
TORQUE = ("tx", "ty", "tz")  # columns
WINDOWS = 8  # duration that a flight needs for a check of its torque [windows]
TORQUE_RATIO = (
    30.0  # of two integrals of one signal; at most 5.3 in valid flights, 3.4 where they turn [1]
)
OPPOSITE = (
    0.7  # share of the rotation left by the opposite torque if the sign is wrong; 0.97 if valid [1]
)
STRONGEST = (
    6.0  # over the torque of the rotors; valid flights have 1 at saturation, 0.2 elsewhere [1]
)
FASTEST_ROTOR = 5000.0  # [rad/s]; 48,000 rpm
SIGN = 0.25  # of the spreads below: an axis that moves so much shows its sign [1]; own choice
# share of thrust downwards on the whole, which tumbling flights do not have [1]; own choice
DOWN = 0.3
AGAINST = (
    0.3  # share of a change that the opposite of its rate's integral leaves if a sign is wrong [1]
)
# Spread below which nothing is checked [m, rad, m/s, rad/s].
LEAST = {"position": 0.2, "attitude": 0.2, "velocity": 0.5, "rates": 1.0}


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
            _check_gravity(log.a, log, path)
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
        _check_torque_limit(log, path, vehicle)
        if len(log) > WINDOWS * over.rows:
            _check_torque(log, path, vehicle, over)


def _compare(
    path: object, left: str, right: str, change: np.ndarray, sum_: np.ndarray, kind: str
) -> None:
    a, b = _spread(change), _spread(sum_)
    if kind != "attitude":  # its sign is that of its convention
        _check_sign(path, left, right, change, sum_, kind)
    if max(a, b) < LEAST[kind] or RATIO * min(a, b) > max(a, b):
        return
    if min(a, b) > STILL * max(a, b) and _likeness(change, sum_) < ALIKE:
        return  # a sensor's bias that turns with the body, say
    raise LogError(
        f"{place(path, column=left)}: {kind} and its rate ({right} …) must agree; over "
        f"{WINDOW} s {left} … "
        f"changes {a:.2g}, the integral of {right} … {b:.2g}. One of them is not in SI units "
        "(m, m/s, rad/s, m/s²), or not in its frame."
    )


def _check_sign(
    path: object, left: str, right: str, change: np.ndarray, sum_: np.ndarray, kind: str
) -> None:
    """Check axis by axis that a quantity that moves enough is not the opposite of its rate's
    integral, in size too.
    """
    for i in range(change.shape[1]):
        a, b = change[:, i] - change[:, i].mean(), sum_[:, i] - sum_[:, i].mean()
        size = float(np.std(a))
        if size > SIGN * LEAST[kind] and np.std(a + b) < AGAINST * size:
            rated = {"rates": "body rates"}.get(kind, kind)
            column = f"{right[:-1]}{'xyz'[i]}"
            raise LogError(
                f"{place(path, column=column)}: must be the rate of {rated}; over {WINDOW} "
                f"s it goes the opposite way. "
                f"Turn its sign, or that of {left[:-1]}{'xyz'[i]}; W has z up."
            )


def _likeness(a: np.ndarray, b: np.ndarray) -> float:
    """Return the cosine between two (n, 3) about their means [1]; near one where they differ in
    their unit alone.
    """
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    return float(abs(np.sum(a * b)) / max(np.linalg.norm(a) * np.linalg.norm(b), 1e-300))


def _check_convention(q: np.ndarray, turned: np.ndarray, over: Windows, path: object) -> None:
    """Check that no other convention of the quaternion agrees with body rates where its own does
    not.
    """
    own = _spread(over.turn(q) - turned)
    if own < 0.5 * max(_spread(turned), LEAST["attitude"]):
        return
    for convention, other in (
        ("in the order x, y, z, w", np.roll(q, 1, axis=1)),
        ("from W to body", q * [1.0, -1.0, -1.0, -1.0]),
    ):
        if RATIO * _spread(over.turn(other) - turned) < own:
            raise LogError(
                f"{place(path, column='qw')}: the quaternion must be w, x, y, z from body "
                f"to W; turned by body rates "
                f"it fits {convention}. Write it in this convention."
            )


def _check_gravity(a: np.ndarray, log: FlightLog, path: object) -> None:
    """Check that the mean vertical acceleration agrees with the velocity, and not with that plus
    g.
    """
    surplus = float(np.mean(a[:, 2]) - (log.v[-1, 2] - log.v[0, 2]) / (log.t[-1] - log.t[0]))
    if abs(abs(surplus) - 9.81) < 2.0:
        raise LogError(
            f"{place(path, column='az')}: acceleration must be dv/dt in W, without gravity; "
            f"its mean exceeds dv/dt by {surplus:.3g} m/s². "
            "Rotate the accelerometer's reading to W and subtract g."
        )


def _check_lift(log: FlightLog, path: object) -> None:
    """Check that thrust along body z points upwards in W on the whole, by its sign and by the
    attitude.
    """
    known = np.isfinite(log.u[:, 0])
    if not known.any():
        return
    thrust, up = log.u[known, 0], attitude.body_z(log.q[known])[:, 2]
    if np.mean(thrust * up) >= -DOWN * np.mean(np.abs(thrust)):
        return
    down = np.mean(thrust) < 0
    what = (
        f"thrust must push along body z, upwards on the whole; its mean is {np.mean(thrust):.3g} N"
    )
    if not down:
        what = (
            f"thrust must carry the vehicle upwards; body z points {np.mean(up):.2g} along z "
            f"of W on the whole"
        )
    remedy = "Turn the sign of thrust." if down else "Write attitude from body (z up) to W (z up)."
    raise LogError(f"{place(path, column='thrust' if down else 'qw')}: {what}. {remedy}")


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
        if not weight / RATIO < high < RATIO * weight:
            raise LogError(
                f"{place(path, column=column)}: thrust must be comparable with the weight "
                f"of vehicle "
                f"{vehicle.name!r}, {weight:.3g} N; got {high:.3g} N. Is it in N (rotor "
                f"speed in rad/s), "
                "and the vehicle file the right one?"
            )


def _check_torque_limit(log: FlightLog, path: object, vehicle: Vehicle) -> None:
    """Check that rotors can give the upper range of commanded torque; that from rotor speed always
    is.
    """
    if log.input != "command" or not np.isfinite(log.u).any():
        return
    most = 0.5 * vehicle.max_rotor_thrust * np.abs(vehicle.mixer[1:]).sum(axis=1)
    high = np.nanpercentile(np.abs(log.u[:, 1:]), 95, axis=0)
    for i in np.flatnonzero(high > STRONGEST * most):
        raise LogError(
            f"{place(path, column=TORQUE[i])}: torque must be what the rotors of vehicle "
            f"{vehicle.name!r} can give, at "
            f"most {most[i]:.3g} N·m; got {high[i]:.3g}. Is it in N·m, and the vehicle "
            f"file the right one?"
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
    columns, remedy = TORQUE, "Write it about the body axes of the rates."
    if log.input == "rotor_speed":
        columns = ("rotor1",) * 3
        remedy = (
            f"Are rotor_positions and rotor_directions of vehicle {vehicle.name!r} in the "
            f"log's order?"
        )
    a, b = _spread(push), _spread(turn)
    if turns.any() and TORQUE_RATIO * min(a, b) < max(a, b) and _likeness(push, turn) > ALIKE:
        raise LogError(
            f"{place(path, column=columns[0])}: torque must be what turns the vehicle; "
            f"over {WINDOW} s its integral "
            f"changes by {a:.2g} N·m·s, J w by {b:.2g}. Is torque in N·m, and J of vehicle "
            f"{vehicle.name!r} in kg·m²?"
        )
    for i in np.flatnonzero(turns):
        if np.std(push[:, i] + turn[:, i]) < OPPOSITE * np.std(turn[:, i]):
            raise LogError(
                f"{place(path, column=columns[i])}: torque must be what turns the vehicle; "
                f"about body {'xyz'[i]} it "
                f"goes against J dw/dt + w x J w. {remedy}"
            )


def _spread(value: np.ndarray) -> float:
    return float(np.sqrt(np.sum(np.var(value, axis=0))))
