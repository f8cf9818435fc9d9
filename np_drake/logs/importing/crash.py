"""Where a flight ends that ends badly: in a fall that the rotors do not tell, or as a wreck on the
ground.
"""

import numpy as np

from np_drake import attitude
from np_drake.logs.importing.airborne import MOVED, RUNNING, usual_lift
from np_drake.logs.importing.convert import GRAVITY
from np_drake.logs.windows import stretches
from np_drake.training_data.accelerations import LIFT_BAND, lift_over_weight

STILL = 0.3  # speed of a wreck [m/s]; own choice
LIES, TUMBLES = (
    0.5,
    3.0,
)  # least time at rest after a crash, and longest between its impacts and rest [s]; own choice
# share of the thrust axis that is vertical below which nothing hovers: 45 deg [1]; own choice
LYING = 0.7
ABOVE = 0.3  # height over the ground of a flight [m]; own choice
# Acceleration over g of an impact, and time over which it acts [1, s]; own choice: a landing is
# softer.
IMPACT, BLOW = 3.0, 0.1
FITS = "fits "  # beginning of a note that not all of a log is taken
# what is said of a log of nothing else
WRECK = "must hold a flight; the vehicle lies still and tilted."
CARRIED, FALLS = (
    0.3,
    0.3,
)  # lift over the weight in a fall [1], and its least duration [s]; own choice


def end_of_flight(
    t: np.ndarray,
    p: np.ndarray,
    v: np.ndarray,
    q: np.ndarray,
    lift: np.ndarray,
    *,
    moves: bool = True,
) -> tuple[int, str]:
    """Return the row at which a flight ends that ends badly, and why; all rows and nothing where it
    does not.

    Args:
        t: (n,) [s].
        p: (n, 3) position in W [m].
        v: (n, 3) velocity in W [m/s].
        q: (n, 4) attitude, body to W.
        lift: (n,) of the rotors in any unit; NaN where the log does not tell it.
        moves: whether the log tells velocity; without, no wreck is seen to rest.
    """
    crash, fall = before_the_crash(t, p, v, q) if moves else len(t), before_the_fall(t, v, q, lift)
    if min(crash, fall) == len(t):
        return len(t), ""
    return (
        (crash, "the vehicle crashes")
        if crash <= fall
        else (fall, "the rotors carry it no longer though they run")
    )


def fits_until(time: float, why: str = "") -> str:
    """Return the note of a log whose end is left out.

    Args:
        time: until which it is taken [s].
    """
    return f"{FITS}until {time:.1f} s{f', where {why}' * bool(why)}; what follows is left out"


def before_the_fall(t: np.ndarray, v: np.ndarray, q: np.ndarray, lift: np.ndarray) -> int:
    """Return the row at which the vehicle begins to fall although its rotors run; all rows where it
    does not.

    Args:
        t: (n,) [s].
        v: (n, 3) velocity in W [m/s].
        q: (n, 4) attitude, body to W.
        lift: (n,) of the rotors in any unit.
    """
    carried = lift_over_weight(t, v, q, GRAVITY)
    flying = carried > 1 - CARRIED  # or on the ground, which carries
    for start, stop in stretches(carried < CARRIED):
        # The rotors of a vehicle that falls may run faster than in flight: what came before tells
        # the usual lift.
        if not np.any(flying[:start]) or np.median(carried[:start]) < 1 - CARRIED:
            continue
        runs = lift[start:stop] > RUNNING * usual_lift(lift[:start][flying[:start]])
        for first, last in start + stretches(runs) - [0, 1]:
            if t[last] - t[first] >= FALLS:
                return max(int(np.searchsorted(t, t[first] - 0.5 / LIFT_BAND)), 0)
    return len(t)


def before_the_crash(t: np.ndarray, p: np.ndarray, v: np.ndarray, q: np.ndarray) -> int:
    """Return the row at which a flight ends that ends as a wreck; all rows where it does not.

    A wreck is at rest, tilted as none can hover, or after an impact where the flight is lowest. The
    flight ends shortly before the impact, where there is one.

    Args:
        t: (n,) [s].
        p: (n, 3) position in W [m].
        v: (n, 3) velocity in W [m/s].
        q: (n, 4) attitude, body to W.
    """
    still = np.linalg.norm(v, axis=1) < STILL
    rests = len(t) - int(np.argmin(still[::-1])) if not still.all() else 0
    lying = slice(rests, len(t))
    if rests == len(t) or t[-1] - t[rests] < LIES or np.ptp(p[lying], axis=0).max() > 4 * MOVED:
        return len(t)
    first = int(np.searchsorted(t, t[rests] - TUMBLES))
    rows = max(round(BLOW / float(np.median(np.diff(t)))), 1)
    after = v[first + rows : rests + rows]
    change = after - v[first : first + len(after)]
    hits = np.flatnonzero(np.linalg.norm(change, axis=1) > IMPACT * GRAVITY * BLOW)
    tilted = float(np.median(attitude.body_z(q[lying])[:, 2])) < LYING
    level, flown = float(np.median(p[lying, 2])), p[:rests, 2]
    lowest = rests > 0 and level < flown.min() + 4 * MOVED and np.median(flown) > level + ABOVE
    if not tilted and not (len(hits) and lowest):
        return len(t)
    return first + int(hits[0]) if len(hits) else rests
