"""States of a log on the clock of its gyro and accelerometer: what is late, as of motion capture, is moved."""

import dataclasses as dc
from collections.abc import Sequence

from np_drake.logs.importing.alignment import in_frames
from np_drake.logs.importing.interpolation import Signals
from np_drake.logs.importing.log_map import LogMap
from np_drake.logs.lags import HEALTHY, Lag, moved_by, state_lags


def on_one_clock(parts: list[Signals], longest: Signals, log_map: LogMap) -> tuple[list[Signals], LogMap, list[str]]:
    """Return the parts of a log and its map without the lags that stand out, and a line on these.

    What the map says of a quantity's `late`, also 0, holds.

    Args:
        parts: signals of each.
        longest: of them, in which lags are measured.
        log_map: with the conventions.
    """
    if not {"attitude", "rates"} <= set(longest):
        return parts, log_map, []
    found = state_lags(in_frames(longest, log_map, []))
    late = {name: round(seconds, 4) for name, seconds in _late(found, "velocity" in longest).items()}
    late = {name: late[name] for name in late if name in longest and getattr(log_map, name).late is None}
    if not any(late.values()):
        return parts, log_map, []
    parts = [{n: dc.replace(own, t=own.t - late.get(n, 0.0)) for n, own in signals.items()} for signals in parts]
    log_map = dc.replace(log_map, **{n: dc.replace(getattr(log_map, n), late=by) for n, by in late.items()})
    seen = ", ".join(str(lag) for lag in found if lag.stands_out)
    stated = ", ".join(f"{name}: {{late: {seconds:g}}}" for name, seconds in late.items() if seconds)
    return parts, log_map, [f"{seen}: taken out, as by {stated} in a map; late: 0 keeps it"]


def _late(found: Sequence[Lag], has_velocity: bool) -> dict[str, float]:
    """Return the time by which each state is late [s]; a position without velocity is measured by its derivative.

    Position and velocity are as late as the attitude, as of one motion capture, unless their own lag says otherwise.
    """
    lags = {lag.late: lag for lag in found}
    turning, moving, place = (lags.get(name) for name in ("attitude", "velocity", "position"))
    attitude = velocity = moved_by(turning)
    if moving is not None:
        near = HEALTHY if moving.stands_out else abs(moving.seconds)
        velocity = attitude if abs(moving.seconds - attitude) < near else moved_by(moving)
    position = velocity + moved_by(place) * has_velocity
    return {"attitude": attitude, "velocity": velocity, "position": position}
