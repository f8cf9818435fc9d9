import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.decision import inclusion
from np_drake.diagnosis.decision.causes import causes_of
from np_drake.diagnosis.decision.effect_size import size_of, within_calibration
from np_drake.diagnosis.decision.equivalence import indistinguishable
from np_drake.diagnosis.decision.held_out_test import least_log_bayes_factor, log_bayes_factor
from np_drake.diagnosis.fitting.swing_fit import WAYS
from np_drake.diagnosis.forward_model.prediction import predicted_residual
from np_drake.diagnosis.forward_model.term import Term
from np_drake.diagnosis.held_out.prediction import on_held_out
from np_drake.diagnosis.materiality import Size
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors.nuisance import drift_of
from np_drake.diagnosis.tolerance import IDEAL_SENSORS, Tolerance
from np_drake.effects.accelerometer_bias import AccelerometerBias
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.weak_rotor import WeakRotor

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)
PRIORS = REAL.priors
THRESHOLDS = REAL.thresholds
MATERIALITY = REAL.materiality

FELT = 0.01  # of the gap
PLAIN = {"materiality": MATERIALITY, "calibration": False, "sensor": False}


@pytest.mark.parametrize(
    "size, matters",
    [
        (Size(1.01 * MATERIALITY.effect_force, 0.0, FELT, 0.0), True),
        (Size(0.0, 1.01 * MATERIALITY.torque, FELT, 0.0), True),
        (Size(0.0, 0.0, 1.01 * MATERIALITY.gap, 0.0), True),
        (Size(9.0 * MATERIALITY.effect_force, 0.0, 0.99 * MATERIALITY.least_gap, 0.0), False),
        (
            Size(
                0.99 * MATERIALITY.effect_force,
                0.99 * MATERIALITY.torque,
                0.99 * MATERIALITY.gap,
                9.0,
            ),
            False,
        ),
    ],
    ids=["force", "torque", "gap", "a trace", "none"],
)
def test_an_effect_matters_by_force_torque_or_share(size, matters):
    assert size.material(**PLAIN) is matters


def test_in_a_laboratory_less_matters():
    faint = Size(1.01 * IDEAL.materiality.effect_force, 0.0, FELT, 0.0)
    assert not faint.material(**PLAIN)
    assert faint.material(**{**PLAIN, "materiality": IDEAL.materiality})
    assert not dc.replace(faint, force=0.99 * IDEAL.materiality.effect_force).material(
        **{**PLAIN, "materiality": IDEAL.materiality}
    )


def test_calibration_matters_by_force_alone_and_a_sensor_by_its_tolerance():
    wide = Size(0.0, 1.0, 1.0, 1.0)
    assert not wide.material(calibration=True, sensor=False, materiality=MATERIALITY)
    assert dc.replace(wide, force=0.03).material(calibration=True, sensor=False, materiality=MATERIALITY)
    assert not wide.material(calibration=False, sensor=True, materiality=MATERIALITY)
    assert dc.replace(wide, sensor=2.0).material(calibration=False, sensor=True, materiality=MATERIALITY)


@pytest.fixture(scope="module")
def drag(ranked):
    return ranked(LinearDrag(0.6, 0.6, 0.6))


def test_the_size_of_a_mass_is_its_share_of_the_weight(ranked):
    case = ranked(MassError(0.2), LinearDrag(0.6, 0.6, 0.6))
    i = next(k for k, t in enumerate(case.fit.terms) if isinstance(t.effect, MassError))
    found = size_of(case.fit, i, case.flights, case.ranking.noise, IDEAL_SENSORS)
    lift = np.concatenate([e.nominal[:, 2] for e in case.flights])
    expected = 0.2 / 2.2 * np.sqrt(np.mean(lift**2)) / (2.0 * 9.81)
    assert found.force == pytest.approx(expected, rel=0.02)
    assert found.torque < 0.02
    assert 0.5 < found.gap <= 1.0


def test_what_does_little_where_it_was_fitted_matters_by_what_it_does_on_an_unseen_flight(drag):
    i = next(k for k, t in enumerate(drag.fit.terms) if isinstance(t.effect, LinearDrag))
    args = (drag.fit, i, drag.flights, drag.ranking.noise, IDEAL_SENSORS)
    strong = [
        dc.replace(t, effect=LinearDrag(6.0, 6.0, 6.0)) if j == i else t
        for j, t in enumerate(drag.fit.everything)
    ]
    alone, beside = size_of(*args), size_of(*args, [(e, strong) for e in drag.flights])
    found = drag.fit.terms[i].effect.d_x
    assert beside.force == pytest.approx(alone.force * np.sqrt((1 + (6.0 / found) ** 2) / 2), rel=0.1)
    assert (beside.gap, beside.sensor) == (alone.gap, alone.sensor)


def test_the_size_of_a_sensors_error_is_in_its_tolerance(drag):
    fit = dc.replace(drag.fit, terms=(Term(GyroBias(0.03, 0.0, 0.04)),))
    found = size_of(fit, 0, drag.flights, drag.ranking.noise, Tolerance())
    assert found.sensor == pytest.approx(0.05 / Tolerance().rate)


def test_the_true_cause_is_named_with_its_parameters(drag):
    held = on_held_out(drag.fit, drag.held_out, drag.ranking.noise, priors=PRIORS)
    causes, _ = causes_of(drag.ranking, drag.fit, drag.flights, drag.held_out, held)
    (cause,) = causes
    assert cause.identifier == "linear_drag"
    assert cause.probability > 0.95
    assert cause.onset == {"a": None, "b": None, "c": None}
    for name in ("d_x", "d_y", "d_z"):
        estimate = cause.parameters[name]
        assert estimate.unit == "N·s/m"
        assert estimate.ci95[0] < 0.6 < estimate.ci95[1]
        assert estimate.value == pytest.approx(np.mean(estimate.ci95))
    assert cause.share == pytest.approx(1.0, abs=0.05)


def test_an_effect_too_small_to_matter_is_a_minor_finding(drag):
    fit = dc.replace(drag.fit, terms=(Term(WeakRotor(1, 0.9999)),), free=(), values=np.zeros(0))
    held = on_held_out(fit, drag.held_out, drag.ranking.noise, priors=PRIORS)
    causes, minor = causes_of(drag.ranking, fit, drag.flights, drag.held_out, held)
    assert causes == []
    assert [m.name for m in minor] == ["weak_rotor"]
    assert "\n" not in minor[0].text


def test_what_does_not_help_on_unseen_flights_is_no_cause(seen, drag):
    held_out = [seen(name="c", seed=3, noise=1.0, seconds=10.0)]  # without drag
    held = on_held_out(drag.fit, held_out, drag.ranking.noise, priors=PRIORS)
    assert held.terms["c"][0].begins("c") is None  # what acted in all flights of the fit is not excused here
    absent = [Term(LinearDrag(0.6, 0.6, 0.6)), *held.terms["c"][1:]]
    upside = dc.replace(held, terms={"c": absent}, whole_flight_terms={"c": absent})
    assert log_bayes_factor(drag.fit, 0, held_out, drag.ranking.noise, upside, {}, priors=PRIORS) < -2.0
    causes, minor = causes_of(drag.ranking, drag.fit, drag.flights, held_out, upside)
    assert causes == []
    assert "not confirmed" in minor[0].text


def test_an_effect_at_its_bound_is_no_cause(drag):
    fit = dc.replace(drag.fit, terms=(Term(LinearDrag(0.6, 0.6, -0.2)),), free=(), values=np.zeros(0))
    held = on_held_out(fit, drag.held_out, drag.ranking.noise, priors=PRIORS)
    causes, minor = causes_of(drag.ranking, fit, drag.flights, drag.held_out, held)
    assert causes == []
    assert "bound" in minor[0].text
    blown, _ = causes_of(drag.ranking, fit, drag.flights, drag.held_out, held, gusty=True)
    assert [c.identifier for c in blown] == ["linear_drag"]


def test_an_effect_whose_figures_may_all_be_none_is_no_cause(drag):
    fit = drag.fit
    held = on_held_out(fit, drag.held_out, drag.ranking.noise, priors=PRIORS)
    vague = dc.replace(fit, covariance=100.0 * np.eye(len(fit.values)))
    named, unnamed = (causes_of(drag.ranking, f, drag.flights, drag.held_out, held) for f in (fit, vague))
    assert [c.identifier for c in named[0]] == ["linear_drag"]
    assert unnamed[0] == []
    assert "none" in unnamed[1][0].text
    blown = causes_of(drag.ranking, vague, drag.flights, drag.held_out, held, gusty=True)
    assert [c.identifier for c in blown[0]] == ["linear_drag"]


def test_where_gusts_blow_the_drag_that_feels_them_matters_however_small(drag):
    fit = dc.replace(drag.fit, terms=(Term(LinearDrag(1e-3, 1e-3, 1e-3)),), free=(), values=np.zeros(0))
    held = on_held_out(fit, drag.held_out, drag.ranking.noise, priors=PRIORS)
    given = (drag.ranking, fit, drag.flights, drag.held_out, held)
    assert causes_of(*given)[0] == []
    assert [c.identifier for c in causes_of(*given, gusty=True)[0]] == ["linear_drag"]


def test_a_cause_helps_on_unseen_flights_by_what_it_explains(drag):
    held = on_held_out(drag.fit, drag.held_out, drag.ranking.noise, priors=PRIORS)
    assert log_bayes_factor(drag.fit, 0, drag.held_out, drag.ranking.noise, held, {}, priors=PRIORS) > 100.0


def test_what_begins_late_in_an_unseen_flight_alone_must_bring_there_what_its_onset_had_to(drag):
    held = on_held_out(drag.fit, drag.held_out, drag.ranking.noise, priors=PRIORS)
    late = {n: [dc.replace(t, onset={n: 9.0}) for t in terms] for n, terms in held.whole_flight_terms.items()}
    held = dc.replace(held, terms=late, whole_flight_terms=late)
    known = dc.replace(drag.fit, terms=tuple(dc.replace(t, onset={"a": 2.0}) for t in drag.fit.terms))
    asked = [
        log_bayes_factor(fit, 0, drag.held_out, drag.ranking.noise, held, {}, priors=PRIORS)
        for fit in (known, drag.fit)
    ]
    assert asked[0] > 0
    assert asked[1] == pytest.approx(asked[0] - PRIORS.new_onset_gain)


def test_a_flight_whose_own_sensor_is_off_does_not_speak_against_the_error_of_all(seen, ranked):
    case = ranked()
    terms = (Term(AccelerometerBias(0.3, 0.0, 0.0)), *case.fit.everything)
    fit = dc.replace(case.fit, terms=terms, calibration=())
    held_out = [seen(AccelerometerBias(0.12, 0.0, 0.0), name="c", seed=3, noise=1.0, seconds=10.0)]
    held = on_held_out(fit, held_out, case.ranking.noise, priors=PRIORS)
    rig = drift_of(held_out, case.ranking.noise, Tolerance(acceleration=0.1))
    strict, kind = (
        log_bayes_factor(fit, 0, held_out, case.ranking.noise, held, drift, priors=PRIORS)
        for drift in ({}, rig)
    )
    assert strict < -2.0 < kind
    assert drift_of(held_out, case.ranking.noise, IDEAL_SENSORS) == {}


def test_without_torque_mass_and_thrust_are_named_beside_each_other(seen, searched):
    vertical = (0.0, 0.0, 1.0, 0.0)
    flights = [seen(MassError(0.2), name=n, seed=i, noise=1.0, vigour=vertical) for i, n in enumerate("ab")]
    found = searched(flights)
    named = [found.problem.candidates[i].identifiers[0] for i in found.models[0].members]
    pair = {"mass_error", "thrust_scale"}
    (first,) = pair & set(named)
    (other,) = pair - {first}
    assert other in indistinguishable(found.problem, found.models[0])[first]


def test_what_the_motion_tells_apart_is_not_named_beside_it(drag):
    assert "gyro_bias" not in indistinguishable(drag.ranking.problem, drag.ranking.models[0])["linear_drag"]


def test_a_mass_that_comes_in_flight_is_no_error_of_the_file():
    rig = REAL
    assert within_calibration(Term(MassError(0.1)), rig)
    assert not within_calibration(Term(MassError(0.1), {"a": 3.0}), rig)
    assert not within_calibration(Term(MassError(0.1)), IDEAL)
    assert not within_calibration(Term(LinearDrag()), rig)


def test_the_figures_of_a_payload_are_known_no_better_than_the_motion_that_drives_it(ranked):
    case = ranked(SuspendedPayload(0.2, 0.6))
    held = on_held_out(case.fit, case.held_out, case.ranking.noise, priors=PRIORS)
    (cause,) = causes_of(case.ranking, case.fit, case.flights, case.held_out, held)[0]
    for name, true, error in (
        ("mass", 0.2, IDEAL.priors.pendulum_mass),
        ("length", 0.6, IDEAL.priors.pendulum_length),
    ):
        figure = cause.parameters[name]
        low, high = figure.ci95
        assert low < true < high
        assert high - low >= 2 * 1.95 * error * figure.value
    assert np.diff(cause.parameters["hook_z"].ci95) >= 2 * 1.95 * IDEAL.priors.pendulum_hook


@pytest.mark.parametrize(
    ("probability", "brought", "named"),
    [
        (IDEAL.thresholds.sure + 0.05, 0.9 * THRESHOLDS.seen_again, True),
        (IDEAL.thresholds.sure - 0.05, 0.9 * THRESHOLDS.seen_again, False),
        (THRESHOLDS.sure + 0.05, 1.1 * THRESHOLDS.seen_again, True),
        (THRESHOLDS.sure - 0.05, 1e3, False),
    ],
)
def test_a_name_that_is_not_sure_is_minor_unless_unseen_flights_bear_it_out(
    drag, monkeypatch, probability, brought, named
):
    monkeypatch.setattr(inclusion, "log_bayes_factor", lambda *_: brought)
    monkeypatch.setattr(inclusion, "least_log_bayes_factor", lambda *_: 0.0)
    held = on_held_out(drag.fit, drag.held_out, drag.ranking.noise, priors=PRIORS)
    odds = (probability / (THRESHOLDS.trust - probability)) ** (1 / THRESHOLDS.temper)
    doubted = dc.replace(drag.ranking, probability={"linear_drag": odds / (1 + odds)})
    causes, minor = causes_of(doubted, drag.fit, drag.flights, drag.held_out, held)
    assert ("linear_drag" in [c.identifier for c in causes]) is named
    assert any("not sure" in m.text for m in minor) is not named


@pytest.mark.parametrize(
    ("effect", "brought", "named"),
    [
        (WeakRotor(1, 0.9), 1e3, False),
        (CommandDelay(0.02), 1.5 * THRESHOLDS.hurt, True),
        (CommandDelay(0.02), 0.5 * THRESHOLDS.hurt, False),
        (GyroBias(0.1, 0.0, 0.0), 0.0, True),
    ],
)
def test_beside_a_payload_a_trace_of_a_force_is_what_no_pendulum_has_one_of_a_delay_that_is_seen_again_a_delay(
    ranked, monkeypatch, effect, brought, named
):
    case = ranked(SuspendedPayload(0.2, 0.6))
    monkeypatch.setattr(inclusion, "log_bayes_factor", lambda *_: brought)
    monkeypatch.setattr(inclusion, "least_log_bayes_factor", lambda *_: -1.0)
    monkeypatch.setattr(
        inclusion, "size_of", lambda *_: Size(0.1, 0.1, 0.5 * MATERIALITY.least_gap_beside_payload, 9.0)
    )
    fit = dc.replace(case.fit, terms=(*case.fit.terms, Term(effect)))
    sure = dc.replace(case.ranking, probability={effect.identifier: 0.999, "suspended_payload": 0.999})
    held = on_held_out(fit, case.held_out, case.ranking.noise, priors=PRIORS)
    named_ones = {c.identifier for c in causes_of(sure, fit, case.flights, case.held_out, held)[0]}
    assert named_ones == {"suspended_payload", *([effect.identifier] if named else [])}


def test_an_effect_may_cost_on_an_unseen_flight_a_share_of_what_it_brings(drag):
    least = least_log_bayes_factor(drag.fit, 0, drag.flights, drag.ranking.noise, {}, thresholds=THRESHOLDS)
    held = on_held_out(drag.fit, drag.flights, drag.ranking.noise, priors=PRIORS)
    brought = log_bayes_factor(drag.fit, 0, drag.flights, drag.ranking.noise, held, {}, priors=PRIORS)
    assert least == pytest.approx(-THRESHOLDS.hurt - THRESHOLDS.hurt_share * brought, rel=0.05)
    fit = dc.replace(drag.fit, terms=(*drag.fit.terms, Term(WeakRotor(1, 0.999))))
    nothing = least_log_bayes_factor(
        fit, len(drag.fit.terms), drag.flights, drag.ranking.noise, {}, thresholds=THRESHOLDS
    )
    assert nothing == pytest.approx(-THRESHOLDS.hurt, abs=0.5)


def test_what_is_left_of_an_unseen_flight_is_left_by_all_ways_a_payload_may_swing_there(drag):
    payload = Term(SuspendedPayload(0.01, 0.5, 0.0, 0.0, -0.05))
    fit = dc.replace(drag.fit, terms=(payload,), calibration=())
    held, (e,) = on_held_out(fit, drag.held_out, drag.ranking.noise, priors=PRIORS), drag.held_out
    (foreseen,), (whole,) = held.terms[e.name], held.whole_flight_terms[e.name]
    assert len(np.unique(foreseen.hidden[e.name], axis=0)) == WAYS
    assert whole.hidden[e.name].ndim == 1  # the one that fits the whole flight
    np.testing.assert_array_equal(held.residual[e.name], e.y - predicted_residual(e, [foreseen]))
