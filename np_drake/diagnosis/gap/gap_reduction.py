"""Gap reduction on held-out flights: closed fraction, ladder of effects, and replay in the
simulator.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.forward_model import predicted_residual
from np_drake.diagnosis.held_out import HeldOut, pooled, remaining_residual, scored_on_fitted_rows
from np_drake.diagnosis.held_out.prediction import LEAST_GAP
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.result import Cause, GapReduction, Remainder, Replay, ReplayGap, Rung
from np_drake.effects.base import Effect
from np_drake.flight_log import FlightLog

LEAD = 0.5  # commands before a replay that motors and delays need [s]
LEAST_REPLAYED = (
    3.0  # least time after a cause begins; else all of the flight is replayed [s]; own choice
)


def measure_gap_reduction(
    causes: Sequence[Cause],
    noise: NoiseModel,
    held: HeldOut,
    left: Remainder,
    replay: Replay | None,
    calibration: Sequence[Effect] = (),
) -> GapReduction:
    """Return the held-out gap reduction with its interval, the ladder, and the replay before and
    after.

    Args:
        replay: the simulator; None: no replay.
        calibration: effects of the vehicle's calibration, which the corrected simulator has as
            well.
    """
    flights = held.flights
    before = {e.name: e.against_file[held.rows[e.name]] for e in flights}
    named = {c.identifier for c in causes}
    kept = {name: held.kept(name, named) for name in held.terms}
    after = {
        e.name: (e.y - predicted_residual(e, kept[e.name]))[held.rows[e.name]] for e in flights
    }
    size, rest = (pooled(list(part.values()), noise) for part in (before, after))
    fraction, low, high = (max(1.0 - share, -1.0) for share in (left.share, *left.ci95[::-1]))
    closed = (fraction, (low, high)) if left.share == left.share else (0.0, (0.0, 0.0))
    replays: tuple[ReplayGap | None, ReplayGap | None] = (None, None)
    warnings = [
        f"{e.name}: too short to judge a payload by rows to which its swing was not fitted."
        for e in flights
        if scored_on_fitted_rows(held.terms[e.name], e)
    ]
    if replay is not None:

        def onset_of(identifier: str, e: FlightResiduals) -> float | None:
            """Return the onset from the first row of the log on [s]."""
            begin = next(
                (t.begins(e.name) for t in kept[e.name] if t.effect.identifier == identifier), None
            )
            return None if begin is None else begin - float(e.log.t[0])

        effects = [
            (c.effect.predicted, {e.name: onset_of(c.identifier, e) for e in flights})
            for c in causes
            if c.effect is not None
        ]
        logs = [_judging(e, [onset[e.name] for _, onset in effects]) for e in flights]
        effects += [(effect, {e.name: None for e in flights}) for effect in calibration]
        replays = (replay(logs, []), _with_effects(replay, logs, effects, warnings))
    return GapReduction(
        size, rest, 1.0, *closed, _ladder(causes, noise, held), *replays, tuple(warnings), left
    )


def held_out_gains(causes: Sequence[Cause], noise: NoiseModel, held: HeldOut) -> list[float]:
    """Return the share of the held-out gap above the noise that comes back without each cause [1].
    Returns: NaN where there is no gap.
    """
    nominal = pooled([e.against_file[held.rows[e.name]] for e in held.flights], noise)
    every = remaining_residual(causes, noise, held)
    without = [
        remaining_residual([c for c in causes if c is not one], noise, held) for one in causes
    ]
    gap = nominal**2 - 1.0
    return [(rest**2 - every**2) / gap if gap > LEAST_GAP else np.nan for rest in without]


def _judging(flight: FlightResiduals, onsets: Sequence[float | None]) -> FlightLog:
    """Return the rows of the log that did not join the fit, from shortly before a cause acts on.

    Times and the onsets of the causes count from the first row of the log [s].
    """
    log = dc.replace(flight.log, t=flight.log.t - flight.log.t[0])
    first = 0
    if flight.joined.any():
        first = int(np.searchsorted(flight.log.t, flight.t[flight.joined][-1], side="right"))
    acting = min((-np.inf if onset is None else onset for onset in onsets), default=-np.inf)
    if log.t[-1] - acting > LEAST_REPLAYED:
        first = max(first, int(np.searchsorted(log.t, acting - LEAD)))
    return log.rows(first, len(log))


def _with_effects(replay: Replay, logs, effects, warnings: list[str]) -> ReplayGap | None:
    """Return the replay with the effects, or None with a warning where the simulator rejects their
    parameters.
    """
    if not effects:
        return None
    try:
        return replay(logs, effects)
    except ValueError as error:
        warnings.append(f"no replay with the effects: {' '.join(str(error).split())}")
        return None


def _ladder(causes: Sequence[Cause], noise: NoiseModel, held: HeldOut) -> tuple[Rung, ...]:
    """Return the residual of the nominal model, with effects added in order of share, and of noise
    alone.
    """
    nominal = pooled([e.against_file[held.rows[e.name]] for e in held.flights], noise)
    rungs = [Rung("nominal", nominal)]
    # The scale of a throttle's map is told together with what hangs below: alone it is none.
    if held.calibrated and held.flights[0].log.input != "normalised":
        rungs.append(Rung("+ calibration", remaining_residual([], noise, held)))
    so_far: list[Cause] = []
    # The largest share first, and a wind after the drag through which it acts.
    for cause in sorted(
        causes, key=lambda c: (bool(c.effect and c.effect.needs), -float(np.nan_to_num(c.share)))
    ):
        so_far.append(cause)
        rungs.append(Rung(f"+ {cause.identifier}", remaining_residual(so_far, noise, held)))
    return (*rungs, Rung("noise floor", 1.0))
