"""Laws of the gap reduction."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis import gap as dut
from np_drake.diagnosis.decision.causes import causes_of
from np_drake.diagnosis.decision.remainder import measure_remainder
from np_drake.diagnosis.decision.unexplained import LinearModel
from np_drake.diagnosis.forward_model import NEVER
from np_drake.diagnosis.held_out import on_held_out
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.diagnosis.result import ReplayGap
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)


@pytest.fixture(scope="module")
def solved(ranked):
    case = ranked(MassError(0.2), LinearDrag(0.6, 0.6, 0.6))
    held = on_held_out(case.fit, case.held_out, case.ranking.noise, priors=REAL.priors)
    causes, _ = causes_of(case.ranking, LinearModel(case.ranking), (), held)
    return case, held, causes


def reduction(case, held, causes, replay=None):
    noise = case.ranking.noise
    return dut.measure_gap_reduction(
        causes, noise, held, measure_remainder(causes, noise, held, (), REAL), replay
    )


def test_with_the_true_causes_the_gap_goes_down_to_the_noise(solved):
    case, held, causes = solved
    found = reduction(case, held, causes, None)
    assert found.before > 5.0
    assert found.after == pytest.approx(1.0, abs=0.1)
    assert found.fraction == pytest.approx(1.0, abs=0.02)
    assert found.ci95[0] <= found.fraction <= found.ci95[1]
    assert found.replay_before is None


def test_the_ladder_goes_down_cause_by_cause_from_nominal_to_the_floor(solved):
    case, held, causes = solved
    found = reduction(case, held, causes, None)
    assert [r.name for r in found.ladder] == [
        "nominal",
        "+ mass_error",
        "+ linear_drag",
        "noise floor",
    ]
    sizes = [r.residual for r in found.ladder[:-1]]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[0] == found.before
    assert sizes[-1] == pytest.approx(found.after)


def test_the_held_out_gain_of_a_cause_is_what_comes_back_without_it(solved):
    case, held, causes = solved
    gains = dict(
        zip(
            [c.identifier for c in causes],
            dut.held_out_gains(causes, case.ranking.noise, held),
            strict=True,
        )
    )
    assert all(0.0 < gain <= 1.01 for gain in gains.values())
    (alone,) = dut.held_out_gains(causes[:1], case.ranking.noise, held)
    ladder = reduction(case, held, causes[:1], None)
    assert alone == pytest.approx(ladder.fraction, abs=0.02)  # of the calibration


def test_a_cause_of_unknown_share_comes_last_on_the_ladder(solved):
    case, held, causes = solved
    blind = [dc.replace(c, share=np.nan) if c.identifier == "mass_error" else c for c in causes]
    for some in (blind, blind[::-1]):
        found = reduction(case, held, some, None)
        assert [r.name for r in found.ladder] == [
            "nominal",
            "+ linear_drag",
            "+ mass_error",
            "noise floor",
        ]


def test_without_causes_nothing_changes_and_the_replay_is_nominal(solved):
    case, held, _ = solved
    calls = []

    def replay(logs, effects):
        calls.append(([log.name for log in logs], [e.identifier for e, _ in effects]))
        return ReplayGap((0.5,), *(np.zeros((1, 3)) for _ in range(3)), 1)

    found = reduction(case, held, [], replay)
    assert found.after == pytest.approx(found.before, rel=0.01)  # of the calibration
    assert found.fraction == pytest.approx(0.0, abs=0.02)
    assert calls == [(["c"], [])]
    assert found.replay_after is None


def test_the_replay_gets_the_fitted_effects_and_their_onsets(solved):
    case, held, causes = solved
    calls = []

    def replay(logs, effects):
        calls.append(effects)
        return ReplayGap((0.5,), *(np.zeros((1, 3)) for _ in range(3)), 1)

    reduction(case, held, causes, replay)
    before, after = calls
    assert before == []
    assert {e.identifier for e, _ in after} == {"mass_error", "linear_drag"}
    assert all(onset == {"c": None} for _, onset in after)


@pytest.mark.parametrize("begin", [1.0, 7.5])
def test_to_the_replay_a_flight_begins_at_its_first_row(solved, begin):
    case, held, causes = solved
    calls = []

    def replay(logs, effects):
        calls.append((logs[0].t, effects))
        return ReplayGap((0.5,), *(np.zeros((1, 3)) for _ in range(3)), 1)

    (flight,) = case.held_out
    late = make_flight_residuals(dc.replace(flight.log, t=flight.log.t + 50.0), flight.vehicle)
    late = dc.replace(late, joined=np.arange(len(late.t)) < 100)
    terms = [dc.replace(t, onset={"c": 50.0 + begin}) for t in held.terms["c"]]
    begun = dc.replace(held, flights=[late], rows={"c": ~late.joined}, terms={"c": terms})
    reduction(case, begun, causes, replay)
    (_, _), (t, effects) = calls
    assert t[0] == pytest.approx(
        flight.t[100] - flight.log.t[0], abs=0.02
    )  # what a fit has seen is left out
    assert [onset["c"] for _, onset in effects] == pytest.approx([begin, begin])


@pytest.mark.parametrize(
    "onsets, first",
    [
        ((3.0, 4.0), 2.5),
        ((4.0, NEVER), 3.5),
        ((None, 4.0), 0.0),  # the other acts throughout
        ((NEVER, NEVER), 0.0),
        ((0.2, 0.2), 0.0),
        ((8.0, 8.5), 0.0),  # too little is left
    ],
)
def test_a_flight_is_replayed_from_where_a_cause_acts_on(solved, onsets, first):
    case, held, causes = solved
    calls = []

    def replay(logs, effects):
        calls.append(logs[0].t)
        return ReplayGap((0.5,), *(np.zeros((1, 3)) for _ in range(3)), 1)

    (flight,) = case.held_out
    begins = dict(zip((c.identifier for c in causes), onsets, strict=True))
    terms = [dc.replace(t, onset={"c": begins.get(t.effect.identifier)}) for t in held.terms["c"]]
    some = dc.replace(held, terms={"c": terms})
    reduction(case, some, causes, replay)
    before, after = calls
    np.testing.assert_array_equal(before, after)
    assert before[0] == pytest.approx(first, abs=1.5 * flight.log.step)
    assert before[-1] == flight.log.t[-1] - flight.log.t[0]


def test_the_replay_gets_of_gusts_what_is_predicted_of_them(solved):
    case, held, causes = solved
    calls = []

    def replay(logs, effects):
        calls.append([e for e, _ in effects])
        return ReplayGap((0.5,), *(np.zeros((1, 3)) for _ in range(3)), 1)

    gusts = GustyWind(1.0, 2.0, 3.0, 4.0, 0.5)
    blown = [dc.replace(causes[0], identifier="gusty_wind", effect=gusts)]
    reduction(case, held, blown, replay)
    (predicted,) = calls[1]
    assert predicted == dc.replace(gusts, deviation=0.0)


def test_a_simulator_that_refuses_the_effects_costs_the_replay_alone():
    warnings: list[str] = []

    def refuse(logs, effects):
        raise ValueError("no rigid body.")

    assert dut._with_effects(refuse, [], [("effect", {})], warnings) is None
    assert warnings == ["no replay with the effects: no rigid body."]
    assert dut._with_effects(refuse, [], [], warnings) is None
