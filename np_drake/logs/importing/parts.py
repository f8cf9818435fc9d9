"""What is made of the parts of a log: a flight where it agrees with itself, else a line on why it
is left out.
"""

import numpy as np

from np_drake.logs.errors import LogError
from np_drake.logs.importing.agreement import agreed, fitting_stretch, judged
from np_drake.logs.importing.airborne import usual_lift
from np_drake.logs.importing.breaks import within
from np_drake.logs.importing.consistency import WINDOW
from np_drake.logs.importing.conventions import DOUBTED, Change, Verdict, WrongConventions
from np_drake.logs.importing.crash import FITS, fits_until
from np_drake.logs.importing.interpolation import Signals, clock_of
from np_drake.logs.importing.log_map import LogMap
from np_drake.logs.importing.one_clock import on_one_clock
from np_drake.logs.importing.part import Part, flies, import_part, lift_of


def imported_parts(
    parts: list[Signals], log_map: LogMap, path: str, *, origin: float, clock: Change, adopt: bool
) -> tuple[LogMap, list[Part], list[str]]:
    """Return the map that agrees with the longest part, what was made of every part, and one line
    on each left out.

    Args:
        origin: from which times of the lines count [s].
        clock: change of the unit of time, made in the signals.
        adopt: take other conventions where the longest part fits those.
    Raises: WrongConventions, LogError: if that of the longest part that fails, where none holds a
        flight.
    """
    moving = [flies(signals, log_map) for signals in parts]
    by_length = sorted(
        range(len(parts)), key=lambda k: (not moving[k], -np.ptp(clock_of(parts[k]).t))
    )
    parts, log_map, said = on_one_clock(parts, parts[by_length[0]], log_map)
    done: dict[int, Part] = {}
    failure: LogError | None = None
    usual = 0.0
    for k in by_length:
        span = f"the part from {clock_of(parts[k]).t[0] - origin:.2f} s on"
        if done and not moving[k]:
            said.append(f"{span} is no flight; left out")
            continue
        try:
            log_map, found, told = _fitting(
                parts[k], log_map, path, origin, clock=clock, adopt=adopt and not done
            )
            made = import_part(*found, path, origin=origin, usual=usual)
            if done and not made.flights:
                said.append(f"{span} holds no flight; left out")
                continue
            usual = usual or (usual_lift(lift_of(made.aligned.values)) if made.carried else 0.0)
            done[k], said = made, [*said, *told, *made.said]
        except LogError as error:
            fits_other = isinstance(error, WrongConventions) and bool(error.verdict.changes)
            if len(parts) == 1 or (fits_other and not done):
                raise
            failure = failure or error
            wrong = (
                "does not agree with itself"
                if isinstance(error, WrongConventions)
                else "is no flight log by itself"
            )
            said.append(f"{span} {wrong}; left out")
    if failure is not None and not done:
        raise failure
    if max(done) < len(parts) - 1 and not any(line.startswith(FITS) for line in said):
        end = done[max(done)].aligned.t[-1] - origin
        said.append(fits_until(end))
    if not moving[by_length[0]]:
        said.insert(0, "no flight: position stays, or the rotors stand; nothing can be identified")
    return log_map, [done[k] for k in sorted(done)], said


def _fitting(
    signals: Signals, log_map: LogMap, path: str, origin: float, *, clock: Change, adopt: bool
) -> tuple[LogMap, tuple[Signals, LogMap, Verdict], list[str]]:
    """Return the map, what of a part agrees with it, with the verdict, and a line where that is not
    all of it.
    """
    verdict = judged(signals, log_map, path) if flies(signals, log_map) else Verdict({}, ())
    disturbed = any(misfit > DOUBTED for misfit in verdict.misfits.values()) and not verdict.changes
    said: list[str] = []
    if stretch := fitting_stretch(signals, log_map, verdict) if disturbed else None:
        start, stop = stretch
        part, _ = within(signals, start, stop)
        own = judged(part, log_map, path)
        kinds, tested = ({law.split()[0] for law in laws} for laws in (verdict.failed, own.misfits))
        if own.holds and kinds <= tested:
            since = f"from {start - origin:.1f} " if start > clock_of(signals).t[0] + WINDOW else ""
            whole = ", ".join(verdict.failed[:3]) or "its quantities"
            said = [
                f"{FITS}{since}until {stop - origin:.1f} s; beyond, {whole} do not agree: left out"
            ]
            signals, verdict = part, own
    log_map, verdict = agreed(verdict, signals, log_map, path, clock=clock, adopt=adopt)
    return log_map, (signals, log_map, verdict), said
