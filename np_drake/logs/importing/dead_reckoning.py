"""Position and velocity that a log lacks, integrated from what it has: what acts through them cannot be told."""

import dataclasses as dc
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid

from np_drake import attitude
from np_drake.logs.importing.convert import convert_quantity
from np_drake.logs.importing.interpolation import Signal
from np_drake.logs.importing.log_map import LogMap, Source

LACKS = {"position": "height", "velocity": "velocity"}  # quantity: what `FlightLog.lacks` says


def with_whole_motion(
    signals: Mapping[str, Signal], log_map: LogMap
) -> tuple[dict[str, Signal], LogMap, tuple[str, ...], list[str]]:
    """Return signals and map with a position, and what the log lacks, with a note on each.

    Without position it is the integral of the velocity, from the origin; without both, velocity is that of the
    acceleration, from rest. A velocity that a position tells is left to `align`.

    Args:
        signals: as logged, by quantity.
        log_map: with the conventions that hold.
    """
    found, lacks, notes = dict(signals), [], []
    for name, rate in (("velocity", "acceleration"), ("position", "velocity")):
        if "position" in found or name in found:
            continue
        found[name] = _integral(found, rate, log_map)
        world: dict[str, Any] = {name: Source([f"integral of {rate}"] * 3, axes="world", world="enu")}
        log_map = dc.replace(log_map, **world)
        lacks.append(LACKS[name])
        notes.append(f"{name}: none in the log; {rate} integrated, and what acts through {name} cannot be told")
    return found, log_map, tuple(lacks), notes


def _integral(signals: Mapping[str, Signal], rate: str, log_map: LogMap) -> Signal:
    """Return the integral of a vector in W at its own times, from zero."""
    own = signals[rate]
    q_own = convert_quantity("attitude", signals["attitude"].values, log_map)
    q = Signal(signals["attitude"].t, attitude.one_hemisphere(q_own, q_own[0])).linear(own.t)
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    values = convert_quantity(rate, own.values, log_map, q)
    if rate == "acceleration" and log_map.command == "held_after":  # constant from its row to the next, as the thrust
        steps = values[:-1] * np.diff(own.t)[:, None]
        return Signal(own.t, np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)]))
    return Signal(own.t, cumulative_trapezoid(values, own.t, axis=0, initial=0.0))
