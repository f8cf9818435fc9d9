"""Whether an effect of the best model is reported as a cause."""

import dataclasses as dc
from collections.abc import Sequence

from np_drake.diagnosis.decision.effect_size import size_of, within_calibration
from np_drake.diagnosis.decision.held_out_test import least_log_bayes_factor, log_bayes_factor
from np_drake.diagnosis.fitting import Fit, impossible
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.materiality import Size
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import DRAG, GUSTY, Drift
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.selection import Ranking
from np_drake.effects.base import ActuatorEffect, Effect, SensorEffect
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class Inclusion:
    """What speaks for and against a term as a cause.

    size: of the term.   confirmed: held-out flights do not speak against it.   material: its size matters.
    sure: its probability is high enough.   significant: its parameters differ from none.
    stands_for: what it needs that is physically impossible; empty where it needs nothing of the kind.
    """

    size: Size
    confirmed: bool
    material: bool
    sure: bool
    significant: bool
    stands_for: str

    @property
    def included(self) -> bool:
        """Whether the term is a cause."""
        return self.confirmed and self.material and self.sure and self.significant and not self.stands_for


def judge(
    ranking: Ranking,
    fit: Fit,
    i: int,
    probability: float,
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    held: HeldOut,
    drift: Drift,
    *,
    gusty: bool,
) -> Inclusion:
    """Judge term i of the fit.

    Args:
        probability: reported for it [1].   drift: of the sensors.
        gusty: gusts were found. Then the drag that feels them is material however small, may lie at its bound, and
            neither it nor the wind must be confirmed by held-out flights, where it blew otherwise.
    """
    effect, options, noise = fit.terms[i].effect, ranking.options, ranking.noise
    tolerance, thresholds = options.tolerance, options.thresholds
    feels_gusts = gusty and effect.identifier == DRAG
    size = size_of(fit, i, flights, noise, tolerance, [(e, held.terms[e.name]) for e in held_out])
    brought = log_bayes_factor(fit, i, held_out, noise, held, drift, options.priors)
    confirmed = brought > least_log_bayes_factor(fit, i, flights, noise, drift, thresholds)
    sure = thresholds.sure_seen_again if brought > thresholds.seen_again else thresholds.sure
    material = size.material(
        options.materiality,
        calibration=within_calibration(fit.terms[i], options),
        sensor=tolerance.of(effect.identifier) > 0,
        least_gap=_least_gap(fit, i, brought, options),
    )
    return Inclusion(
        size=size,
        confirmed=confirmed or (gusty and effect.identifier in GUSTY),
        material=(material and not within_timing(effect, flights[0].vehicle, options)) or feels_gusts,
        sure=probability >= sure or feels_gusts,
        significant=fit.is_significant(i, thresholds.significance) or feels_gusts,
        stands_for=impossible(fit, i, flights[0].vehicle, thresholds, gusty=gusty),
    )


def within_timing(effect: Effect, vehicle: Vehicle, options: Options) -> bool:
    """Return whether an effect shifts commands in time, by no more than it is unknown when they act."""
    shift = abs(effect.time_shift(vehicle))
    return 0 < shift < options.materiality.sensor * options.tolerance.timing


def _least_gap(fit: Fit, i: int, brought: float, options: Options) -> float:
    """Return the least share of the gap at which term i is material [1].

    Beside a payload, whose swing is no ideal pendulum, it is larger, except for sensor errors and for dead times that
    held-out flights confirm.   brought: log Bayes factor of the term on held-out flights.
    """
    effect = fit.terms[i].effect
    timed = isinstance(effect, ActuatorEffect) and effect.dead_time > 0.0
    beside = any(t.swings for j, t in enumerate(fit.terms) if j != i)
    unlike = isinstance(effect, SensorEffect) or (timed and brought > options.thresholds.hurt)
    materiality = options.materiality
    return materiality.least_gap_beside_payload if beside and not unlike else materiality.least_gap
