"""Second answer: first halves of held-out flights join the fit where they show what training
flights do not.

The second halves alone judge it.
"""

import dataclasses as dc
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from np_drake.diagnosis.calibration import with_fixed_effects, with_torque_gain
from np_drake.diagnosis.decision.causes import causes_of, of_named_fit, open_timing
from np_drake.diagnosis.decision.remainder import measure_remainder
from np_drake.diagnosis.decision.unexplained import LinearModel, Unexplained, find_unexplained
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.gusts import as_gusts, with_drag
from np_drake.diagnosis.held_out import (
    HeldOut,
    mark_outliers,
    misfit,
    on_held_out,
    with_calibration,
)
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import DRAG, GUSTY
from np_drake.diagnosis.regressors.generic import ELSEWHERE
from np_drake.diagnosis.residuals import FlightResiduals, make_flight_residuals
from np_drake.diagnosis.result import CHANNELS, Cause, Finding, Remainder
from np_drake.diagnosis.selection import (
    Ranking,
    SearchResult,
    find_map_model,
    rank_models,
    with_named_fit,
)
from np_drake.diagnosis.slow_force import position_p_value
from np_drake.effects.gusty_wind import GustyWind
from np_drake.files.number_text import number

PLACE = Finding("place", "a slow force tied to a place", 1.0, {}, ELSEWHERE)


@dc.dataclass(frozen=True)
class Inference:
    """Causes and what they leave.

    flights: of the fit, with their outliers marked.   held: the causes on held-out flights.
    """

    flights: Sequence[FlightResiduals]
    ranking: Ranking
    held: HeldOut
    unexplained: Unexplained
    causes: list[Cause]
    below_threshold: list[Finding]

    @property
    def held_out(self) -> Sequence[FlightResiduals]:
        """Held-out flights, with their outliers marked."""
        return self.held.flights

    @property
    def options(self) -> Options:
        """Options of the ranking."""
        return self.ranking.options

    @cached_property
    def left(self) -> Remainder:
        """What the causes leave of the held-out gap."""
        said = self.unexplained
        return measure_remainder(
            self.causes, self.ranking.noise, self.held, [*said.structures, said.slow], self.options
        )

    @property
    def unknown(self) -> bool:
        """Whether something material remains that no effect explains."""
        return self.left.probability >= 0.5

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Where the remainder lives."""
        slow = self.unexplained.slow
        return (*([slow.finding] if slow.probability > 0.5 else []), *self.unexplained.findings)


def infer(
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    options: Options | None = None,
) -> Inference:
    """Search the effects by training flights, and return the causes that they show; held-out
    flights judge them.

    Args:
        options: all that steers the answer; default: by the sensors of the flights.
    """
    return conclude(find_map_model(flights, options), held_out)


def conclude(found: SearchResult, held_out: Sequence[FlightResiduals]) -> Inference:
    """Rank the models of a search, judge the best by held-out flights, and decide which of its
    effects are causes.

    Args:
        found: by `find_map_model`.
    """
    ranking = rank_models(found)
    flights, held = ranking.problem.flights, _held_out(ranking, held_out)
    linear = LinearModel(ranking)
    _, structure = linear.select_structure()
    unexplained = find_unexplained(ranking, linear, structure, held)
    if unexplained.slow.probability > 0.5:
        # The drift of an estimator that nobody measured is neither told from gusts nor from a force
        # tied to a place.
        told = not ranking.options.tolerance.unmeasured
        position_dependent = told and _depends_on_position(ranking, held)
        ask_gusts = told and not position_dependent
        found_gusts = (
            _in_gusts(ranking, linear, structure, held, unexplained) if ask_gusts else None
        )
        if found_gusts is not None:
            ranking, held, causes, minor = found_gusts
            blown = dc.replace(unexplained, slow=unexplained.slow._replace(probability=0.0))
            return Inference(flights, ranking, held, blown, causes, minor)
        if position_dependent:
            unexplained = dc.replace(unexplained, slow=unexplained.slow._replace(finding=PLACE))
    causes, minor = causes_of(ranking, linear, structure, held)
    return Inference(flights, ranking, held, unexplained, causes, minor)


def as_named(found: Inference) -> Inference:
    """Return the inference with its causes fitted as they are named: without the effects that are
    not.

    What is not named gives way to calibration and the causes, which were fitted beside it. A lag or
    delay that the logs leave open is calibration too.
    """
    named, ranking = {c.identifier for c in found.causes}, found.ranking
    open_ = open_timing(ranking)
    if not open_ and not named < {t.effect.identifier for t in ranking.best.terms}:
        return found
    ranking = with_named_fit(ranking, named | open_)
    causes = of_named_fit(found.causes, ranking.best, ranking)
    held = dc.replace(_held_out(ranking, found.held_out), calibrations=open_)
    return dc.replace(found, ranking=ranking, held=held, causes=causes)


def _held_out(ranking: Ranking, held_out: Sequence[FlightResiduals]) -> HeldOut:
    """Return the best fit on held-out flights, calibrated and with their outliers marked."""
    best, noise, priors = ranking.best, ranking.noise, ranking.options.priors
    own = [with_calibration(best, e, noise, ranking.options) for e in held_out]
    marked = [mark_outliers(best.terms, e, noise, priors, best.calibration) for e in own]
    return on_held_out(best, marked, noise, priors)


def _in_gusts(
    ranking: Ranking,
    linear: LinearModel,
    structure: Sequence[int],
    held: HeldOut,
    unexplained: Unexplained,
) -> tuple[Ranking, HeldOut, list[Cause], list[Finding]] | None:
    """Return ranking, held-out flights and causes with gusts as the slow force; None where it can
    be no wind.
    """
    if (with_one := with_drag(ranking)) is not ranking:
        ranking, linear = with_one, LinearModel(with_one)
    held = on_held_out(ranking.best, held.flights, ranking.noise, ranking.options.priors)
    causes, minor = causes_of(ranking, linear, structure, held, gusts=True)
    causes = with_gusts(ranking, held, causes, unexplained)
    if not any(c.identifier == GustyWind.identifier for c in causes):
        return None
    return ranking, in_gusts(held, causes), causes, minor


def _depends_on_position(ranking: Ranking, held: HeldOut) -> bool:
    """Return whether the slow force depends on position alike in all flights, as gusts would
    not.
    """
    every = [*ranking.problem.flights, *(e for e in held.flights if not e.joined.any())]
    p_value = position_p_value(every, _residuals(ranking, held), {e.name: None for e in every})
    return p_value < ranking.options.thresholds.position_p_value


def with_gusts(
    ranking: Ranking, held: HeldOut, causes: list[Cause], unexplained: Unexplained
) -> list[Cause]:
    """Return the causes with gusts among them, where a drag was found through which they act.

    Args:
        unexplained: what it leaves, with the probability of a slow force.
    """
    flights, rest = ranking.problem.flights, _residuals(ranking, held)
    through_drag = {}
    for e in (*flights, *held.flights):
        terms = [
            t for t in held.terms.get(e.name, ranking.best.terms) if t.effect.identifier in GUSTY
        ]
        through_drag[e.name] = rest[e.name] + predicted_residual(e, terms)
    return as_gusts(
        flights, through_drag, causes, unexplained.slow.probability, ranking.options, held.flights
    )


def _residuals(ranking: Ranking, held: HeldOut) -> dict[str, np.ndarray]:
    """Return by flight the residual (m, 15) of the best model [N, N·m, …]."""
    rest = {e.name: ranking.best.residual(e) for e in ranking.problem.flights}
    return rest | {e.name: held.swing_free_residual(e) for e in held.flights}


def in_gusts(held: HeldOut, causes: Sequence[Cause]) -> HeldOut:
    """Return the held-out flights with the mean of the gusts in the place of a steady wind.

    Args:
        causes: the gusts and the drag through which they act among them, each from when on it acts.
    """
    by_name = {c.identifier: c for c in causes}
    gusts, drag = by_name[GustyWind.identifier], by_name[DRAG]
    assert gusts.effect is not None
    assert drag.effect is not None
    terms, residual = dict(held.terms), dict(held.residual)
    for e in held.flights:
        rest = [t for t in held.terms[e.name] if t.effect.identifier not in GUSTY]
        own_drag = Term(drag.effect, {e.name: drag.onset.get(e.name)})
        terms[e.name] = [
            *rest,
            own_drag,
            Term(gusts.effect.predicted, {e.name: gusts.onset.get(e.name)}),
        ]
        residual[e.name] = e.y - predicted_residual(e, terms[e.name])
    return dc.replace(held, terms=terms, residual=residual)


NAME = "first half of {}"
LEAST_HALF = 4.0  # duration of either half of a flight, below which it stays whole [s]; own choice


def novelty(first: Inference) -> tuple[Finding, ...]:
    """Return whether held-out flights show what training flights do not, as a sentence or none.

    Gusts, which repeat nowhere, and a payload, whose swing may be lost, do not count.
    """
    ranking = first.ranking
    if any(c.identifier == GustyWind.identifier for c in first.causes) or any(
        t.has_hidden_state for t in ranking.best.terms
    ):
        return ()
    ratio = misfit(first.held, ranking.noise)
    channel = int(np.argmax(ratio))
    if ratio[channel] <= first.options.thresholds.misfit_ratio:
        return ()
    text = (
        f"{CHANNELS[channel]} is {number(float(ratio[channel]), 2)} times what the training "
        f"flights leave"
    )
    return (
        Finding(
            "misfit",
            text,
            float(ratio[channel]),
            {},
            "fly the held-out trajectory again, and fit it",
        ),
    )


def second_answer(first: Inference) -> tuple[Inference, list[FlightResiduals]] | None:
    """Return the inference with halves of the held-out flights, and these halves; None where all
    are too short.

    A wind is a condition of a flight: where the first answer names none, one can act in the halves
    alone.
    """
    joined, judges = split_flights(first.held_out)
    if not joined:
        return None
    still_air = not any(c.effect and c.effect.needs for c in first.causes)
    return conclude(
        find_map_model([*first.flights, *joined], first.options, still_air=still_air), judges
    ), joined


def split_flights(
    flights: Sequence[FlightResiduals],
) -> tuple[list[FlightResiduals], list[FlightResiduals]]:
    """Return the first halves of flights as flights of their own, and all flights with these rows
    marked as joined.
    """
    halves, judges = [], []
    for e in flights:
        log = e.log
        middle = 0.5 * (log.t[0] + log.t[-1])
        if middle - log.t[0] < LEAST_HALF:
            judges.append(e)
            continue
        half = dc.replace(
            log.rows(0, int(np.searchsorted(log.t, middle))), name=NAME.format(e.name)
        )
        (own,) = with_torque_gain(
            [with_fixed_effects(make_flight_residuals(half, e.vehicle, e.grid.step))],
            np.array(e.torque_gain),
        )
        halves.append(dc.replace(own, goes_on=True))
        judges.append(dc.replace(e, joined=e.t <= middle))
    return halves, judges


def without_onsets_in(flights: Sequence[FlightResiduals], cause: Cause) -> Cause:
    """Return the cause without its onsets in these flights, which are parts of others."""
    names = {e.name for e in flights}
    return dc.replace(cause, onset={n: t for n, t in cause.onset.items() if n not in names})
