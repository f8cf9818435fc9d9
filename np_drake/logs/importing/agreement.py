"""Agreement of a part of a log with its conventions: as declared, as adopted, or up to where it
stops.
"""

import dataclasses as dc

import numpy as np

from np_drake.logs.errors import LogError
from np_drake.logs.importing.alignment import common_rows
from np_drake.logs.importing.consistency import FAILS, SCALE, WINDOW, misfits, never_tilts
from np_drake.logs.importing.conventions import (
    Change,
    Verdict,
    WrongConventions,
    as_text,
    changed,
    check_conventions,
)
from np_drake.logs.importing.convert import convert
from np_drake.logs.importing.interpolation import Signals
from np_drake.logs.importing.log_map import LogMap
from np_drake.logs.windows import stretches

CHECK_RATE = 50.0  # of the rows on which conventions are checked [Hz]
SPAN = 2.0  # over which a law is tested by itself [s]; own choice: four windows of a law
EVERY = 0.1  # between two such tests [s]
MOST_TESTS = 600  # of one part; own choice
SHORTEST_STRETCH = 3.0  # that is taken of a part that does not fit as a whole [s]; own choice
# misfit, that of no agreement, from which the end of a part is left out though the whole holds [1]
ENDS_BADLY = 1.0


def fitting_stretch(
    signals: Signals, log_map: LogMap, verdict: Verdict
) -> tuple[float, float] | None:
    """Return the longest stretch in which the laws hold that fail in the whole [s]; None where
    there is none.

    A law must be tested there, not only be silent. Where the whole holds, the end alone is looked
    at: a short crash hides in a long flight.
    """
    t, raw = _checked_rows(signals)
    x = convert(raw, log_map)
    rows = round(SPAN * CHECK_RATE)
    step = max(round(EVERY * CHECK_RATE), len(t) // MOST_TESTS)
    starts = range(0, len(t) - rows + 1, step)
    laws = {law for law in verdict.failed or verdict.misfits if not law.startswith("lift")}
    most = FAILS if verdict.failed else ENDS_BADLY

    def holds(k: int) -> bool:
        own = misfits(t[k : k + rows], {name: values[k : k + rows] for name, values in x.items()})
        return all(own.get(law, 0.0) <= most for law in laws)

    good = np.array([holds(k) for k in starts])
    edges = stretches(good)
    if not len(edges) or good.all():
        return None
    first, after = edges[np.argmax(edges[:, 1] - edges[:, 0])]
    whole = after == len(good)
    if not verdict.failed and (first > 0 or whole or good[after:].any()):
        return None
    start, stop = t[starts[first]], t[-1] if whole else t[starts[after - 1] + rows - 1] - WINDOW
    return (float(start), float(stop)) if stop - start >= SHORTEST_STRETCH else None


def judged(signals: Signals, log_map: LogMap, path: str) -> Verdict:
    """Return the verdict on the conventions of a log that flies.
    Raises: LogError: if the attitude never tilts where the vehicle accelerates sideways.
    """
    t, raw = _checked_rows(signals)
    if level := never_tilts(t, convert(raw, log_map)):
        tilt, needed = level
        raise LogError(
            f"{path}: the attitude must tilt where the vehicle accelerates sideways; "
            f"{log_map.attitude.columns[0]} … "
            f"tilts by {1e3 * tilt:.2g} mrad where {1e3 * needed:.0f} mrad are needed, as "
            f"a planar odometry does. Name "
            "a pose with roll and pitch in a map."
        )
    return check_conventions(t, raw, log_map)


def _checked_rows(signals: Signals) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    return common_rows({n: s for n, s in signals.items() if n != "voltage"}, CHECK_RATE)


def agreed(
    verdict: Verdict, signals: Signals, log_map: LogMap, path: str, *, clock: Change, adopt: bool
) -> tuple[LogMap, Verdict]:
    """Return the map whose conventions agree with the log, and the verdict on them.

    Args:
        clock: change of the unit of time, made in the signals.
    Raises: WrongConventions: if those declared do not agree, unless others do and are to be
        adopted.
    """
    if verdict.holds and not clock:
        return log_map, verdict
    laws = [f"misfit of {law} {verdict.misfits[law]:.2g}" for law in verdict.failed[:4]]
    laws[:0] = ["rows of the attitude not 0.1 ms to 0.2 s apart"] if clock else []
    wrong = f"{', '.join(laws)}; {SCALE}"
    if verdict.failed and not verdict.changes:
        raise WrongConventions(
            f"{path}: its quantities must agree with each other in the conventions "
            f"declared ({wrong}), and agree in no "
            "other that is known. Check columns, units and frames of the map, and leave "
            "damaged rows out with "
            "--start and --stop.",
            verdict,
        )
    verdict = dc.replace(
        verdict,
        failed=("interval",) * bool(clock) + verdict.failed,
        changes=clock + verdict.changes,
        rivals=tuple(clock + rival for rival in verdict.rivals),
    )
    fit = as_text(verdict.changes)
    if verdict.rivals:
        fit += "; or " + "; or ".join(as_text(change) for change in verdict.rivals[:2])
    if not adopt or verdict.rivals:
        raise WrongConventions(
            f"{path}: it does not fit the conventions declared ({wrong}), but fits {fit}. "
            "Write that in the map" + ("." if verdict.rivals else ", or give --adopt."),
            verdict,
        )
    log_map = changed(log_map, verdict.changes)
    now = judged(signals, log_map, path) if verdict.misfits else verdict
    return log_map, dc.replace(now, changes=verdict.changes)
