"""What the causes leave: noise, or something the library does not have, and whether that matters.

The best model, linear about its fit, has generic structure beside it: evidence of any part of
either. Every test returns the probability that something material is there, and its power.
residual: by flight, (m, 15) what a model leaves.

The remainder is what held-out flights show above the noise of the training flights and slow errors
of the attitude, and the structure in that noise that no effect explains. Its share of the gap has a
posterior over blocks of time and over whether each structure is there.
"""

import dataclasses as dc
from collections.abc import Collection, Mapping, Sequence
from functools import reduce
from operator import add
from typing import NamedTuple

import numpy as np
import scipy

from np_drake.diagnosis.fitting import prior_whitening, scaled_jacobian
from np_drake.diagnosis.forward_model import has_swing, predicted_residual, with_dependants
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import LINEAR, PREFIX, generic_candidates, prior_of
from np_drake.diagnosis.residuals import FORCE, TORQUE, WRENCH, FlightResiduals, low_pass
from np_drake.diagnosis.result import CHANNELS, Cause, Remainder, ResidualFinding
from np_drake.diagnosis.selection import Ranking
from np_drake.diagnosis.slow_force import gust_probability, residuals_of
from np_drake.effects.gusty_wind import GustyWind
from np_drake.estimation.map_fit import SCORE_BLOCK
from np_drake.estimation.noise import NoiseModel
from np_drake.estimation.regression import places
from np_drake.files.number_text import measure


class LinearModel:
    """Linear regression of the flights on the parameters of the best fit, sensor errors and generic
    structure.

    Generic structure has Gaussian coefficients of zero mean: it is a part of the disturbance's
    covariance, of low rank. It competes with the effects for the same evidence.
    Source: Laplace approximation about the fit.
    """

    def __init__(self, ranking: Ranking):
        fit = ranking.best
        problem = ranking.problem
        self.flights = problem.flights
        self.fit = fit
        self._priors = ranking.options.priors
        self.structure = generic_candidates(self.flights, self._priors)
        drifting = [c for c in problem.nuisance if c.variant == LINEAR]
        now = fit.everything
        free = fit.free
        root = np.linalg.inv(prior_whitening(now, free))
        away = np.array([(v - f.neutral) / f.scale for v, f in zip(fit.values, free, strict=True)])
        grams = []
        for flight in self.flights:
            # Linearised about the fit z0: y - h(z) = y - h(z0) + J (z0 - neutral) - J (z -
            # neutral), in scaled parameters.
            J = scaled_jacobian(now, free, flight)
            target = flight.y - predicted_residual(flight, now) + J @ away
            columns = [J @ root, *(c.columns[flight.name] for c in (*drifting, *self.structure))]
            grams.append(flight.gram(ranking.noise, columns, target))
        self._total = reduce(add, grams).tempered(problem.temperature)
        self._term_columns = {
            i: [k for k, f in enumerate(free) if f.term == i] for i in range(len(now))
        }
        first = len(free) + sum(c.size for c in drifting)
        self._nuisance = np.arange(len(free), first)
        self._columns = [np.r_[place] for place in places((c.size for c in self.structure), first)]

    def evidence(self, without: Collection[int] = (), structure: Sequence[int] = ()) -> float:
        """Return the log evidence, priors of structure included, without some terms and with some
        structure [nat].
        """
        priors = (self._priors.of_effect(self.structure[g].identifiers[0]) for g in structure)
        variants = sum(self.structure[g].log_prior for g in structure)
        return self._total.log_evidence(self._index(without, structure)) + sum(priors) + variants

    def select_structure(
        self, without: Collection[int] = (), first: Sequence[int] = ()
    ) -> tuple[float, tuple[int, ...]]:
        """Return the log evidence with the structure that describes the rest best, and that
        structure, by forward selection from `first`, one variant of each kind.
        """
        selected = tuple(first)
        best = self.evidence(without, first)
        while True:
            known = {self.structure[g].identifiers for g in selected}
            open_ = (g for g, c in enumerate(self.structure) if c.identifiers not in known)
            gain, g = max(
                ((self.evidence(without, (*selected, g)), g) for g in open_), default=(-np.inf, -1)
            )
            if gain <= best:
                return best, selected
            selected = (*selected, g)
            best = gain

    def log_odds(self, structure: Sequence[int]) -> list[float]:
        """Return the log odds of every term, priors included, against structure of any kind in its
        place [nat].
        """
        names = [t.effect.identifier for t in self.fit.terms]
        log_odds = []
        evidence = self.evidence((), structure)
        prior = prior_of(names, self._priors)
        for i in range(len(names)):
            gone = with_dependants(self.fit.terms, i)
            remaining = [name for k, name in enumerate(names) if k not in gone]
            others = max(self.select_structure(gone)[0], self.select_structure(gone, structure)[0])
            prior_odds = prior - prior_of(remaining, self._priors) + self.fit.onset_prior_of(i)
            log_odds.append(evidence - others + prior_odds)
        return log_odds

    def part(self, structure: Sequence[int], g: int, flight: FlightResiduals) -> np.ndarray:
        """Return the part (m, 15) of structure g in the channels of a flight, beside the rest of
        `structure`.
        """
        index = self._index((), structure)
        mean, _ = self._total.posterior(index)
        return self.structure[g].columns[flight.name] @ mean[np.isin(index, self._columns[g])]

    def _index(self, without: Collection[int], structure: Sequence[int]) -> np.ndarray:
        kept = [k for i, columns in self._term_columns.items() if i not in without for k in columns]
        return np.concatenate(
            [np.array(kept, int), self._nuisance, *(self._columns[g] for g in structure)]
        )


NEIGHBOURHOOD = 1.2  # of a line, to either side at most [Hz]
# and at most this factor: slow noise is steep, and its level is another an octave away [1]
OCTAVE = 2.0
# but at least so many over the flight's length, for a line of a short flight is wide itself [1]
LOBE = 4.0
# [Hz]
LOWEST = 0.4
HIGHEST = 15.0
SLOW_BAND = 1.0  # torque below it is compared with that in `MIDDLE` [Hz]
MIDDLE = (4.0, 8.0)  # [Hz]
BRIEF = 1.5  # below it a force is asked for bursts [Hz]
FILTER_EDGE = 1.0  # of a flight, where the filter errs [s]
NORMAL = 1.4826  # deviations of a normal variate that its median size is, inverted


@dc.dataclass(frozen=True)
class Line:
    """The strongest line of a channel: frequency [Hz], power over the median of its neighbours [1],
    RMS [unit].
    """

    channel: int
    frequency: float
    prominence: float
    rms: float


def strongest_line(
    flights: Sequence[FlightResiduals],
    residual: dict[str, np.ndarray],
    least: np.ndarray | float = 0.0,
) -> Line:
    """Return the strongest line of force and torque in body axes, over all flights together.

    It is the bin of the mean periodogram with the largest ratio to the median about it, material
    where one is; least: (6,) RMS of a material line [N, N·m].
    """
    rate = 1.0 / flights[0].grid.step
    size = 2 ** int(np.ceil(np.log2(max(len(flight.t) for flight in flights))))
    power = np.zeros((size // 2 + 1, 6))
    for flight in flights:
        y = residual[flight.name][:, WRENCH] - residual[flight.name][:, WRENCH].mean(axis=0)
        window = scipy.signal.windows.hann(len(y))[:, None]
        power += (
            np.abs(np.fft.rfft(y * window, size, axis=0)) ** 2 / np.sum(window**2) / len(flights)
        )
    frequency = np.fft.rfftfreq(size, 1 / rate)
    lobe = LOBE / max(flight.t[-1] - flight.t[0] for flight in flights)
    down = np.maximum(lobe, np.minimum(NEIGHBOURHOOD, frequency * (1 - 1 / OCTAVE)))
    up = np.maximum(lobe, np.minimum(NEIGHBOURHOOD, frequency * (OCTAVE - 1)))
    first = np.searchsorted(frequency, frequency - down)
    last = np.searchsorted(frequency, frequency + up, side="right")
    floor = np.stack([np.median(power[a:b], axis=0) for a, b in zip(first, last, strict=True)])
    inside = (frequency > LOWEST) & (frequency < min(HIGHEST, 0.4 * rate))
    ratio = np.where(inside[:, None], power / np.maximum(floor, 1e-300), 0.0)
    rms = np.sqrt(2 * scipy.ndimage.convolve1d(power, np.ones(5), axis=0, mode="constant") / size)
    matters = ratio * (rms >= least)
    k, channel = np.unravel_index(np.argmax(matters if matters.any() else ratio), ratio.shape)
    return Line(int(channel), float(frequency[k]), float(ratio[k, channel]), float(rms[k, channel]))


def slow_torque(
    flights: Sequence[FlightResiduals], residual: dict[str, np.ndarray]
) -> tuple[float, float, float, int]:
    """Return the largest ratio over axes of slow torque to that of gyro noise [1], its share [1],
    RMS [N·m], and axis.

    The share is of the slow torque of that axis before anything was explained. Differentiated white
    gyro noise, of a power proportional to frequency squared, is known from the middle band; noise
    of rotor speed is white.

    Args:
        residual: by flight, (m, 15) what a model leaves of it.
    """
    powers = np.zeros((3, 3))  # of slow torque, the middle band, and slow torque before
    for flight in flights:
        step = flight.grid.step
        edge = round(1 / (SLOW_BAND * step))
        tau, first = (
            y[:, TORQUE] - y[:, TORQUE].mean(axis=0) for y in (residual[flight.name], flight.y)
        )
        band = low_pass(tau, step, MIDDLE[1]) - low_pass(tau, step, MIDDLE[0])
        parts = np.stack([low_pass(tau, step, SLOW_BAND), band, low_pass(first, step, SLOW_BAND)])
        powers += np.mean(parts[:, edge:-edge] ** 2, axis=1)  # without filter edges
    slow, middle, before = powers
    rotors = sum(
        2 * SLOW_BAND * flight.grid.step * flight.rotor_noise[TORQUE] ** 2 for flight in flights
    )
    expected = SLOW_BAND**3 / (MIDDLE[1] ** 3 - MIDDLE[0] ** 3)
    ratio = slow / np.maximum(middle * expected + rotors, 1e-30)
    axis = int(np.argmax(ratio))
    rms = float(np.sqrt(slow[axis] / len(flights)))
    return float(np.sqrt(ratio[axis])), float(slow[axis] / max(before[axis], 1e-30)), rms, axis


HORIZON = 1.0  # after which it counts [s]
STARTS = 0.25  # between its starts [s]


def squared_position_errors(
    flight: FlightResiduals, wrench: np.ndarray, rows: np.ndarray
) -> np.ndarray:
    """Return the squared position errors (k,) that a wrench causes within `HORIZON`, to first order
    [m²].

    A simulator without it, started from the flight's state every `STARTS`, is off by as much: force
    moves the vehicle, and torque turns its thrust.
    Source: double integration along the flown attitude; gyroscopic coupling neglected.

    Args:
        wrench: (m, 6) in B on its grid [N, N·m].
        rows: (m,) bool, those that count.
    """
    step = flight.grid.step
    mass = flight.vehicle.mass
    n = max(2, round(HORIZON / step))
    first = np.arange(0, len(flight.t) - n, max(1, round(STARTS / step)))
    window = first[:, None] + np.arange(n + 1)
    window = window[rows[window].all(axis=1)]

    def integrated(rate: np.ndarray) -> np.ndarray:
        return scipy.integrate.cumulative_trapezoid(rate, dx=step, axis=1, initial=0.0)

    turning = np.einsum(
        "mij,mj->mi", flight.R_WB, wrench[:, TORQUE] @ np.linalg.inv(flight.vehicle.J).T
    )
    tilt = integrated(integrated(turning[window]))
    # Turned thrust pushes by no more than all of it.
    tilt = tilt / np.maximum(np.linalg.norm(tilt, axis=-1, keepdims=True), 1.0)
    lift = (flight.R_WB[..., 2] * flight.nominal[:, 2:3])[window]
    push = np.einsum("mij,mj->mi", flight.R_WB, wrench[:, FORCE])[window]
    moved = integrated(integrated((push + np.cross(tilt, lift)) / mass))[:, -1]
    return np.sum(moved**2, axis=1)


# Slope of a probability's logit in the logarithm of a ratio: no verdict depends on it; own choice.
STEEPNESS = 6.0
ALONG_PATH = "a force that goes with the path: with the place, or with the motion there"
OTHER_SPEED = "the same places at another speed"
SLOW_FORCE = ResidualFinding(
    "slow force",
    "a level force that comes and goes, of which no wind can be made",
    1.0,
    measurement=(
        "hover for 20 s each with two opposite headings: a tilt turns with the "
        "vehicle, air does not"
    ),
)


class Indication(NamedTuple):
    """Structure that the flights of a fit show.

    probability: that it is there and material [1].
    power: (6,) in the channels of the wrench [N², (N·m)²]. position: mean squared position error
        that it causes [m²].
    """

    probability: float
    finding: ResidualFinding
    power: np.ndarray
    position: float

    @classmethod
    def of(
        cls,
        probability: float,
        finding: ResidualFinding,
        flights: Sequence[FlightResiduals],
        wrench: Sequence[np.ndarray],
    ) -> "Indication":
        """Return the structure that is a wrench (m, 6) in each of the flights [N, N·m]."""
        moved = [
            squared_position_errors(flight, w, np.ones(len(w), bool))
            for flight, w in zip(flights, wrench, strict=True)
        ]
        power = np.mean(np.concatenate(wrench) ** 2, axis=0)
        return cls(probability, finding, power, float(np.mean(np.concatenate(moved))))


def find_unexplained(
    ranking: Ranking, linear: LinearModel, structure: Sequence[int], held_out: HeldOut
) -> tuple[list[Indication], Indication]:
    """Return the generic structure (positions) beside the best model and what the tests find in the
    residual of all flights, and a slow level force, which may be that of gusts.
    """
    options = ranking.options
    best = ranking.best
    flights = ranking.problem.flights
    both = residuals_of(ranking, held_out)
    hidden = has_swing(best.terms)
    slowly = gust_probability(ranking, held_out)
    tau = np.concatenate(
        [flight.nominal[:, 3:] - flight.nominal[:, 3:].mean(axis=0) for flight in flights]
    )
    commanded = np.sqrt(np.mean(np.sum(tau**2, axis=1)))
    # Least RMS force [N] and torque [N·m] of material structure.
    least = options.materiality.force * flights[0].weight, options.materiality.torque * commanded
    indications = [_indication(linear, structure, g, options, least) for g in structure]
    # A payload, whose swing may be lost, and gusts burst as well.
    if not (hidden or slowly > 0.5):
        indications.append(burst_test([*flights, *held_out.flights], both, options, least[0]))
    indications.append(_line_test(flights, held_out.flights, both, options, least))
    # A material slow torque that held-out flights show as well; hidden: whether a swing may
    # have been lost.
    shown = options.thresholds.held_out_share
    limit = options.thresholds.slow_torque_ratio
    ratio, share, rms, axis = slow_torque(flights, both)
    large = rms > least[1] and (share > shown or not hidden)
    again = slow_torque(held_out.flights, both)[0] > shown * limit
    probability = _above(ratio, limit) if large and again else 0.0
    finding = ResidualFinding(
        "slow torque",
        "a torque that comes and goes",
        ratio,
        {"ratio": ratio},
        "hover for a minute with rotor speed logged",
    )
    indications.append(
        Indication.of(
            probability,
            finding,
            flights,
            [_slow_part(flight, both, [3 + axis]) for flight in flights],
        )
    )
    return indications, Indication.of(
        slowly, SLOW_FORCE, flights, [_slow_part(flight, both, [0, 1]) for flight in flights]
    )


def _indication(
    linear: LinearModel,
    structure: Sequence[int],
    g: int,
    options: Options,
    least: tuple[float, float],
) -> Indication:
    """Return structure g beside the best model and the rest of `structure`."""
    flights = linear.flights
    candidate = linear.structure[g]
    rest = tuple(k for k in structure if k != g)
    there = float(scipy.special.expit(linear.evidence((), structure) - linear.evidence((), rest)))
    parts = [linear.part(structure, g, flight)[:, WRENCH] for flight in flights]
    part = np.concatenate(parts)
    force, torque = (
        float(np.sqrt(np.mean(np.sum(part[:, c] ** 2, axis=1)))) for c in (FORCE, TORQUE)
    )
    name = candidate.identifiers[0].removeprefix(PREFIX)
    finding = ResidualFinding(
        name,
        candidate.variant,
        force / flights[0].weight,
        {"force": force, "torque": torque, **candidate.figures},
        candidate.measurement,
    )
    if name == "place" and options.tolerance.unmeasured:
        finding = dc.replace(finding, name="path", text=ALONG_PATH, measurement=OTHER_SPEED)
    material = force >= least[0] or torque >= least[1]
    return Indication.of(there if material else 0.0, finding, flights, parts)


def burst_test(
    flights: Sequence[FlightResiduals],
    residual: dict[str, np.ndarray],
    options: Options,
    least: float,
) -> Indication:
    """Return a material burst, which neither noise nor sensors make.

    It is the largest slow force over the usual deviation of its axis, by the median of all flights.
    """
    parts = []
    times = []
    for e in flights:
        edge = min(round(FILTER_EDGE / e.grid.step), (len(e.t) - 1) // 2)
        inside = slice(edge, len(e.t) - edge)
        force = low_pass(residual[e.name][:, FORCE], e.grid.step, BRIEF)[inside]
        parts.append(force - np.median(force, axis=0))
        times += [(e.name, t) for t in e.t[inside].tolist()]
    sizes = np.abs(np.concatenate(parts))
    usual = NORMAL * np.median(sizes, axis=0)
    ratio = np.divide(sizes, usual, out=np.zeros_like(sizes), where=usual > 0)
    row, axis = map(int, np.unravel_index(np.argmax(ratio), ratio.shape))
    flight, time = times[row]
    size = float(sizes[row, axis])
    prominence = float(ratio[row, axis])
    probability = _above(prominence, options.thresholds.burst_ratio) if size > least else 0.0
    finding = ResidualFinding(
        "burst",
        f"a {CHANNELS[axis]} that comes now and then, as in {flight} at {time:.1f} s, "
        f"{measure(size, 'N')}",
        prominence,
        {"time": time, "force": size},
        "the same trajectory twice more",
    )
    return Indication.of(
        probability, finding, flights, [_slow_part(e, residual, [axis]) for e in flights]
    )


def _line_test(
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    residual: dict[str, np.ndarray],
    options: Options,
    least: tuple[float, float],
) -> Indication:
    """Return a material spectral line that held-out flights show as well."""
    thresholds = options.thresholds
    share = options.materiality.structure_share
    y = np.concatenate([flight.y[:, WRENCH] for flight in flights])
    smallest = np.maximum(np.sqrt(share * np.mean(y**2, axis=0)), np.repeat(least, 3))
    line = strongest_line(flights, residual, smallest)
    again = strongest_line(held_out, residual).prominence
    large = line.rms >= smallest[line.channel] and (
        again > thresholds.held_out_share * thresholds.line_ratio
    )
    probability = _above(line.prominence, thresholds.line_ratio) if large else 0.0
    finding = ResidualFinding(
        "line",
        f"a line in {CHANNELS[line.channel]} at {line.frequency:.2f} Hz",
        line.prominence,
        {"frequency": line.frequency, "rms": line.rms},
        "hover at two thrusts with rotor speed logged: an imbalance turns with the rotors",
    )
    channel = np.arange(6) == line.channel
    waves = [
        np.sqrt(2) * line.rms * np.sin(2 * np.pi * line.frequency * flight.t)[:, None] * channel
        for flight in flights
    ]
    return Indication.of(probability, finding, flights, waves)


def _slow_part(
    flight: FlightResiduals, residual: dict[str, np.ndarray], channels: Sequence[int]
) -> np.ndarray:
    """Return the slow part (m, 6) of some channels of a residual, without its mean."""
    slow = low_pass(residual[flight.name][:, WRENCH], flight.grid.step, SLOW_BAND)
    return (slow - slow.mean(axis=0)) * np.isin(np.arange(6), channels)


def _above(ratio: float, threshold: float) -> float:
    """Return the probability that a ratio is above what noise has: one half at the threshold."""
    return float(1 / (1 + (threshold / max(ratio, 1e-9)) ** STEEPNESS))


FEWEST = 8  # least number of blocks; they are shorter in short flights; own choice
REMAINDER_DRAWS = 400  # of the posterior
REMAINDER_SEED = 1  # of its draws, and of the noise
NOISES = 4  # draws of the noise of each flight
# A remainder is material that exceeds a stated size and the first share of the gap, below which it
# is nothing beside what is explained; and that exceeds the second, which is no explanation [1].
# Source: own choice.
NOTHING = 0.02
TOO_MUCH = 0.2
NEVER_LESS = 1e-6  # share that is left: that nothing is, no flight shows [1]
SURE_GAP = 0.025  # quantile of the gap that is above the noise where there is one [1]
ALONE = 0.95  # quantile of the position error that noise alone causes [1]; own choice


def measure_remainder(
    causes: Sequence[Cause],
    noise: NoiseModel,
    held_out: HeldOut,
    indications: Sequence[Indication],
    options: Options,
) -> Remainder:
    """Return what causes and calibration leave of the gap on held-out flights.

    Share, sizes and probability are of the same draws. The position error is not told where noise
    alone turns the thrust by a radian, beyond the first order.

    indications: of structure that no effect explains, whose power the noise model holds.
    """
    first = held_out.flights[0]
    vehicle = first.vehicle
    residuals = _before_and_after(causes, held_out)
    rng = np.random.default_rng(REMAINDER_SEED)
    power = noise.rms[WRENCH] ** 2
    scale = np.maximum(noise.rms[WRENCH], 1e-12) ** -2.0 * noise.active[WRENCH] / 6
    structure = _drawn_structure(indications, power, scale, rng)
    drift = np.zeros(6)
    drift[:2] = (options.tolerance.attitude * first.weight) ** 2
    squares = [
        np.stack([y[name][rows, WRENCH] ** 2 for y in residuals], axis=1)
        for name, rows in held_out.rows.items()
    ]
    excess = _drawn_means(squares, round(SCORE_BLOCK / first.grid.step), rng) - power - drift

    # Draws (n,) of what noise may hide: power [N², (N·m)²] and its share of that of the noise [1].
    structure_power = structure.there @ structure.powers
    hidden_power = np.minimum(structure.there @ (structure.powers @ scale), power @ scale)
    gap, remaining = (np.maximum(excess @ scale, 0.0) + hidden_power[:, None]).T

    # Squared position errors (n, 2) before and after [m²], and (n,) those of the structure.
    starts, by_noise = _position_errors(held_out, residuals, noise)
    moved = _drawn_means(starts, round(SCORE_BLOCK / STARTS), rng)
    hidden_moved = np.minimum(structure.there @ structure.squares, np.mean(by_noise))
    tilted = drift[FORCE].sum() * (HORIZON**2 / 2 / vehicle.mass) ** 2

    def sizes(
        excess: np.ndarray, power: np.ndarray, moved: np.ndarray, hidden_moved: np.ndarray
    ) -> list[np.ndarray]:
        """Return force [N], torque [N·m] and position error [m] beyond noise and slow errors of the
        attitude, with structure: before and after (…, 2), of draws or of their means.
        """
        beyond = np.maximum(excess, 0.0) + power[..., None, :]
        force, torque = (np.sqrt(beyond[..., part].sum(axis=-1)) for part in (FORCE, TORQUE))
        position = np.sqrt(np.maximum(moved - tilted, 0.0) + hidden_moved[..., None])
        return [force, torque, position]

    draws = (excess, structure_power, moved, hidden_moved)
    drawn_force, _, drawn_position = sizes(*draws)
    force, torque, position = sizes(*(values.mean(axis=0) for values in draws))
    alone = float(np.sqrt(np.quantile(by_noise, ALONE)))
    tells = alone < vehicle.gravity * HORIZON**2 / 12  # of a constant torque, a radian [m]

    remainder = Remainder(
        force=float(force[1]),
        torque=float(torque[1]),
        position=float(position[1]) if tells else np.nan,
        position_before=float(position[0]),
        noise=alone,
    )
    materiality = options.materiality
    least = materiality.remaining_force * first.weight
    large_before = force[0] >= least or remainder.position_before >= materiality.position
    if not (np.quantile(gap, SURE_GAP) > 0 and large_before):
        return remainder
    large = (drawn_force[:, 1] > least) | (drawn_position[:, 1] > materiality.position)
    shares = np.maximum(remaining / np.maximum(gap, 1e-12), NEVER_LESS)
    material = (shares > TOO_MUCH) | (large & (shares > NOTHING))
    low, high = np.quantile(shares, [0.025, 0.975])
    return dc.replace(
        remainder,
        share=float(np.median(shares)),
        ci95=(float(low), float(high)),
        probability=float(np.mean(material)),
    )


def _before_and_after(
    causes: Sequence[Cause], held_out: HeldOut
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return by flight the residuals (m, 15) against the file, and with the causes."""
    named = {c.identifier for c in causes}
    before = {flight.name: flight.against_file for flight in held_out.flights}
    after = held_out.remaining_residuals(named)
    # Of gusts the slow force is explained, though no simulator foresees it.
    for flight in held_out.flights if GustyWind.identifier in named else ():
        force = after[flight.name][:, FORCE]
        after[flight.name][:, FORCE] = force - low_pass(force, flight.grid.step, BRIEF)
    return before, after


class _Structure(NamedTuple):
    """Draws of the structure that no effect explains, as far as the noise holds it.

    there: (n, k) whether each is. powers: (k, 6) in the channels of the wrench [N², (N·m)²].
    squares: (k,) of the position error [m²].
    """

    there: np.ndarray
    powers: np.ndarray
    squares: np.ndarray


def _drawn_structure(
    indications: Sequence[Indication],
    power: np.ndarray,
    scale: np.ndarray,
    rng: np.random.Generator,
) -> _Structure:
    """Return draws of structure: what the noise of a `power` (6,) holds is no larger than that,
    however large a part is that others cancel; scale: (6,) of one over noise.
    """
    probability = np.array([i.probability for i in indications])
    there = rng.uniform(size=(REMAINDER_DRAWS, len(indications))) < probability
    uncapped = np.reshape([i.power for i in indications], (-1, 6))
    powers = np.minimum(uncapped, power)
    share = powers @ scale / np.maximum(uncapped @ scale, 1e-300)
    return _Structure(there, powers, share * [i.position for i in indications])


def _drawn_means(parts: Sequence[np.ndarray], size: int, rng: np.random.Generator) -> np.ndarray:
    """Return draws (`REMAINDER_DRAWS`, …) of the mean of the rows (m, …) of all flights, by blocks
    of `size` rows.
    """
    size = max(1, min(size, sum(map(len, parts)) // FEWEST))
    blocks = [
        block
        for part in parts
        for block in np.array_split(part, max(1, round(len(part) / size)))
        if len(block)
    ]
    sums = np.array([b.sum(axis=0) for b in blocks])
    counts = np.array([len(b) for b in blocks])
    drawn = rng.integers(0, len(blocks), (REMAINDER_DRAWS, len(blocks)))
    return (sums[drawn].sum(axis=1).T / counts[drawn].sum(axis=1)).T


def _position_errors(
    held_out: HeldOut, wrenches: Sequence[Mapping[str, np.ndarray]], noise: NoiseModel
) -> tuple[list[np.ndarray], np.ndarray]:
    """Return by flight the squared position errors (k, 2) that wrenches cause beyond those of
    noise, and those of noise alone (n,) [m²]; none and infinite where no start is left.
    """
    rng = np.random.default_rng(REMAINDER_SEED)
    moved = []
    by_noise = []
    for flight in held_out.flights:
        rows = held_out.rows[flight.name] | flight.outliers  # which are interpolated
        chance = np.array(
            [
                squared_position_errors(flight, _noise_of(noise, len(flight.t), rng), rows)
                for _ in range(NOISES)
            ]
        )
        seen = np.array(
            [
                squared_position_errors(flight, flight.bridged(y[flight.name])[:, WRENCH], rows)
                for y in wrenches
            ]
        )
        moved.append((seen - chance.mean(axis=0)).T)
        by_noise.append(chance.ravel())
    noise_errors = np.concatenate(by_noise)
    if not len(noise_errors):
        return [np.zeros((1, len(wrenches)))], np.array([np.inf])
    return moved, noise_errors


def _noise_of(noise: NoiseModel, rows: int, rng: np.random.Generator) -> np.ndarray:
    """Return a draw (rows, 6) of the noise of the wrench."""
    active = np.flatnonzero(noise.active[WRENCH])
    out = np.zeros((rows, 6))
    memory = 2 * noise.phi.shape[1]
    white = rng.normal(size=(len(active), rows + memory))
    driven = np.linalg.solve(noise.mixing[np.ix_(active, active)], white)
    for k, c in enumerate(active):
        out[:, c] = scipy.signal.lfilter([1.0], [1.0, *-noise.phi[c]], driven[k])[memory:]
    return out
