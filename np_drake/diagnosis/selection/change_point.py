"""Change points: the best onset of an effect in every flight, from suffix sums of Gram matrices."""

import copy
import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np

from np_drake.diagnosis.regressors import (
    AT_REST,
    PAYLOAD,
    Candidate,
    RegressionProblem,
    Sums,
    SwitchedRegressors,
    SwitchedSums,
    switched,
)
from np_drake.diagnosis.selection.onset_grid import TriedOnsets, at_rows, possible_onsets
from np_drake.diagnosis.selection.payload_search import PayloadSearch
from np_drake.effects.library import effects_for
from np_drake.effects.mass_error import MassError
from np_drake.effects.thrust_scale import ThrustScale

WEIGHTS = ((MassError.identifier,), (ThrustScale.identifier,))
LEAST_GAIN = 1.0  # log evidence, prior included, from which an onset is tried
MOST_COLUMNS = 8  # of a candidate that is scanned
VARIANTS = 2  # of an effect that are scanned


def switched_candidates(problem: RegressionProblem, members: Sequence[int] = ()) -> list[Candidate]:
    """Return for every effect that gains by an onset the candidate from its best onsets on.

    members: of a model. Every effect is tried alone, and beside those members that are another effect.
    """
    found: list[Candidate] = []
    whole = OnsetScan(problem, members)
    for own, variants in _that_begin(problem).items():
        others = tuple(i for i in members if not set(own) & set(problem.candidates[i].identifiers))
        tried = [(c, whole.sums(c)) for c in variants]
        for scan in map(whole.beside, dict.fromkeys([(), others])):
            for candidate, sums in sorted(tried, key=lambda pair: scan.rough_evidence(pair[1]))[-VARIANTS:]:
                found_at = scan.best(candidate, sums)
                late = dc.replace(
                    switched(candidate, problem.flights, found_at.onset), onset_prior=found_at.prior
                )
                if found_at.onset and not any(_same(late, known) for known in found):
                    found.append(late)
    return found


def _same(a: Candidate, b: Candidate) -> bool:
    return (a.identifiers, a.variant, a.onset) == (b.identifiers, b.variant, b.onset)


def _that_begin(problem: RegressionProblem) -> dict[tuple[str, ...], list[Candidate]]:
    """Variants of the effects that may begin in flight."""
    library = effects_for(problem.flights[0].log.input)
    found: dict[tuple[str, ...], list[Candidate]] = {}
    for c in problem.candidates:
        scanned = c.size <= MOST_COLUMNS and not c.onset
        if scanned and all(library[name].begins for name in c.identifiers):
            found.setdefault(c.identifiers, []).append(c)
    return found


def late_payloads(problem: RegressionProblem, late: list[Candidate]) -> list[Candidate]:
    """Return payloads that begin where a weight does, as a payload at rest, a mass or a thrust shows it.

    A payload from the start that swings as it likes may explain more than such a weight; which is there is told later.
    """
    at_start = [c for c in problem.candidates if c.identifiers == (PAYLOAD,) and not c.onset]
    scan, options = OnsetScan(problem), problem.options
    weights = [_at_rest(c) for c in at_start[:1]]
    weights += [c for c in problem.candidates if c.identifiers in WEIGHTS and not c.onset]
    heavy = [f for f in map(scan.best, weights) if f.onset and f.gain + f.prior > options.priors.onset_gain]
    if not heavy:
        return []
    found = max(heavy, key=lambda f: f.evidence + f.prior)
    unlike = [c for c in late if c.onset != found.onset]  # what begins when it does stands for it
    others = [c for c in (*problem.candidates, *unlike) if c.size <= 3 and PAYLOAD not in c.identifiers]
    first = PayloadSearch(problem.flights, options, found.onset)
    guesses = [guess for guess, _ in first.followed(problem.noise, problem.nuisance, others)]
    if not guesses:
        return []
    onset = first.when(problem.noise, problem.nuisance, guesses[0])
    sharp = PayloadSearch(problem.flights, options, onset).from_guesses(
        problem.noise, problem.nuisance, guesses
    )
    return [dc.replace(c, onset_prior=found.prior) for _, c in sharp]


def _at_rest(payload: Candidate) -> Candidate:
    """Its mass and hook alone, as if its swing were known."""
    return dc.replace(payload, columns={n: X[..., :AT_REST] for n, X in payload.columns.items()})


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


class OnsetScan:
    """Log evidence of a candidate from any instant on, beside nuisance and members of a model."""

    def __init__(self, problem: RegressionProblem, members: Sequence[int] = ()):
        chosen = [*problem.nuisance, *(problem.candidates[i] for i in members)]
        scale = problem.temperature**-0.5
        self._options = problem.options
        self._go_on = {e.name for e in problem.flights if e.goes_on}
        self._flights: dict[str, SwitchedRegressors] = {}
        for e in problem.flights:
            columns = [c.columns[e.name] for c in chosen] or [np.zeros((*e.y.shape, 0))]
            B = np.concatenate(columns, axis=-1)
            self._flights[e.name] = SwitchedRegressors(e, problem.noise, e.y, B, scale)
        self._products = sum(f.products for f in self._flights.values())
        self._owner = np.repeat([-1] * len(problem.nuisance) + [*members], [c.size for c in chosen])
        self._regress(np.arange(len(self._owner)))

    def _regress(self, on: np.ndarray) -> None:
        """Posterior of these columns (b',) of what acts as well; the others are known to be zero."""
        b = len(self._owner)
        self._covariance, self._mean = np.zeros((b, b)), np.zeros(b)
        own = np.linalg.inv(np.eye(len(on)) + self._products[np.ix_(on, on)])
        self._covariance[np.ix_(on, on)] = own
        self._mean[on] = own @ self._products[on, -1]

    def beside(self, members: Sequence[int]) -> "OnsetScan":
        """Return the scan beside nuisance and some of its members alone, from the same sums."""
        fewer = copy.copy(self)
        fewer._regress(np.flatnonzero(np.isin(self._owner, [-1, *members])))
        return fewer

    def sums(self, candidate: Candidate) -> dict[str, SwitchedSums]:
        """Return the sums of a candidate's columns by flight, for `best` and `rough_evidence`."""
        return {name: SwitchedSums(f, candidate.columns[name]) for name, f in self._flights.items()}

    def rough_evidence(self, late: Mapping[str, SwitchedSums]) -> float:
        """Return the log evidence of a candidate (its `sums`) at its best onsets, jumps of its columns apart."""
        whole = {name: sums.whole for name, sums in late.items()}
        start = {name: at_rows(sums, [0]) for name, sums in whole.items()}
        at = dict(start)
        for name, f in self._flights.items():
            rows = possible_onsets(f.t)
            profile = self._evidence(at_rows(whole[name], rows), [at[n] for n in at if n != name])
            now = self._evidence(start[name], [at[n] for n in at if n != name])[0]
            if len(rows) and profile.max() > now:
                at[name] = at_rows(whole[name], [rows[np.argmax(profile)]])
        first, *rest = at.values()
        return float(self._evidence(first, rest)[0])

    def best(self, candidate: Candidate, sums: Mapping[str, SwitchedSums] | None = None) -> "Onsets":
        """Return the onsets at which the candidate explains the flights best.

        The prior is that of an instant as wide as the evidence leaves it: an onset that is known to a row has one in
        all rows, one that is known to half a flight has one half.
        """
        late = sums or self.sums(candidate)
        scans = {n: TriedOnsets(of, goes_on=n in self._go_on) for n, of in late.items()}
        found = [self._climbed(scans)]
        for scan in scans.values():
            self._settle_alone(scan)
        if sum(scan.begins for scan in scans.values()) > 1:
            found.append(self._climbed(scans))
        return max(found, key=lambda f: f.evidence + f.prior)

    def _settle_alone(self, scan: TriedOnsets) -> None:
        """Where the effect would begin with parameters of that flight's own, no prior asked: to climb from there.

        Flights that start from its beginning in all others may never leave it: a drift from the start stands for a
        step in each.
        """
        profile = self._evidence(scan.sums, [])
        late = profile.max(initial=-np.inf) > self._evidence(scan.start, [])[0]
        scan.settle(scan.rows[np.argmax(profile)] if late else None)

    def _climbed(self, scans: dict[str, TriedOnsets]) -> "Onsets":
        """From where they are settled, flight by flight, the others as they are."""
        widths = dict[str, float]()
        priors = self._options.priors
        for _ in range(2):
            for name, scan in scans.items():
                rest = [s.now for n, s in scans.items() if n != name]
                profile = self._evidence(scan.sums, rest)
                finer = scan.finer(profile)
                if len(finer):
                    scan.add(finer)
                    profile = self._evidence(scan.sums, rest)
                start, never = self._evidence(scan.ends, rest).tolist()
                others = any(s.begins for n, s in scans.items() if n != name)
                may_lack = others and scan.goes_on
                best, widths[name] = float(profile.max(initial=-np.inf)), scan.log_width(profile)
                best += priors.onset + widths[name]
                never += priors.onset if may_lack else 0.0
                if best - max(start, never) > LEAST_GAIN:
                    scan.settle(scan.most_likely(profile))
                elif may_lack and never - start > LEAST_GAIN:
                    scan.leave_out()
                else:
                    scan.settle(None)
            if not any(scan.begins for scan in scans.values()):
                break
        onset = _onsets(scans)
        begin = [widths[name] for name in onset if scans[name].begins]
        prior = sum(begin) + priors.onset * len(onset)
        all_of = ([getattr(scan, at) for scan in scans.values()] for at in ("now", "start"))
        now, start = (float(self._evidence(first, rest)[0]) for first, *rest in all_of)
        return Onsets(onset, prior, now - start, now)

    def _evidence(self, own: Sums, rest: list[Sums]) -> np.ndarray:
        """(n,) log evidence with these sums of one flight, each with those of the rest."""
        XX, XB, Xy = (part + sum(r[i] for r in rest) for i, part in enumerate(own))
        known = (XB.reshape(-1, XB.shape[2]) @ self._covariance).reshape(XB.shape) if XB.size else XB
        A = XX + np.eye(XX.shape[1]) - known @ np.swapaxes(XB, 1, 2)
        b = Xy - XB @ self._mean
        if b.shape[1] == 1:  # most effects
            return 0.5 * (b**2 / A[..., 0] - np.log(A[..., 0]))[:, 0]
        explained = np.sum(b * np.linalg.solve(A, b[..., None])[..., 0], axis=1)
        return 0.5 * (explained - np.linalg.slogdet(A)[1])


def _onsets(scans: Mapping[str, TriedOnsets]) -> dict[str, float | None]:
    """Of the flights in which it does not act from the start. What begins nowhere is absent from none."""
    if not any(scan.begins for scan in scans.values()):
        for scan in scans.values():
            scan.settle(None)
    return {name: scan.onset for name, scan in scans.items() if scan.onset is not None}
