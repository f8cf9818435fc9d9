"""Measures of a flight: errors, growth of error and swing, loss of the vehicle, the rotors'
limits.
"""

import numpy as np

from diagrams.loop.flight import FlightConfig
from np_drake import attitude, metrics
from np_drake.mpc.problem import MpcStatus
from np_drake.rigid_body import Q
from np_drake.vehicle.scaling import ratios

# Of the paper's vehicle; times and distances scale with the vehicle that flies.
SETTLING = 5.0  # part of the flight after the ramp that is not read [s]
# Distance from the reference beyond which a vehicle counts as lost; own choice: the circle's radius
# [m].
LOST = 1.0
LAST = 1.0  # time before the loss in which the rotors are looked at [s]
GROWING = 1.5  # growth of error or swing above which it counts as growing; own choice [1]


def lost_beyond(config: FlightConfig) -> float:
    """Return the distance from the reference beyond which the vehicle of `config` counts as lost
    [m].
    """
    return LOST * ratios(config.vehicle).length


def measures(
    config: FlightConfig, signals: dict[str, np.ndarray], why: str = "", settling: float = SETTLING
) -> dict:
    """Return the metrics of a flight until it is lost, and of its steady window where it is not.

    Args:
        signals: of the flight, in the form of `Recorder.read`.
        settling: time after the ramp before the steady window, of the paper's vehicle [s].

    Returns:
        lost_at: when [s], or None; with `lost`: the simulator's line, where it ended the flight.
        E_xy, E_z [m], growth, swing_growth [1]: of the steady window; None where the vehicle is
        lost. `growth` is
            `error_growth` of the position, `swing_growth` that of the payload's horizontal distance
            from the vehicle: the RMS in the last third over that in the first; None without
            payload.
        solve_failures, fallbacks: periods; all that follows is of the time until the loss.
        at_limit, at_limit_last: share of the periods, of those in the last second, with a command
        at a rotor's
            limit [1].
            thrust: largest command of a rotor over its limit [1].
            tilt, swing: largest angles of body and tether from the vertical [rad]; swing None
                without payload.
    """
    t, x, unit = signals["t"], signals["x_true"], ratios(config.vehicle)
    far = ~(
        np.linalg.norm(x[:, :3] - signals["p_ref"], axis=1) < lost_beyond(config)
    )  # so that NaN is far
    lost = bool(why) or bool(far.any())
    end = int(np.argmax(far)) if far.any() else len(t)
    rows, steady = slice(0, max(end, 1)), t >= config.reference.lead + settling * unit.time - 1e-9
    status = signals["status"][rows, 0]
    command = signals["u"][rows] @ config.vehicle.unmixer.T / config.vehicle.max_rotor_thrust
    at_limit = np.any((command > 1.0 - 1e-3) | (command < 1e-3), axis=1)
    errors: dict[str, float | None] = dict.fromkeys(("E_xy", "E_z", "growth", "swing_growth"))
    if not lost:
        p, p_ref = x[steady, :3], signals["p_ref"][steady]
        errors |= {**metrics.tracking_errors(p, p_ref), "growth": metrics.error_growth(p, p_ref)}
        errors["swing_growth"] = _swing_growth(signals["plant_state"][steady])
    return {
        **{key: errors[key] for key in ("E_xy", "E_z", "growth", "swing_growth")},
        "lost_at": float(t[end]) if end < len(t) else (float(t[-1]) if lost else None),
        "lost": why,
        "solve_failures": int(np.sum(status >= MpcStatus.SQP_FALLBACK)),
        "fallbacks": int(np.sum(status >= MpcStatus.SHIFTED_PLAN)),
        "at_limit": float(at_limit.mean()),
        "at_limit_last": float(at_limit[t[rows] > t[rows][-1] - LAST * unit.time].mean()),
        "thrust": float(command.max()),
        "tilt": float(np.arccos(np.clip(attitude.body_z(x[rows, Q])[:, 2], -1.0, 1.0)).max()),
        "swing": _largest_swing(signals["plant_state"][rows]),
    }


def _line(plant_state: np.ndarray) -> np.ndarray | None:
    """Return the line from payload to vehicle in W (n, 3) [m]; None without payload."""
    return plant_state[:, 4:7] - plant_state[:, 11:14] if plant_state.shape[1] >= 26 else None


def _largest_swing(plant_state: np.ndarray) -> float | None:
    """Return the largest angle of the line from vehicle to payload with the vertical [rad]; None
    without payload.
    """
    up = _line(plant_state)
    if up is None:
        return None
    return float(np.arccos(np.clip(up[:, 2] / np.linalg.norm(up, axis=1), -1.0, 1.0)).max())


def _swing_growth(plant_state: np.ndarray) -> float | None:
    """Return the growth of the payload's horizontal distance from the vehicle [1]; None without
    payload.
    """
    line = _line(plant_state)
    return None if line is None else metrics.error_growth(line, np.zeros_like(line))
