"""Step 4: how far the gap shrinks on held-out flights, as a ladder, and in the simulator's replay."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.fitting import Fit
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.held_out import HeldOut, pooled, remaining_residual, scored_on_fitted_rows
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.residuals import WRENCH, FlightResiduals
from np_drake.diagnosis.result import Cause, GapReduction, Replay, ReplayGap, Rung
from np_drake.logs.flight_log import FlightLog

BLOCK = 1.0  # of the bootstrap [s]
FEWEST = 8  # blocks, shorter ones where flights are short; own choice
DRAWS = 400
SEED = 1
LEAD = 0.5  # of commands before a replay, for motors and delays [s]
LEAST_REPLAYED = 3.0  # of a flight after a cause begins, or all of it is replayed [s]; own choice
LEAST_GAP = 0.02  # of the noise's power, below which there is no gap to close; own choice


def measure_gap_reduction(
    fit: Fit,
    causes: Sequence[Cause],
    flights: Sequence[FlightResiduals],
    noise: NoiseModel,
    held: HeldOut,
    replay: Replay | None,
) -> GapReduction:
    """Held-out shrink with a block-bootstrap interval, the ladder, and the replay before and after."""
    before = {e.name: e.y[held.rows[e.name]] for e in flights}
    named = {c.identifier for c in causes}
    kept = {n: [t for t in terms if t.effect.identifier in named] for n, terms in held.terms.items()}
    after = {e.name: (e.y - predicted_residual(e, kept[e.name]))[held.rows[e.name]] for e in flights}
    floor = 1.0
    ladder = _ladder(causes, flights, noise, held)
    fraction = closed_fraction(
        pooled(list(before.values()), noise), pooled(list(after.values()), noise), floor
    )
    interval = _bootstrap(before, after, noise, flights[0].grid.step)
    replays: tuple[ReplayGap | None, ReplayGap | None] = (None, None)
    warnings = [
        f"{e.name}: too short to judge a payload by rows to which its swing was not fitted."
        for e in flights
        if scored_on_fitted_rows(held.terms[e.name], e)
    ]
    if replay is not None:
        effects = [
            (c.effect.foreseen, {e.name: _onset_of(kept[e.name], c.identifier, e) for e in flights})
            for c in causes
            if c.effect is not None
        ]
        logs = [_judging(e, [onset[e.name] for _, onset in effects]) for e in flights]
        replays = (replay(logs, []), _with_effects(replay, logs, effects, warnings))
    return GapReduction(
        pooled(list(before.values()), noise),
        pooled(list(after.values()), noise),
        floor,
        fraction,
        interval,
        ladder,
        *replays,
        tuple(warnings),
    )


def _judging(flight: FlightResiduals, onsets: Sequence[float | None]) -> FlightLog:
    """The log, its time from its first row on, without what a fit has seen of it, and from where a cause acts on:

    until then the simulator is the same with all of them and without.   onsets: of the causes, from the first row [s].
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
    """The replay with the effects; a simulator that refuses their figures costs that figure, not the answer."""
    if not effects:
        return None
    try:
        return replay(logs, effects)
    except ValueError as error:
        warnings.append(f"no replay with the effects: {' '.join(str(error).split())}")
        return None


def closed_fraction(before: float, after: float, floor: float) -> float:
    """1 - (after² - floor²) / (before² - floor²); zero where there was no gap, within -1 … 1."""
    gap = before**2 - floor**2
    if gap <= LEAST_GAP * floor**2:
        return 0.0
    return float(np.clip(1 - (after**2 - floor**2) / gap, -1.0, 1.0))


def _onset_of(terms: Sequence[Term], identifier: str, flight: FlightResiduals) -> float | None:
    """From the first row of the log on [s]."""
    begin = next((t.begins(flight.name) for t in terms if t.effect.identifier == identifier), None)
    return None if begin is None else begin - float(flight.log.t[0])


def _order(cause: Cause) -> tuple[bool, float]:
    """The largest first, but a wind after the drag that it acts through."""
    return bool(cause.effect is not None and type(cause.effect).needs), -float(np.nan_to_num(cause.share))


def _ladder(causes, flights, noise, held: HeldOut) -> tuple[Rung, ...]:
    """Nominal, then effect by effect in order of share, then the noise floor."""
    rungs = [Rung("nominal", remaining_residual([], flights, noise, held))]
    so_far: list[Cause] = []
    for cause in sorted(causes, key=_order):
        so_far.append(cause)
        rungs.append(Rung(f"+ {cause.identifier}", remaining_residual(so_far, flights, noise, held)))
    return (*rungs, Rung("noise floor", 1.0))


def _bootstrap(before, after, noise: NoiseModel, step: float) -> tuple[float, float]:
    """95 % interval of the fraction over blocks of about a second."""
    rows = sum(map(len, before.values()))
    size = max(1, min(round(BLOCK / step), rows // FEWEST))

    def blocks(parts: dict[str, np.ndarray]) -> np.ndarray:
        """(blocks, 2) sum of power over rows, and number of rows."""
        out = []
        for residual in parts.values():
            power = np.mean((residual[:, WRENCH] / np.maximum(noise.rms[WRENCH], 1e-12)) ** 2, axis=1)
            split = np.array_split(power, max(1, round(len(power) / size)))
            out += [(some.sum(), len(some)) for some in split]
        return np.array(out)

    b, a = blocks(before), blocks(after)
    pick = np.random.default_rng(SEED).integers(0, len(b), (DRAWS, len(b)))
    pairs = np.sqrt([some[pick].sum(axis=1)[:, 0] / some[pick].sum(axis=1)[:, 1] for some in (b, a)]).T
    fractions = [closed_fraction(x, y, 1.0) for x, y in pairs]
    low, high = np.quantile(fractions, [0.025, 0.975])
    return float(low), float(high)
