import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.forward_model import NEVER
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import RegressionProblem, switched
from np_drake.diagnosis.regressors.library_regressors import _effect_candidates
from np_drake.diagnosis.selection.change_point import (
    OnsetScan,
    changing_payloads,
    late_payloads,
    switched_candidates,
)
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.weak_rotor import WeakRotor

REAL = Options.for_sensors(True)
PRIORS = REAL.priors


def problem_of(flights, noise, effects) -> RegressionProblem:
    candidates = [c for e in effects for c in _effect_candidates(type(e), flights, {})]
    return RegressionProblem(flights, noise, [], candidates, temperature=1.0, options=REAL)


@pytest.mark.parametrize("when", [2.0, 5.3, 9.0])
@pytest.mark.parametrize(
    "effect",
    [MassError(0.2), WeakRotor(2, 0.9), LinearDrag(0.6, 0.6, 0.6)],
    ids=lambda e: e.identifier,
)
def test_the_instant_is_found(seen, noise, effect, when):
    flights = [seen(effect, name="late", seed=1, noise=1.0, onset={effect.identifier: when})]
    problem = problem_of(flights, noise, [effect])
    right = [c for c in problem.candidates if c.variant in ("", "rotor=2")]
    dut = OnsetScan(problem).best(right[0])
    slack = 0.6 if isinstance(effect, LinearDrag) else 0.03  # a drag shows once there is speed [s]
    assert dut.onset["late"] == pytest.approx(when, abs=slack)
    assert dut.gain > 10.0


def test_what_has_not_begun_at_the_end_of_a_half_is_absent_from_it(seen, noise):
    effect = MassError(0.2)
    late = seen(effect, name="late", seed=1, noise=1.0, onset={"mass_error": 8.0})
    without = seen(name="without", seed=2, noise=1.0, seconds=6.0)
    for half in (dc.replace(without, goes_on=True), without):
        problem = problem_of([late, half], noise, [effect])
        dut = OnsetScan(problem).best(problem.candidates[0])
        assert dut.onset["late"] == pytest.approx(8.0, abs=0.03)
        assert dut.onset.get("without") == (NEVER if half.goes_on else None)
        if half.goes_on:
            assert 2 * PRIORS.onset - np.log(12.0 / 0.02) < dut.prior < 2 * PRIORS.onset


def test_a_payload_that_is_hung_on_in_flight_is_found_to_the_row(seen, noise):
    payload = SuspendedPayload(0.2, 0.5)
    onset = {"suspended_payload": 4.0}
    flights = [seen(payload, name="1", seed=1, noise=1.0, seconds=10.0, onset=onset)]
    problem = problem_of(flights, noise, [MassError(0.2)])
    scan = OnsetScan(problem)
    found = late_payloads(scan, switched_candidates(scan))
    assert {c.identifiers for c in found} == {("suspended_payload",)}
    assert found[0].onset["1"] == pytest.approx(4.0, abs=0.03)
    assert float(found[0].variant.removeprefix("length=")) == pytest.approx(0.5, rel=0.05)


def loaded(seen, mass, changes, **how):
    """Return flights of a payload of this mass, each with its changes."""
    how = {"noise": 1.0, "vigour": 0.1, "seconds": 12.0, "height": 40.0} | how
    payload = SuspendedPayload(mass, 0.5)
    return [
        seen(payload, name=str(i), seed=i, loads=loads, **how)
        for i, loads in enumerate(changes, start=1)
    ]


def test_a_load_that_is_hung_on_grows_and_is_dropped_is_found_to_the_row(seen, noise):
    onset = {"suspended_payload": 2.0}
    changes = [{5.2: 0.45, 8.5: 0.0}, {5.0: 0.45, 8.2: 0.0}]
    flights = loaded(seen, 0.2, changes, onset=onset)
    found = changing_payloads(problem_of(flights, noise, [MassError(0.2), LinearDrag()]))
    problem = problem_of(flights, noise, []).extended(found)
    dut = max(range(len(found)), key=lambda i: problem.score([i]))
    (term,) = found[dut].terms(problem.total.posterior(problem.columns([dut]))[0])
    assert term.effect.mass == pytest.approx(0.2, rel=0.1)
    assert term.loads == (pytest.approx(0.45, rel=0.05), 0.0)
    for e, loads in zip(flights, changes, strict=True):
        assert term.begins(e.name) == pytest.approx(2.0, abs=0.1)
        assert term.changes[e.name] == pytest.approx(tuple(loads), abs=0.05)


def test_what_one_flight_drops_another_carries_to_its_end(seen, noise):
    flights = loaded(seen, 0.3, [{5.0: 0.0}, {}])
    found = changing_payloads(problem_of(flights, noise, [MassError(0.2)]))
    (term,) = found[0].terms(np.eye(found[0].size)[0])
    assert term.loads == (0.0,)
    assert term.changes == {"1": (pytest.approx(5.0, abs=0.05),), "2": (NEVER,)}


def test_a_load_that_stays_has_no_changes(seen, noise):
    flights = loaded(seen, 0.3, [{}, {}])
    assert changing_payloads(problem_of(flights, noise, [MassError(0.2), LinearDrag()])) == []


def test_a_scan_beside_fewer_is_one_of_its_own_from_the_same_sums(seen, noise):
    drag, late = LinearDrag(0.6, 0.6, 0.6), MassError(0.2)
    onsets = {"1": 5.3, "2": 7.0}
    flights = [
        seen(drag, late, name=n, seed=int(n), noise=1.0, onset={"mass_error": when})
        for n, when in onsets.items()
    ]
    problem = problem_of(flights, noise, [drag, WeakRotor(), late])
    mass = next(c for c in problem.candidates if c.identifiers == ("mass_error",))
    whole = OnsetScan(problem, [0, 1])
    for members in ([], [0], [0, 1]):
        own, dut = OnsetScan(problem, members), whole.given(members)
        assert dut.rough_evidence(mass) == pytest.approx(own.rough_evidence(mass))
        found = dut.best(mass)
        assert found.onset == own.best(mass).onset == pytest.approx(onsets, abs=0.03)
        begun = problem.extended([switched(mass, flights, found.onset)])
        rest = begun.columns(members)
        both = np.r_[rest, begun.columns_of(len(problem.candidates))]
        evidence = begun.total.log_evidence(both) - begun.total.log_evidence(rest)
        assert found.evidence == pytest.approx(evidence, rel=1e-6)
