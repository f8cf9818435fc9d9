"""What a log lacks of the motion, integrated from its gyro and accelerometer."""

import dataclasses as dc
from typing import Any

import numpy as np
from scipy import signal as filters
from scipy.integrate import cumulative_trapezoid

from np_drake import attitude
from np_drake.logs.importing.convert import GRAVITY, convert_quantity
from np_drake.logs.importing.interpolation import FASTER, Signal, Signals
from np_drake.logs.importing.log_map import LogMap, Source

LACKS = {"position": "height", "velocity": "velocity"}  # quantity: what `FlightLog.lacks` says
# Below which the mean specific force is vertical: no flight accelerates one way for ten seconds
# [Hz]; own choice.
LEVEL = 0.05
EVERY = 0.05  # between two values of that mean [s]
FINEST = 0.002  # between two attitudes: body rates that are denser are averaged [s]
_G = np.array([0.0, 0.0, GRAVITY])


def with_whole_motion(
    signals: Signals, log_map: LogMap
) -> tuple[dict[str, Signal], LogMap, tuple[str, ...], list[str]]:
    """Return signals and map with attitude and position, and what the log lacks, with a note on
    each.

    Without attitude it is that of the body rates, from yaw zero, kept level by the accelerometer;
    position and velocity in the world then say nothing of the body and are left out. Without
    position it is the integral of the velocity, from the origin; without both, velocity is that of
    the acceleration, from rest. A velocity that a position tells is left to `align`.
    """
    found, lacks, notes = dict(signals), [], []
    if "attitude" not in found:
        left = [name for name in LACKS if found.pop(name, None) is not None]
        found["attitude"] = _levelled(found, log_map)
        log_map = dc.replace(
            log_map, attitude=Source(["integral of rates"] * 4, world="enu", body="flu")
        )
        lacks.append("attitude")
        notes.append(
            f"attitude: none in the log; rates integrated, levelled by the accelerometer "
            f"below {LEVEL:g} Hz, and what "
            "acts through attitude cannot be told"
        )
        notes += [
            f"{name}: left out; without attitude it says nothing of the body" for name in left
        ]
    for name, rate in (("velocity", "acceleration"), ("position", "velocity")):
        if "position" in found or name in found:
            continue
        found[name] = _integral(found, rate, log_map)
        world: dict[str, Any] = {
            name: Source([f"integral of {rate}"] * 3, axes="world", world="enu")
        }
        log_map = dc.replace(log_map, **world)
        lacks.append(LACKS[name])
        notes.append(
            f"{name}: none in the log; {rate} integrated, and what acts through {name} "
            f"cannot be told"
        )
    return found, log_map, tuple(lacks), notes


def _levelled(signals: Signals, log_map: LogMap) -> Signal:
    """Return the attitude (n, 4) from body rates and specific force, at the times of the rates or
    every `FINEST`.

    Turned to W by the gyro alone, the mean specific force is vertical but for the gyro's drift,
    which is taken out. Nothing is said of yaw. Source: complementary filter, run in both
    directions.
    """
    own, force = signals["rates"], signals["acceleration"]
    rates = Signal(own.t, convert_quantity("rates", own.values, log_map))
    at = own.t if own.step * FASTER > FINEST else np.arange(own.t[0], own.t[-1], FINEST)
    carried = Signal(
        at, attitude.integrated(at, np.array([1.0, 0.0, 0.0, 0.0]), rates.averaged(at, FINEST))
    )
    specific = convert_quantity("acceleration", force.values, log_map) + _G
    seen = Signal(force.t, attitude.rotate(carried.turned(None, force.t), specific))
    t = np.arange(own.t[0], own.t[-1] + EVERY, EVERY)
    sos = filters.butter(2, 2 * LEVEL * EVERY, output="sos")
    # Mirrored ends: what the vehicle does in its last instant is no mean.
    mirrored = {"padtype": "even", "padlen": min(len(t) - 1, int(1 / (LEVEL * EVERY)))}
    up = filters.sosfiltfilt(sos, seen.averaged(t, EVERY), axis=0, **mirrored)
    up = Signal(t, up / np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-9)).linear(at)
    across = np.cross(up, [0.0, 0.0, 1.0])
    size = np.linalg.norm(across, axis=1, keepdims=True)
    turn = across * np.arctan2(size, up[:, 2:]) / np.maximum(size, 1e-12)
    return Signal(at, attitude.multiply(attitude.from_rotation_vector(turn), carried.values))


def _integral(signals: Signals, rate: str, log_map: LogMap) -> Signal:
    """Return the integral of a vector in W at its own times, from zero."""
    own = signals[rate]
    q_own = convert_quantity("attitude", signals["attitude"].values, log_map)
    q = Signal(signals["attitude"].t, attitude.one_hemisphere(q_own, q_own[0])).linear(own.t)
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    values = convert_quantity(rate, own.values, log_map, q)
    if (
        rate == "acceleration" and log_map.command == "held_after"
    ):  # constant from its row to the next, as the thrust
        steps = values[:-1] * np.diff(own.t)[:, None]
        return Signal(own.t, np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)]))
    return Signal(own.t, cumulative_trapezoid(values, own.t, axis=0, initial=0.0))
