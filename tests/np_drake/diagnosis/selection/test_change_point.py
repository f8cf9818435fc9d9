import dataclasses as dc
from types import SimpleNamespace

import numpy as np
import pytest

from np_drake.diagnosis.forward_model import NEVER
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import RegressionProblem, library_candidates, switched
from np_drake.diagnosis.regressors.library import _effect_candidates
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.diagnosis.selection.change_point import (
    WEIGHTS,
    OnsetScan,
    _onsets,
    late_payloads,
    switched_candidates,
)
from np_drake.diagnosis.selection.payload_search import PayloadSearch
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.thrust_drift import ThrustDrift
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.flight_log import FlightLog
from np_drake.vehicle import Vehicle

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)
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


def test_what_acts_from_the_start_has_no_onset(seen, noise):
    effect = MassError(0.2)
    flights = [seen(effect, name=str(i), seed=i, noise=1.0) for i in (1, 2)]
    problem = problem_of(flights, noise, [effect])
    assert OnsetScan(problem).best(problem.candidates[0]).onset == {}
    assert switched_candidates(problem) == []


def test_in_a_flight_that_is_too_short_for_an_onset_nothing_begins(fly, noise):
    log = fly(MassError(0.2), name="short", seed=1, noise=1.0, seconds=3.3)
    columns = {f.name: getattr(log, f.name) for f in dc.fields(log)}
    slow = {k: v[::10] if isinstance(v, np.ndarray) else v for k, v in columns.items()}  # 10 Hz
    problem = problem_of(
        [make_flight_residuals(FlightLog(**slow), Vehicle())], noise, [MassError(0.2)]
    )
    assert OnsetScan(problem).best(problem.candidates[0]).onset == {}


def test_each_flight_has_its_own_onset(seen, noise):
    effect = MassError(0.2)
    early = seen(effect, name="early", seed=1, noise=1.0, onset={"mass_error": 3.0})
    late = seen(effect, name="late", seed=2, noise=1.0, onset={"mass_error": 8.0})
    always = seen(effect, name="always", seed=3, noise=1.0)
    problem = problem_of([early, late, always], noise, [effect])
    dut = OnsetScan(problem).best(problem.candidates[0])
    assert dut.onset.keys() == {"early", "late"}
    assert dut.onset["early"] == pytest.approx(3.0, abs=0.03)
    assert dut.onset["late"] == pytest.approx(8.0, abs=0.03)
    late = next(c for c in switched_candidates(problem) if c.identifiers == ("mass_error",))
    assert late.onset == dut.onset
    assert late.log_prior == problem.candidates[0].log_prior
    rows = round((12.0 - 2 * 0.7) / 0.02)
    assert 2 * PRIORS.onset - 2 * np.log(rows) <= late.onset_prior < 2 * PRIORS.onset - np.log(rows)


def test_a_step_in_every_flight_is_no_drift_from_the_start(seen, noise):
    step = ThrustDrift(1.004, 0.0)
    whens = {"1": 5.0, "2": 5.0}
    flights = [
        seen(step, name=n, seed=int(n), noise=1.0, onset={"thrust_drift": when})
        for n, when in whens.items()
    ]
    problem = problem_of(flights, noise, [step])
    dut = OnsetScan(problem).best(problem.candidates[0])
    assert dut.onset == pytest.approx(whens, abs=0.2)


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


def test_what_begins_nowhere_is_absent_from_none():
    def settle(row):
        half.onset = row

    half = SimpleNamespace(begins=False, onset=NEVER, settle=settle)
    whole = SimpleNamespace(begins=True, onset=3.0, settle=settle)
    assert _onsets({"half": half, "whole": whole}) == {"half": NEVER, "whole": 3.0}
    assert _onsets({"half": half}) == {}


def test_gain_is_over_all_from_the_start_however_many_begin(seen, noise):
    effect = MassError(0.2)
    whens = {"1": 4.0, "2": 6.0, "3": 8.0}
    flights = [
        seen(effect, name=n, seed=int(n), noise=1.0, onset={"mass_error": when})
        for n, when in whens.items()
    ]
    problem = problem_of(flights, noise, [effect])
    scan = OnsetScan(problem)
    dut = scan.best(problem.candidates[0])
    assert dut.onset.keys() == whens.keys()
    start = [
        tuple(part[[0]] for part in of.whole) for of in scan.sums(problem.candidates[0]).values()
    ]
    assert dut.gain == pytest.approx(dut.evidence - scan._evidence(start[0], start[1:])[0])


def test_an_effect_begins_in_no_flight_that_shows_nothing_of_it(seen, noise):
    drag = LinearDrag(0.6, 0.6, 0.6)
    flights = [seen(drag, name="moves", seed=1, noise=1.0)]
    flights += [seen(drag, name=f"hovers {i}", seed=i, noise=1.0, vigour=0.0) for i in range(2, 10)]
    problem = problem_of(flights, noise, [drag])
    assert OnsetScan(problem).best(problem.candidates[0]).onset == {}


def test_of_the_variants_that_begin_late_those_go_on_that_explain_most(seen, noise):
    lag = MotorLag(0.04)
    flights = [
        seen(lag, name=str(i), seed=i, noise=0.1, vigour=1.5, onset={"motor_lag": when})
        for i, when in ((1, 5.0), (2, 6.0))
    ]
    problem = problem_of(flights, noise, [lag])
    scan = OnsetScan(problem)
    whole = {c.variant: scan.best(c).evidence for c in problem.candidates}
    dut = {c.variant: scan.rough_evidence(scan.sums(c)) for c in problem.candidates}
    assert max(dut, key=dut.__getitem__) in sorted(whole, key=whole.__getitem__)[-2:]


def test_noise_alone_begins_nowhere(seen, noise):
    flights = [seen(name=str(i), seed=i, noise=1.0, seconds=8.0) for i in (1, 2)]
    problem = RegressionProblem(
        flights, noise, [], library_candidates(flights), temperature=2.0, options=REAL
    )
    assert switched_candidates(problem) == []


def test_an_onset_is_found_beside_what_else_acts(seen, noise):
    drag, late = LinearDrag(0.6, 0.6, 0.6), MassError(0.2)
    flights = [seen(drag, late, name="1", seed=1, noise=1.0, onset={"mass_error": 5.3})]
    problem = problem_of(flights, noise, [drag, late])
    dut = OnsetScan(problem, [0]).best(problem.candidates[1])
    assert dut.onset["1"] == pytest.approx(5.3, abs=0.03)


def test_a_scan_beside_fewer_is_one_of_its_own_from_the_same_sums(seen, noise):
    drag, late = LinearDrag(0.6, 0.6, 0.6), MassError(0.2)
    whens = {"1": 5.3, "2": 7.0}
    flights = [
        seen(drag, late, name=n, seed=int(n), noise=1.0, onset={"mass_error": when})
        for n, when in whens.items()
    ]
    turn, *candidates = problem_of(
        flights, noise, [CenterOfMassOffset(), drag, WeakRotor(), late]
    ).candidates
    problem = RegressionProblem(flights, noise, [turn], candidates, temperature=1.0, options=REAL)
    mass = next(c for c in problem.candidates if c.identifiers == ("mass_error",))
    whole = OnsetScan(problem, [0, 1])
    sums = whole.sums(mass)
    for members in ([], [0], [0, 1]):
        own, dut = OnsetScan(problem, members), whole.given(members)
        assert dut.rough_evidence(sums) == pytest.approx(
            own.rough_evidence(own.sums(mass)), rel=1e-9
        )
        expected, found = own.best(mass), dut.best(mass, sums)
        assert found.onset == expected.onset
        assert (found.prior, found.gain, found.evidence) == pytest.approx(
            (expected.prior, expected.gain, expected.evidence), rel=1e-9
        )
        begun = problem.extended([switched(mass, flights, found.onset)])
        rest = begun.columns(members)
        own = np.r_[rest, begun.columns_of(len(problem.candidates))]
        evidence = begun.total.log_evidence(own) - begun.total.log_evidence(rest)
        assert found.evidence == pytest.approx(evidence, rel=1e-6)


def test_a_vague_onset_costs_less_than_a_sharp_one(seen, noise):
    priors = []
    for size in (0.01, 0.2):
        flights = [seen(MassError(size), name="1", seed=1, noise=1.0, onset={"mass_error": 5.3})]
        dut = OnsetScan(problem_of(flights, noise, [MassError()]))
        candidate = problem_of(flights, noise, [MassError()]).candidates[0]
        priors.append(dut.best(candidate).prior)
    assert priors[1] < priors[0] - 0.5


def test_a_payload_that_is_hung_on_in_flight_is_found_to_the_row(seen, noise):
    payload = SuspendedPayload(0.2, 0.5)
    onset = {"suspended_payload": 4.0}
    flights = [seen(payload, name="1", seed=1, noise=1.0, seconds=10.0, onset=onset)]
    problem = problem_of(flights, noise, [MassError(0.2)])
    found = late_payloads(problem, switched_candidates(problem))
    assert {c.identifiers for c in found} == {("suspended_payload",)}
    assert found[0].onset["1"] == pytest.approx(4.0, abs=0.03)
    assert float(found[0].variant.removeprefix("length=")) == pytest.approx(0.5, rel=0.05)


def test_what_begins_when_it_does_stands_for_it_and_is_not_beside_it(seen, noise, monkeypatch):
    payload = SuspendedPayload(0.2, 0.5)
    flights = [
        seen(payload, name="1", seed=1, noise=1.0, seconds=10.0, onset={"suspended_payload": 4.0})
    ]
    problem = problem_of(flights, noise, [MassError(0.2)])
    weight = OnsetScan(problem).best(problem.candidates[0])
    drag = _effect_candidates(LinearDrag, flights, {})[0]
    then, later = (switched(drag, flights, onset) for onset in (weight.onset, {"1": 7.0}))
    beside = []
    monkeypatch.setattr(
        PayloadSearch, "followed", lambda self, noise, nuisance, others: beside.extend(others) or []
    )
    assert late_payloads(problem, [then, later]) == []
    assert any(c is later for c in beside)
    assert not any(c is then for c in beside)


def test_it_is_sought_if_one_from_the_start_explains_more_than_its_cost(seen, noise):
    payload = SuspendedPayload(0.4, 0.55)
    onset = {"suspended_payload": 1.5}
    flights = [seen(payload, name="1", seed=1, noise=1.0, seconds=10.0, onset=onset)]
    plain = library_candidates(flights)
    at_start = PayloadSearch(flights, options=REAL).best(noise, [], plain)
    problem = RegressionProblem(
        flights, noise, [], [*plain, *at_start], temperature=2.0, options=REAL
    )
    scores = [problem.score((len(plain) + k,)) for k in range(len(at_start))]
    scan = OnsetScan(problem)
    weights = [scan.best(c) for c in plain if c.identifiers in WEIGHTS]
    assert max(scores) > max(w.evidence + w.prior for w in weights)
    found = late_payloads(problem, switched_candidates(problem))
    assert found[0].onset["1"] == pytest.approx(1.5, abs=0.05)
