"""Change points: the best onset of an effect in every flight, and candidates from there on.

Onsets are scanned by suffix sums of Gram matrices.
"""

import copy
import dataclasses as dc
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from np_drake.diagnosis.forward_model import NEVER
from np_drake.diagnosis.regressors import (
    PAYLOAD,
    Candidate,
    Onset,
    RegressionProblem,
    Sums,
    SwitchedRegressors,
    hidden_from,
    ordered_changes,
    switched,
    times_of_changes,
    wind_candidates,
)
from np_drake.diagnosis.residuals import LEAST_DURATION
from np_drake.diagnosis.selection.payload_search import AT_REST, PayloadSearch, payload_about
from np_drake.effects.library import effect_of
from np_drake.effects.mass_error import MassError
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.estimation.noise import scale_only
from np_drake.estimation.regression import places

COARSE = 5  # rows between instants that are tried at first
ONSET_EDGE = 0.7  # from either end of a flight, without onsets [s]
ONSET_SPAN = 0.4  # that holds an onset as likely as possible [s]
LEAST_ONSET_GAIN = 1.0  # log evidence, prior included, from which an onset is tried


class TriedOnsets:
    """Sums of a candidate at the tried instants of one flight, in order.

    Args:
        X: (m', 15, k) columns of the candidate.
        inside: rows that may be onsets.
    """

    def __init__(self, regressors: SwitchedRegressors, X: np.ndarray, inside: np.ndarray):
        self._regressors = regressors
        self._X = X
        self._suffix = regressors.suffix_sums(X)
        self.ends = self._suffix.rows([0, -1])  # from the start, and never
        self.start, self.never = self.ends.rows([0]), self.ends.rows([1])
        self.now = self.start
        self.onset: float | None = None
        self.inside = inside
        self.rows = inside[::COARSE]
        self.sums = regressors.begun(X, self._suffix, self.rows)

    def refine(self, profile: np.ndarray) -> None:
        """Add the untried rows about the best of the profile (n,)."""
        about = self.inside[np.abs(self.inside - self.rows[np.argmax(profile)]) < 2 * COARSE]
        rows = np.setdiff1d(about, self.rows)
        tried = np.concatenate([self.rows, rows])
        order = np.argsort(tried)
        self.rows = tried[order]
        self.sums = self.sums.joined(self._regressors.begun(self._X, self._suffix, rows), order)

    def most_likely(self, profile: np.ndarray) -> int:
        """Return the row in the middle of the span of `ONSET_SPAN` that most likely holds the
        onset.

        Source: own choice.
        """
        dense = np.interp(self.inside, self.rows, profile)
        weight = np.exp(dense - dense.max())
        width = max(1, round(ONSET_SPAN / (self._regressors.t[1] - self._regressors.t[0])))
        mass = (
            np.convolve(weight, np.ones(width), "valid")
            if width < len(weight)
            else np.array([weight.sum()])
        )
        first = int(np.argmax(mass))
        span = np.cumsum(weight[first : first + width])
        return int(self.inside[first + np.searchsorted(span, 0.5 * span[-1])])

    @property
    def begins(self) -> bool:
        """Whether it is settled on an instant of the flight."""
        return self.onset is not None and self.onset != NEVER

    def settle(self, row: int | None) -> None:
        """Settle on this row; None: from the start."""
        if row is None:
            self.now = self.start
            self.onset = None
        else:
            self.now = self._regressors.begun(self._X, self._suffix, np.array([row]))
            self.onset = float(self._regressors.t[row])


@dc.dataclass(frozen=True)
class Onsets:
    """Onsets of a candidate by flight [s] (infinite: absent), with prior, gain and log evidence.

    onset: where it does not act from the start.

    prior: log prior of all of them; gain: in log evidence over all from the start.
    evidence: log evidence of the candidate, over that of what is beside it alone.
    """

    onset: dict[str, float | None]
    prior: float
    gain: float
    evidence: float


Times = dict[str, tuple[float, ...]]  # at which the size of an effect changes, by flight [s]


class OnsetScan:
    """Log evidence of a candidate from any instant on, beside nuisance and members of a model."""

    def __init__(self, problem: RegressionProblem, members: Sequence[int] = ()):
        self.problem = problem
        self.members = members
        chosen = [*problem.nuisance, *(problem.candidates[i] for i in members)]
        scale = problem.temperature**-0.5
        # Either side of what begins is then as long as a flight that can be diagnosed.
        self._edge = edge = LEAST_DURATION if problem.options.tolerance.unmeasured else ONSET_EDGE
        # From which an effect may be absent, as they go on or were before.
        self._go_on = {
            flight.name for flight in problem.flights if flight.goes_on or flight.earlier
        }
        self._regressors: dict[str, SwitchedRegressors] = {}
        self._inside: dict[str, np.ndarray] = {}  # rows that may be onsets
        for flight in problem.flights:
            B = [c.columns[flight.name] for c in chosen]
            regressors = SwitchedRegressors(flight, problem.noise, flight.y, B, scale)
            late = regressors.t > regressors.t[0] + edge
            early = regressors.t < regressors.t[-1] - edge
            self._regressors[flight.name] = regressors
            self._inside[flight.name] = np.flatnonzero(late & early)
        self._owner = np.repeat([-1] * len(problem.nuisance) + [*members], [c.size for c in chosen])
        self._regress(members)

    def _regress(self, members: Sequence[int]) -> None:
        """Compute the posterior of the columns (b,) of nuisance and some of the members; the others
        are known to be zero.
        """
        b = len(self._owner)
        on = np.flatnonzero(np.isin(self._owner, [-1, *members]))
        self.covariance = np.zeros((b, b))
        self.mean = np.zeros(b)
        kept = [i for i in self.members if i in members]
        self.mean[on], self.covariance[np.ix_(on, on)] = self.problem.total.posterior(
            self.problem.columns(kept)
        )

    def given(self, members: Sequence[int]) -> "OnsetScan":
        """Return the scan beside nuisance and some of its members alone, from the same sums."""
        fewer = copy.copy(self)
        fewer._regress(members)
        return fewer

    def rough_evidence(self, candidate: Candidate) -> float:
        """Return the log evidence of a candidate at its best onsets, jumps of its columns apart."""
        suffix = {
            name: r.suffix_sums(candidate.columns[name]) for name, r in self._regressors.items()
        }
        start = {name: sums.rows([0]) for name, sums in suffix.items()}
        at = dict(start)
        for name, rows in self._inside.items():
            rest = [at[n] for n in at if n != name]
            profile = self._evidence(suffix[name].rows(rows), rest)
            now = self._evidence(start[name], rest)[0]
            if len(rows) and profile.max() > now:
                at[name] = suffix[name].rows([rows[np.argmax(profile)]])
        first, *others = at.values()
        return float(self._evidence(first, others)[0])

    def _suffixes_given_others(
        self, name: str, candidate: Candidate
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return for the first column of a candidate its X'X and X'y (m + 1,) over all rows of a
        flight from each row on, y less the posterior mean of what acts as well but for `PIECES`.
        """
        pieces = [c.variant == PIECES for c in self.problem.candidates]
        mean = np.where(np.append(pieces, False)[self._owner], 0.0, self.mean)
        regressors = self._regressors[name]
        column = candidate.columns[name][..., :1]
        suffix = regressors.suffix_sums(column, mean[regressors.at])
        return suffix.XX[:, 0, 0], suffix.Xy[:, 0]

    @property
    def _cost(self) -> float:
        """Log evidence that a change must bring, its prior among all rows of a flight included."""
        priors = self.problem.options.priors
        rows = max(len(r.t) for r in self._regressors.values())
        return priors.onset_gain - priors.onset + math.log(rows)

    def steps(self, candidate: Candidate) -> Times:
        """Return when the size of the first column of a candidate changes.

        Every size has its prior; no change follows another by less than `edge`.
        Source: optimal partitioning (Jackson et al. 2005).
        """
        times = Times()
        for name, regressors in self._regressors.items():
            rows = np.array([0, *self._inside[name][::COARSE], len(regressors.t)])
            XX, Xy = (sums[rows] for sums in self._suffixes_given_others(name, candidate))
            # [i, j]: of the rows from boundary i to boundary j.
            precision = 1.0 + XX[:, None] - XX
            product = Xy[:, None] - Xy
            gain = 0.5 * (product**2 / precision - np.log(np.maximum(precision, 1.0)))
            spans = (rows - rows[:, None]) * (regressors.t[1] - regressors.t[0])
            gain[spans < self._edge] = -np.inf
            gain[1:] -= self._cost
            best = np.zeros(len(rows))
            before = np.zeros(len(rows), int)
            for j in range(1, len(rows)):
                total = best[:j] + gain[:j, j]
                before[j] = np.argmax(total)
                best[j] = total[before[j]]
            ends = [len(rows) - 1]
            while ends[0]:
                ends.insert(0, int(before[ends[0]]))
            times[name] = tuple(regressors.t[rows[ends[1:-1]]].tolist())
        return times

    def changes(self, candidate: Candidate, sizes: Sequence[float]) -> Times:
        """Return when the first column of a candidate changes to the next of its sizes (k + 1,),
        the first of which it has from the start; infinite: not there.
        """
        times = Times()
        for name, regressors in self._regressors.items():
            barred = np.ones(len(regressors.t) + 1, bool)
            barred[[0, *self._inside[name], -1]] = False
            sums = self._suffixes_given_others(name, candidate)
            _, following = ordered_changes(*sums, sizes, self._cost, barred)
            times[name] = times_of_changes(np.append(regressors.t, NEVER), following, 0)
        return times

    def best(self, candidate: Candidate) -> Onsets:
        """Return the onsets at which the candidate explains the flights best.

        The prior is that of an instant as wide as the evidence leaves it: an onset that is known to
        a row has one in all rows, one that is known to half a flight has one half.
        """
        scans = {
            n: TriedOnsets(r, candidate.columns[n], self._inside[n])
            for n, r in self._regressors.items()
        }
        climbs = [self._climbed(scans)]
        # A climb begins where the effect would begin with parameters of each flight's own, no prior
        # asked. Flights that start from its beginning in all others may never leave it: a drift
        # from the start stands for a step in each.
        for scan in scans.values():
            profile = self._evidence(scan.sums, [])
            later = profile.max(initial=-np.inf) > self._evidence(scan.start, [])[0]
            scan.settle(scan.rows[np.argmax(profile)] if later else None)
        if sum(scan.begins for scan in scans.values()) > 1:
            climbs.append(self._climbed(scans))
        return max(climbs, key=lambda f: f.evidence + f.prior)

    def _climbed(self, scans: dict[str, TriedOnsets]) -> Onsets:
        """Return the onsets from where they are settled, flight by flight, the others as they
        are.
        """
        widths = dict[str, float]()
        prior = self.problem.options.priors.onset
        for _ in range(2):
            for name, scan in scans.items():
                rest = [s.now for n, s in scans.items() if n != name]
                profile = self._evidence(scan.sums, rest)
                # The log width of the profile's peak, in shares of the flight.
                widths[name] = -np.inf
                if len(profile):
                    scan.refine(profile)
                    profile = self._evidence(scan.sums, rest)
                    width = np.gradient(scan.rows) if len(scan.rows) > 1 else [1.0]
                    area = np.exp(profile - profile.max()) @ width
                    widths[name] = math.log(area / len(scan.inside))
                start, never = self._evidence(scan.ends, rest).tolist()
                may_lack = name in self._go_on and any(
                    s.begins for n, s in scans.items() if n != name
                )
                best = profile.max(initial=-np.inf) + (prior + widths[name])
                never += prior if may_lack else 0.0
                if best - max(start, never) > LEAST_ONSET_GAIN:
                    scan.settle(scan.most_likely(profile))
                elif may_lack and never - start > LEAST_ONSET_GAIN:
                    scan.now = scan.never
                    scan.onset = NEVER
                else:
                    scan.settle(None)
            if not any(scan.begins for scan in scans.values()):
                for scan in scans.values():
                    scan.settle(None)  # what begins nowhere lacks nowhere
                break
        onset: dict[str, float | None] = {
            name: scan.onset for name, scan in scans.items() if scan.onset is not None
        }
        prior = sum(widths[name] for name in onset if scans[name].begins) + prior * len(onset)
        all_of = ([getattr(scan, at) for scan in scans.values()] for at in ("now", "start"))
        now, start = (float(self._evidence(first, rest)[0]) for first, *rest in all_of)
        return Onsets(onset, prior, now - start, now)

    def _evidence(self, sums: Sums, rest: list[Sums]) -> np.ndarray:
        """Return (n,) the log evidence with these sums of one flight, each with those of the
        rest.
        """
        X = sums.XB
        at = sums.at
        covariance = self.covariance
        XX = sums.XX + sum(r.XX for r in rest)
        Xy = sums.Xy + sum(r.Xy for r in rest)
        XB_rest = np.zeros((X.shape[1], len(self._owner)))
        for r in rest:
            XB_rest[:, r.at] += r.XB[0]
        # B is integrated out by its Schur complement: X'X + 1 - X'B (1 + B'B)^-1 B'X, and X'y less
        # X'B times its mean. X'B is that of this flight, which differs from row to row, and that of
        # the rest.
        known = XB_rest @ covariance
        cross = X @ known[:, at].T
        flat = X.reshape(X.shape[0] * X.shape[1], X.shape[2]) @ covariance[np.ix_(at, at)]
        within = flat.reshape(X.shape) @ np.swapaxes(X, 1, 2)
        explained = within + cross + np.swapaxes(cross, 1, 2)
        A = XX + np.eye(XX.shape[1]) - explained - known @ XB_rest.T
        b = Xy - X @ self.mean[at] - XB_rest @ self.mean
        if b.shape[1] == 1:  # most effects
            return 0.5 * (b**2 / A[..., 0] - np.log(A[..., 0]))[:, 0]
        gain = np.sum(b * np.linalg.solve(A, b[..., None])[..., 0], axis=1)
        return 0.5 * (gain - np.linalg.slogdet(A)[1])


WEIGHTS = ((MassError.identifier,), (ThrustScale.identifier,))
MOST_COLUMNS = 8  # of a candidate that is scanned
VARIANTS = 2  # of an effect that are scanned


def switched_candidates(scan: OnsetScan) -> list[Candidate]:
    """Return for every effect that gains by an onset the candidate from its best onsets on.

    Every effect is tried alone, and beside those members of the scan that are another effect.
    """
    problem = scan.problem
    members = scan.members
    variants: dict[tuple[str, ...], list[Candidate]] = {}  # of effects that may begin in flight
    for c in problem.candidates:
        effects = [effect_of(name) for name in c.identifiers]
        sudden = all(f.sudden for f in effects) or not problem.options.tolerance.unmeasured
        if c.size <= MOST_COLUMNS and not c.onset and sudden and all(f.begins for f in effects):
            variants.setdefault(c.identifiers, []).append(c)
    kept: dict[tuple, Candidate] = {}
    for identifiers, same in variants.items():
        others = tuple(
            i for i in members if not set(identifiers) & set(problem.candidates[i].identifiers)
        )
        for scan_given in map(scan.given, dict.fromkeys([(), others])):
            for candidate in sorted(same, key=scan_given.rough_evidence)[-VARIANTS:]:
                at = scan_given.best(candidate)
                if at.onset:
                    late = switched(candidate, problem.flights, at.onset)
                    key = (late.identifiers, late.variant, tuple(sorted(at.onset.items())))
                    kept.setdefault(key, dc.replace(late, onset_prior=at.prior))
    return list(kept.values())


PIECES = "pieces"  # variant of a candidate that acts in pieces of flights, each of its size
STEP_ROUNDS = 4  # in which steps are sought, at most
MOST_CHANGES = 4  # of a load in a flight: more of them are wind; source: own choice


def _in_steps(
    problem: RegressionProblem, weight: Candidate, others: Sequence[int], least: float
) -> tuple[list[float], Times]:
    """Return the sizes of a weight, the first column of a candidate, in turn, alike in all flights
    and `least` apart, and when it changes to the next.

    Beside all `others` that may act. Steps that are too many do no harm at first: in their pieces
    they leave what else acts to its own columns, beside which they are sought anew.
    """
    steps = Times()
    scan = OnsetScan(problem, others)
    for _ in range(STEP_ROUNDS):
        before = steps
        steps = scan.steps(weight)
        if steps == before:
            break
        at = places(len(times) + 1 for times in steps.values())
        columns = {
            flight.name: np.zeros((*flight.y.shape, at[-1].stop)) for flight in problem.flights
        }
        for flight, place in zip(problem.flights, at, strict=True):
            begun = np.stack([flight.begun(t) for t in (None, *steps[flight.name], NEVER)], axis=-1)
            columns[flight.name][..., place] = weight.columns[flight.name][..., :1] * -np.diff(
                begun, axis=-1
            )
        pieces = dc.replace(weight, variant=PIECES, columns=columns, physical=None)
        scan = OnsetScan(problem.extended([pieces]), [*others, len(problem.candidates)])
    levels = [scan.mean[-at[-1].stop :][place] for place in at]
    most = max(map(len, levels))
    sizes = np.mean([place for place in levels if len(place) == most], axis=0).tolist()
    while len(sizes) > 1 and np.min(np.abs(np.diff(sizes))) < least:
        k = int(np.argmin(np.abs(np.diff(sizes))))
        sizes[k : k + 2] = [0.5 * (sizes[k] + sizes[k + 1])]
    return sizes, scan.changes(weight, sizes)


class _Load(NamedTuple):
    """A payload of 1 kg whose mass changes in flight.

    onset: by flight, when it is hung on [s]. ratios: of its mass after each change [1]. changes: by
    flight, the times of these [s]. begun: number of onsets and changes.
    """

    onset: Onset
    ratios: tuple[float, ...]
    changes: Times
    begun: int


def _loads(sizes: Sequence[float], changes: Times, earlier: Sequence[str]) -> Iterator[_Load]:
    """Yield the loads that steps of a weight may be.

    The lightest load is none, or the two lightest are, or no one is: where thrust is not known,
    steps of a weight tell no more.

    Args:
        sizes: of the weight, in turn [kg].
        changes: by flight, when it changes to the next [s].
        earlier: flights from before what is asked, which lack it.
    """
    order = np.argsort(sizes)
    for none in (order[:1], order[:2], order[:0]):
        loads = np.array(sizes) - min(sizes) + (not len(none))
        loads[none] = 0.0
        kept = np.flatnonzero(np.diff(loads)).tolist()
        late = int(loads[0] == 0.0)
        if len(kept) <= late:  # nothing changes after the begin
            continue
        times = {name: tuple(all_times[k] for k in kept) for name, all_times in changes.items()}
        onset: Onset = {name: min(of_flight) for name, of_flight in times.items() if late}
        onset |= dict.fromkeys(earlier, NEVER)
        later = {name: of_flight[late:] for name, of_flight in times.items()}
        base, *rest = [loads[0], *loads[1:][kept]][late:]
        ratios = tuple(float(load / base) for load in rest)
        begun = sum(t != NEVER for of_flight in times.values() for t in of_flight)
        yield _Load(onset, ratios, later, begun)


def changing_payloads(
    problem: RegressionProblem, lengths: np.ndarray | None = None
) -> list[Candidate]:
    """Return payloads whose mass changes in flight, as the steps of a weight show it; one that is
    hung on and stays is of `late_payloads`.

    Steps that no model has yet are in the slow noise, which would hide them: white noise does not.

    Args:
        lengths: of tethers (n,) [m]; default: `search_lengths`.
    """
    flights = problem.flights
    options = problem.options
    problem = problem.extended([], scale_only([problem.noise.rms[None]], problem.noise.step))
    plain = [c for c in problem.candidates if not c.onset]
    weights = [c for names in ((PAYLOAD,), WEIGHTS[0]) for c in plain if c.identifiers == names]
    if PAYLOAD in hidden_from(flights) or not weights:
        return []
    acting = [
        i
        for i, c in enumerate(problem.candidates)
        if c.size <= MOST_COLUMNS and not c.onset and PAYLOAD not in c.identifiers
    ]
    (unit,) = weights[0].terms(np.eye(weights[0].size)[0])
    heavy = next(iter(unit.effect.values.values()))
    least = options.materiality.force * flights[0].vehicle.mass / heavy  # [kg]
    sizes, changes = _in_steps(problem, weights[0], acting, least)
    if len(sizes) > 1 + MOST_CHANGES:
        return []
    others = [c for c in plain if c.size <= 3 and PAYLOAD not in c.identifiers]
    cost = options.priors.onset - math.log(max(len(flight.t) for flight in flights))
    candidates = []
    for load in _loads(sizes, changes, [flight.name for flight in flights if flight.earlier]):
        search = PayloadSearch(
            flights, options, load.onset, lengths, loads=load.ratios, changes=load.changes
        )
        followed = search.followed(problem.noise, problem.nuisance, others)
        if followed:
            guess, candidate = followed[0]
            onset = search.when(problem.noise, problem.nuisance, guess)
            guess = dc.replace(guess, onset=onset)
            sharp = payload_about(flights, guess, options.priors).candidate(flights)
            prior = load.begun * cost
            candidates.append(dc.replace(sharp, log_prior=candidate.log_prior, onset_prior=prior))
    return candidates


def late_payloads(
    scan: OnsetScan, late: list[Candidate], lengths: np.ndarray | None = None
) -> list[Candidate]:
    """Return payloads that begin where a weight does, as a payload at rest, a mass or a thrust
    shows it beside nuisance alone.

    A payload from the start that swings as it likes may explain more than such a weight; which is
    there is told later.
    """
    problem = scan.problem
    scan = scan.given(())
    if PAYLOAD in hidden_from(problem.flights):
        return []
    noise = problem.noise
    nuisance = problem.nuisance
    options = problem.options
    plain = [c for c in problem.candidates if not c.onset]
    weights = [c for c in plain if c.identifiers in WEIGHTS]
    for c in [c for c in plain if c.identifiers == (PAYLOAD,)][:1]:
        # Its mass and hook alone, as if its swing were known.
        weights.insert(
            0, dc.replace(c, columns={n: X[..., :AT_REST] for n, X in c.columns.items()})
        )
    least = options.priors.onset_gain
    onsets = map(scan.best, weights)
    heavy = [f for f in onsets if f.onset and f.gain + f.prior > least]
    if not heavy:
        return []
    best = max(heavy, key=lambda f: f.evidence + f.prior)
    unlike = [c for c in late if c.onset != best.onset]  # what begins when it does stands for it
    others = [
        c for c in (*problem.candidates, *unlike) if c.size <= 3 and PAYLOAD not in c.identifiers
    ]
    first = PayloadSearch(problem.flights, options, best.onset, lengths)
    guesses = [guess for guess, _ in first.followed(noise, nuisance, others)]
    if not guesses:
        return []
    onset = first.when(noise, nuisance, guesses[0])
    sharp = PayloadSearch(problem.flights, options, onset, lengths).from_guesses(
        noise, nuisance, guesses
    )
    return [dc.replace(c, onset_prior=best.prior) for _, c in sharp]


def _unchanged(c: Candidate) -> bool:
    """Return whether an effect is no change since earlier flights: clocks, sensors and the share of
    torque that acts are of each flight anew, and how a vehicle is made is of all.
    """
    made = all(effect_of(name).constant for name in c.identifiers)
    return made or (c.calibrated and c.identifiers not in WEIGHTS)


def new_conditions(problem: RegressionProblem) -> list[Candidate]:
    """Return the effects that may begin, each absent from some flights: from all training flights,
    where halves have joined them, and from those before what is asked.

    The air is always there: a new wind comes with a drag that acts in all flights. A change since
    earlier flights is what is asked, and costs no prior.
    """
    candidates = list[Candidate]()
    flights = problem.flights
    known = [
        (c, effect_of(c.identifiers[0]))
        for c in problem.candidates
        if len(c.identifiers) == 1 and not c.onset and not c.generic
    ]
    begin = [c for c, effect in known if effect.begins and not effect.has_hidden_state]
    changes = [c for c in begin if not _unchanged(c)]
    changes += [c for c, effect in known if effect.role == "change"]
    earlier = [flight.name for flight in flights if flight.earlier]
    for names in ([flight.name for flight in flights if not flight.goes_on], earlier):
        if not names or len(names) == len(flights):
            continue
        lacking: dict[str, float | None] = dict.fromkeys(names, NEVER)
        begun = changes if names == earlier else begin
        winds = wind_candidates(flights, begin, lacking)
        prior = problem.options.priors.onset * len(lacking) if names != earlier else 0.0
        late = (*(switched(c, flights, lacking) for c in begun), *winds)
        candidates += [dc.replace(c, onset_prior=prior) for c in late]
    return candidates
