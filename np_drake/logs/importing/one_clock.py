"""States of a log on the clock of its gyro and accelerometer: what is late, as of motion capture,
is moved.
"""

import dataclasses as dc

from np_drake.logs.importing.alignment import in_frames
from np_drake.logs.importing.interpolation import Signals
from np_drake.logs.importing.log_map import LogMap
from np_drake.logs.lags import HEALTHY, state_lags


def on_one_clock(
    parts: list[Signals], longest: Signals, log_map: LogMap
) -> tuple[list[Signals], LogMap, list[str]]:
    """Return the parts of a log and its map without lags that are beyond doubt, and a line on
    these.

    Velocity goes with an attitude that is late, as of one motion capture, where its own lag is not
    told or nearer to that than to none, and position with velocity. What the map says of a
    quantity's `late`, also 0, holds.
    """
    if "attitude" not in longest:
        return parts, log_map, []
    lags = state_lags(in_frames(longest, log_map, []))
    late = {name: lag.beyond_doubt for name, lag in lags.items()}
    turned, moved = (
        late.get("attitude", 0.0) * (log_map.attitude.late is None),
        lags.get("velocity"),
    )
    if moved is None or abs(moved.seconds - turned) < (
        HEALTHY if late["velocity"] else abs(moved.seconds)
    ):
        late["velocity"] = turned
    late["position"] = late.get("position", 0.0) + late["velocity"]
    late = {
        n: round(by, 4)
        for n, by in late.items()
        if by and n in longest and getattr(log_map, n).late is None
    }
    if not late:
        return parts, log_map, []
    parts = [
        {n: dc.replace(own, t=own.t - late.get(n, 0.0)) for n, own in signals.items()}
        for signals in parts
    ]
    log_map = dc.replace(
        log_map, **{n: dc.replace(getattr(log_map, n), late=by) for n, by in late.items()}
    )
    seen = ", ".join(str(lag) for lag in lags.values() if lag.beyond_doubt)
    stated = ", ".join(f"{name}: {{late: {by:g}}}" for name, by in late.items())
    return parts, log_map, [f"{seen}: taken out, as by {stated} in a map; late: 0 keeps it"]
