"""Candidates of the regression: columns of every effect of the library, and what vehicle file and
input of the flights leave open.
"""

import dataclasses as dc
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import scipy

from np_drake.diagnosis.forward_model import Stages, Term, predicted_residual
from np_drake.diagnosis.options import IDEAL_SENSORS, Options, Tolerance
from np_drake.diagnosis.residuals import QUIET, FlightResiduals
from np_drake.effects import ClockOffset, ConstantWind, LinearDrag, SuspendedPayload, ThrustScale
from np_drake.effects.base import Effect, prior_root, usual_size
from np_drake.effects.library import LIBRARY, effect_of, effects_for, unobservable
from np_drake.estimation.noise import fit_noise
from np_drake.estimation.priors import HEALTHY
from np_drake.vehicle.vehicle import THROTTLE_POWER, THROTTLE_POWER_SCATTER

DRAG = LinearDrag.identifier  # the effect through which winds act
WIND = ConstantWind.identifier
GUSTY = (DRAG, WIND)  # effects that gusts mask in a held-out flight
PAYLOAD = SuspendedPayload.identifier
Onset = dict[str, float | None]
LINEAR = "linear"  # variant of a nuisance whose coefficients stay linear in a fit
Mended = tuple[np.ndarray, float]  # physical coefficients and their log probability


@dc.dataclass(frozen=True)
class Candidate:
    """Columns (m, 15, k) by flight with prior N(0, 1) on their coefficients, and the terms that
    coefficients stand for.

    identifiers: of the effects; a wind comes with its drag.
    variant: label of this variant, with the values that are fixed.
    terms: maps coefficients (k,) to terms.
    log_prior: log prior of this variant among those of the same effect; onset_prior: log prior of
        its onsets.
    """

    identifiers: tuple[str, ...]
    variant: str
    columns: dict[str, np.ndarray]
    terms: Callable[[np.ndarray], list[Term]]
    log_prior: float = 0.0
    onset: Onset = dc.field(default_factory=dict)
    # Physical coefficients by posterior mean (k,) and covariance (k, k), and the log probability of
    # being physical; None where all are.
    physical: Callable[[np.ndarray, np.ndarray], Mended] | None = None
    # columns on any flight; None for library effects
    generic: Callable[[FlightResiduals], np.ndarray] | None = None
    figures: dict[str, float] = dc.field(default_factory=dict)
    measurement: str = ""  # that would end what is generic
    onset_prior: float = 0.0
    # part of every model already, so that it is a member only where it begins in flight
    calibrated: bool = False

    @property
    def size(self) -> int:
        """Number of columns."""
        return next(iter(self.columns.values())).shape[-1]

    @property
    def widens(self) -> bool:
        """Whether its prior widens to the size of the estimate."""
        return bool(self.identifiers) and all(
            i in LIBRARY and LIBRARY[i].widens for i in self.identifiers
        )


def hidden_from(flights: Sequence[FlightResiduals]) -> dict[str, str]:
    """Return the effects that this kind of flights cannot tell, with what they lack for it."""
    log = flights[0].log
    lacks = sorted({quantity for flight in flights for quantity in flight.log.lacks})
    return unobservable(
        log.input, accelerations=log.a is not None, torque=flights[0].knows_torque, lacks=lacks
    )


def library_candidates(
    flights: Sequence[FlightResiduals], onset: Onset | None = None
) -> list[Candidate]:
    """Return candidates for all effects of the library except wind and payload, which are built
    elsewhere.

    Args:
        onset: onsets by flight [s]; effects that cannot begin in flight are then left out.
    """
    candidates: list[Candidate] = []
    stages: dict[str, Stages] = {flight.name: {} for flight in flights}
    before = any(flight.earlier for flight in flights)
    # A load that is taken up in flight shows, however heavy the vehicle was before; and so does
    # thrust over throttle beside that of flights before.
    shown = {ThrustScale.identifier} if before else set()
    hidden = {
        name
        for name, why in hidden_from(flights).items()
        if why != "thrust" or not (name in shown or effect_of(name).sudden)
    }
    has_neighbours = any(flight.log.neighbours for flight in flights)
    tried = effects_for(flights[0].log.input, neighbours=has_neighbours, before=before)
    for identifier, effect in tried.items():
        elsewhere = effect.needs or effect.has_hidden_state
        if not elsewhere and identifier not in hidden and (effect.begins or not onset):
            candidates += _effect_candidates(effect, flights, onset or {}, stages)
    return candidates


def _effect_candidates(
    effect: type[Effect],
    flights: Sequence[FlightResiduals],
    onset: Onset,
    stages: Mapping[str, Stages] | None = None,
) -> list[Candidate]:
    """Return the variants of one effect as candidates, from caches of earlier predictions by
    flight.
    """
    stages = stages or {flight.name: {} for flight in flights}
    choices = {p.name: p.choices for p in effect.parameters if p.choices}
    settings = [
        dict(zip(choices, combination, strict=True)) for combination in product(*choices.values())
    ]
    grid = effect.grid(flights[0].vehicle)
    if effect.linear or settings != [{}] or not grid:
        return [_linear(effect, flights, onset, s, len(settings), stages) for s in settings]
    return [at_value(effect, flights, onset, values, len(grid), stages) for values in grid]


def _linear(
    effect: type[Effect],
    flights: Sequence[FlightResiduals],
    onset: Onset,
    fixed: dict[str, float],
    variants: int,
    stages: Mapping[str, Stages],
) -> Candidate:
    """Return the candidate of an effect that is linear in its free parameters, the others at fixed
    values, of so many variants.
    """
    free = [p for p in effect.parameters if not p.choices]
    neutral = {p.name: p.neutral for p in free} | fixed
    root = prior_root(effect, flights[0].vehicle)

    def columns_of(flight: FlightResiduals) -> np.ndarray:
        columns = []
        for p in free:
            # Small where the effect is linear to first order only.
            step = 0.1 * p.typical if effect.place in ("mass", "measurement") else p.typical
            step = step if p.neutral + step <= p.upper else -step
            values = {**neutral, p.name: p.neutral + step}
            residual = predicted_residual(
                flight, [Term(effect.of(values), onset)], stages[flight.name]
            )
            columns.append(residual / step)
        return np.stack(columns, axis=-1) @ root

    def terms(c: np.ndarray) -> list[Term]:
        values = {
            p.name: float(np.clip(p.neutral + v, p.lower, p.upper))
            for p, v in zip(free, root @ c, strict=True)
        }
        return [Term(effect.of({**fixed, **values}), onset)]

    label = ",".join(f"{k}={v:g}" for k, v in fixed.items())
    one_sided = np.array([p.lower == p.neutral for p in free])
    return Candidate(
        (effect.identifier,),
        label,
        {flight.name: columns_of(flight) for flight in flights},
        terms,
        -math.log(variants),
        onset,
        partial(_not_negative, root, one_sided) if one_sided.any() else None,
    )


def _not_negative(
    root: np.ndarray, one_sided: np.ndarray, mean: np.ndarray, covariance: np.ndarray
) -> Mended:
    """Return coefficients (k,) whose one-sided parameters (k,) are not negative, and the log
    probability of that.

    root (k, k) maps coefficients, of posterior `mean` and `covariance`, to distances of the
    parameters from neutral.
    Source: own choice: each axis by itself.
    """
    away = root @ mean
    spread = np.sqrt(np.diag(root @ covariance @ root.T))
    log_probability = scipy.special.log_ndtr(away / spread)[one_sided].sum()
    return np.linalg.solve(root, np.where(one_sided, np.maximum(away, 0.0), away)), float(
        log_probability
    )


def at_value(
    effect: type[Effect],
    flights: Sequence[FlightResiduals],
    onset: Onset,
    values: dict[str, float],
    variants: int,
    stages: Mapping[str, Stages],
) -> Candidate:
    """Return the candidate of a nonlinear effect that scales its prediction at `values`.

    Args:
        onset: onsets by flight [s].
        variants: number of variants that share the prior of the effect.
    """
    term = Term(effect.of(values), onset)
    columns = {
        flight.name: 2.0 * predicted_residual(flight, [term], stages[flight.name])[..., None]
        for flight in flights
    }

    def terms(c: np.ndarray) -> list[Term]:
        scaled = {
            p.name: float(
                np.clip(p.neutral + 2.0 * c[0] * (values[p.name] - p.neutral), p.lower, p.upper)
            )
            for p in effect.parameters
        }
        return [Term(effect.of(scaled), onset)]

    one_sided = all(p.lower >= p.neutral for p in effect.parameters)
    return Candidate(
        (effect.identifier,),
        ",".join(f"{k}={v:.3g}" for k, v in values.items()),
        columns,
        terms,
        -math.log(variants),
        onset,
        _positive if one_sided else None,
    )


def _positive(mean: np.ndarray, covariance: np.ndarray) -> Mended:
    return mean, 0.0 if mean[0] > 0 else -math.inf


def wind_candidates(
    flights: Sequence[FlightResiduals], plain: Sequence[Candidate], onset: Onset | None = None
) -> list[Candidate]:
    """Return a steady wind with each drag of `plain`, as the columns of the drag and three more.

    A drag that is weak or negative starts as a weak positive one, with a wind of the same force:
    both of opposite sign push alike, and a local optimiser cannot pass from one to the other.

    Args:
        onset: onsets of the wind by flight [s].
    """
    onset = onset or {}
    vehicle = flights[0].vehicle
    typical = usual_size(LinearDrag.parameters[0], vehicle)
    speeds = np.array([usual_size(p, vehicle) for p in ConstantWind.parameters])
    out = []
    for drag in (c for c in plain if c.identifiers == (DRAG,)):
        columns = {}
        for flight in flights:
            unit = Term(LinearDrag(typical, typical, typical), drag.onset)
            stages = Stages()
            still = predicted_residual(flight, [unit], stages)
            windy = [
                predicted_residual(flight, [unit, Term(ConstantWind(*axis), onset)], stages)
                for axis in np.eye(3).tolist()
            ]
            extra = np.stack([w - still for w in windy], axis=-1) * speeds
            columns[flight.name] = np.concatenate([drag.columns[flight.name], extra], axis=-1)

        def terms(c: np.ndarray, drag: Candidate = drag) -> list[Term]:
            (drag_term,) = drag.terms(c[:3])
            d = {name: max(value, 0.2 * typical) for name, value in drag_term.effect.values.items()}
            wind = speeds * c[3:] * typical / np.array(list(d.values()))
            return [
                dc.replace(drag_term, effect=LinearDrag(**d)),
                Term(ConstantWind(*np.clip(wind, -14.0, 14.0).tolist()), onset),
            ]

        out.append(Candidate((DRAG, WIND), drag.variant, columns, terms, drag.log_prior, onset))
    return out


def switched(candidate: Candidate, flights: Sequence[FlightResiduals], onset: Onset) -> Candidate:
    """Return the candidate switched on at its onsets; not for hidden states, which begin anew at an
    onset.

    Args:
        onset: onsets by flight [s].
    """
    none = np.zeros(candidate.size)
    columns = {
        flight.name: candidate.columns.get(flight.name, none)
        * flight.begun(onset.get(flight.name))[..., None]
        for flight in flights
    }

    def terms(c: np.ndarray) -> list[Term]:
        return [dc.replace(term, onset=onset) for term in candidate.terms(c)]

    return Candidate(
        candidate.identifiers, candidate.variant, columns, terms, candidate.log_prior, onset
    )


# Of thrust over throttle, where flights alone tell it [1]; source: own choice, for what hangs below
# may weigh as much.
THROTTLE_SCALE = 0.5
# Of thrust over rotor speed squared [1]; source: density of air, 2 % for 6 K or 20 hPa.
ROTOR_SPEED_SCALE = 0.02
THROTTLE_CURVE = THROTTLE_POWER_SCATTER / THROTTLE_POWER  # of its exponent [1]
# Of a map in the vehicle file that states no uncertainty: of its scale, and of its exponent [1];
# source: own choice.
IDENTIFIED_SCALE = 0.05
IDENTIFIED_CURVE = 0.05
# Deviations by which motion is ahead of commands, from which these are not held from their row [1].
EARLY = 3.0


def tolerance_of(flights: Sequence[FlightResiduals]) -> Tolerance:
    """Return the tolerance for real sensors, or for ideal ones where all logs look like those of a
    simulator.

    These have attitudes without noise, thrust and torque commands in SI units, and state when a
    command acts.
    """
    ideal = all(
        flight.attitude_noise <= QUIET
        and flight.log.input == "command"
        and flight.knows_torque
        and flight.log.timing == 0
        for flight in flights
    )
    return IDEAL_SENSORS if ideal else Tolerance()


def options_of(flights: Sequence[FlightResiduals], *, real: bool | None = None) -> Options:
    """Return the options of these flights (`widen_tolerance`).

    Args:
        real: whether their sensors are; None: as the logs look.
    """
    return widen_tolerance(
        Options.for_sensors(tolerance_of(flights).real if real is None else real), flights
    )


def widen_tolerance(options: Options, flights: Sequence[FlightResiduals]) -> Options:
    """Return the options whose tolerance holds what vehicle file and input of these flights leave
    open.
    """
    vehicle = flights[0].vehicle
    log_input = flights[0].log.input
    # Mass and thrust are at least as uncertain as the vehicle file states for its own.
    tolerance = dc.replace(
        options.tolerance,
        mass=max(options.tolerance.mass, vehicle.uncertainty("mass") or 0.0),
        thrust=max(options.tolerance.thrust, vehicle.uncertainty("thrust") or 0.0),
    )
    timing = command_timing(flights)
    # Where thrust and torque are logged as they act, a stated vehicle is all that is open.
    known_input = vehicle.measured and log_input == "command" and timing == 0
    unmeasured = tolerance.real and not (vehicle.described or known_input)
    open_: dict[str, Any] = {"timing": max(tolerance.timing, timing)}
    if flights[0].measured_rotors:
        open_["thrust"] = max(tolerance.thrust, ROTOR_SPEED_SCALE)
    if log_input == "normalised":
        known = vehicle.throttle is not None
        scale = vehicle.uncertainty("thrust") or IDENTIFIED_SCALE if known else THROTTLE_SCALE
        curve = IDENTIFIED_CURVE if known else THROTTLE_CURVE
        open_ |= {
            "thrust": max(tolerance.thrust, scale),
            "throttle_curve": max(tolerance.throttle_curve, curve),
        }
    if (
        log_input == "normalised" and not unmeasured
    ):  # the calibration of an unmeasured vehicle holds these
        open_ |= {
            "mounting": max(tolerance.mounting, HEALTHY.mounting),
            "latency": max(tolerance.latency, HEALTHY.latency),
        }
    priors = options.priors
    by_throttle = any(flight.log.input == "normalised" for flight in flights)
    if any(flight.earlier for flight in flights) and not by_throttle:
        # All rotors weaker by the same share at the same speed or commanded thrust, where one thing
        # attached does as much. Over throttle, propellers and motors change all alike.
        priors = dc.replace(priors, concerted_changes=(ThrustScale.identifier,))
    tolerance = dc.replace(tolerance, **open_, unmeasured=unmeasured)
    return dc.replace(options, tolerance=tolerance, priors=priors)


def command_timing(flights: Sequence[FlightResiduals]) -> float:
    """Return the deviation of the time at which a row's command acts [s].

    It is what the logs state, or half a row where motion is ahead of commands, as in a log of which
    rows were left out. A vehicle file can state that commands are held (`command_timing: held`).
    """
    if flights[0].measured_rotors:
        return 0.0
    stated = max(flight.log.timing for flight in flights)
    if flights[0].vehicle.described:
        return stated
    half = 0.5 * max(flight.log.step for flight in flights)
    shift, deviation = _early(flights, 0.5 * half)
    sampled = shift > EARLY * deviation and shift - 2 * deviation < half
    return max(stated, half) if sampled else stated


def _early(flights: Sequence[FlightResiduals], step: float) -> tuple[float, float]:
    """Return the time by which motion is ahead of the commands, and its standard deviation [s].

    Generalised least squares on the residual with all else in its noise.
    step: of the finite difference [s].
    """
    noise = fit_noise([flight.y for flight in flights], flights[0].grid.step)
    power = product = 0.0
    for flight in flights:
        column = predicted_residual(flight, [Term(ClockOffset(step))])
        column[:, 6:] = 0.0  # the commands alone
        white = noise.whiten(np.stack([column, flight.y], axis=-1), flight.name)
        power += float(np.sum(white[..., 0] ** 2))
        product += float(np.sum(white[..., 0] * white[..., 1]))
    if power == 0.0:
        return 0.0, np.inf
    return step * product / power, step / np.sqrt(power)
