"""`diagnose`: the five steps in a row. Each can be used alone: check, where, which (rank), how far, unknown."""

import dataclasses as dc
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from np_drake.diagnosis.decision.adaptive_split import look_twice
from np_drake.diagnosis.decision.decide import look
from np_drake.diagnosis.gap.gap_reduction import how_far
from np_drake.diagnosis.held_out.prediction import pooled
from np_drake.diagnosis.localisation.identifiability import check, confusables, excitation, excited
from np_drake.diagnosis.localisation.localisation import where
from np_drake.diagnosis.numerics.autoregressive_noise import fit_noise
from np_drake.diagnosis.residuals.flight_residuals import Evidence, make_evidence
from np_drake.diagnosis.residuals.resampling import natural_step
from np_drake.diagnosis.result import UNKNOWN, Cause, Check, Diagnosis, Replay, Shrink, Where
from np_drake.diagnosis.tolerance import Tolerance
from np_drake.logs.flight_log import FlightLog
from np_drake.vehicle import Vehicle

Progress = Callable[[float, str], None]


def diagnose(
    vehicle: Vehicle,
    train: Sequence[FlightLog],
    held_out: Sequence[FlightLog],
    replay: Replay | None = None,
    *,
    second_look: bool = True,
    tolerance: Tolerance | None = None,
    on_progress: Progress | None = None,
) -> Diagnosis:
    """Where the nominal model of `vehicle` and the flights part, which effect causes it, how far it shrinks.

    Args:
        train: flights that effects are fitted to.   held_out: flights that judge them; not fitted to.
        replay: the simulator as a callable (`diagrams.gap.drake_replay.DrakeReplay`); without it, replay errors are
            left out.
        second_look: where held-out flights show what the training flights do not, let their first halves join the
            fit and only their second halves judge; `Diagnosis.joined` names them.
        tolerance: what vehicle file and sensors may be off by without a cause: `Tolerance()` for a rig,
            `LABORATORY`, or one's own; default: a rig where attitudes are noisy or rotor speed is measured.
        on_progress: called with the share done [1] and what is going on.
    Raises: ValueError: on logs that cannot be used, one line with the remedy.
    """
    start = time.perf_counter()
    tell = on_progress or (lambda share, text: None)
    require_flights(train, held_out)
    tell(0.0, "residuals")
    step = max(natural_step(log.t) for log in [*train, *held_out])
    flights = [make_evidence(log, vehicle, step) for log in train]
    unseen = [make_evidence(log, vehicle, step) for log in held_out]
    names: dict[str, Any] = {"vehicle": vehicle.name, "train": _names(flights), "held_out": _names(unseen)}
    if not excited(excitation(flights)):
        answer = _cannot_tell(flights, unseen)
        return Diagnosis(**names, **answer, cannot_tell=True, wall=time.perf_counter() - start)
    tell(0.1, "effects")
    found, joined = (
        look_twice(flights, unseen, tolerance, tell)
        if second_look
        else (look(flights, unseen, tolerance), [])
    )
    tell(0.7, "how far")
    held, noise = found.left.held, found.ranking.noise
    checked = check(found.flights, found.unseen, found.ranking.problem.candidates, noise)
    shrunk = how_far(found.ranking.named, found.causes, found.unseen, noise, held, replay)
    verdict = tuple(c.identifier for c in found.causes) + ((UNKNOWN,) if found.unknown else ())
    halves = tuple(e.name for e in found.unseen if e.joined.any())
    return Diagnosis(
        **names,
        joined=halves,
        judged_as=found.ranking.tolerance.name,
        verdict=verdict,
        causes=tuple(_without(c, _names(joined)) for c in found.causes),
        check=checked,
        where=where(found.unseen, held.left, noise, held.rows),
        shrink=shrunk,
        minor=tuple(found.minor),
        remains=found.left.findings,
        unknown_probability=found.unknown_probability,
        warnings=(*_told(halves), *checked.warnings, *shrunk.warnings),
        wall=time.perf_counter() - start,
    )


def _without(cause: Cause, flights: Sequence[str]) -> Cause:
    """The cause, without its onsets in these flights, which are parts of others."""
    return dc.replace(cause, onset={n: t for n, t in cause.onset.items() if n not in flights})


def _told(halves: Sequence[str]) -> list[str]:
    text = "shows what the training flights do not; its first half joined the fit, its second half judges."
    return [f"{name}: {text}" for name in halves]


def _names(flights: Sequence[Evidence]) -> tuple[str, ...]:
    return tuple(e.name for e in flights)


def require_flights(train: Sequence[FlightLog], held_out: Sequence[FlightLog]) -> None:
    """Raises: ValueError: where these flights, together, cannot be diagnosed; one line with the remedy."""
    for name, logs in (("train", train), ("held_out", held_out)):
        if not logs:
            raise ValueError(f"diagnose: {name} must hold at least one flight; got none.")
    names = [log.name for log in [*train, *held_out]]
    twice = {n for n in names if names.count(n) > 1}
    if twice:
        raise ValueError(
            f"diagnose: flights must have different names; got {sorted(twice)[0]!r} twice. "
            "Rename one, or give each flight once."
        )
    if len({log.input for log in [*train, *held_out]}) > 1:
        raise ValueError("diagnose: all flights must have the same input; got command and rotor_speed.")
    present = {log.name: log.a is not None for log in [*train, *held_out]}
    if len(set(present.values())) > 1:
        without = next(n for n, there in present.items() if not there)
        raise ValueError(f"diagnose: all flights or none must have accelerations; {without} has none.")
    seen = {log.name: _motion(log) for log in train}
    for log in held_out:
        own = _motion(log)
        same = next((name for name, rows in seen.items() if _same(own, rows)), None)
        if same is not None:
            raise ValueError(
                f"diagnose: {log.name} is the same flight as {same}, to which effects are fitted, and can judge none. "
                "Give one that was flown apart."
            )


def _motion(log: FlightLog) -> set[bytes]:
    """What p, v and w are at its rows; rows at rest are one."""
    rows = np.concatenate([log.p, log.v, log.w], axis=1, dtype=float) + 0.0  # no zero has a sign
    return set(np.ascontiguousarray(rows).view(f"V{rows[:1].nbytes}").ravel().tolist())


def _same(held_out: set[bytes], train: set[bytes]) -> bool:
    """Is more than half of the motion in the training flight too? What never moves is no motion."""
    return len(held_out) > 1 and 2 * len(held_out & train) > len(held_out)


def _cannot_tell(flights: Sequence[Evidence], unseen: Sequence[Evidence]) -> dict:
    """Nothing moves: the residual is shown, no cause is named."""
    from np_drake.diagnosis.regressors.library import library_candidates

    noise = fit_noise([e.y - e.y.mean(axis=0) for e in flights], flights[0].grid.step)
    pairs = confusables(flights, library_candidates(flights), noise)
    rows = {e.name: np.ones(len(e.t), bool) for e in unseen}
    found: Where = where(unseen, {e.name: e.y for e in unseen}, noise, rows)
    checked = Check(
        False, excitation(flights), {}, tuple(pairs), ("nothing is excited: these logs cannot tell.",)
    )
    size = pooled([e.y for e in unseen], noise)
    shrunk = Shrink(size, size, 1.0, 0.0, (0.0, 0.0), ())
    return {
        "verdict": (),
        "causes": (),
        "check": checked,
        "where": found,
        "shrink": shrunk,
        "warnings": checked.warnings,
    }
