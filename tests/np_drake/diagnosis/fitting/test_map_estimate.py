"""Laws of the maximum a posteriori fit and its covariance."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.fitting import free_parameters, read, refine, scaled_jacobian, write
from np_drake.diagnosis.forward_model import NEVER, Term, predicted_residual
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import LINEAR, Candidate
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.rotor_gyroscopic import RotorGyroscopic
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.effects.weak_rotor import WeakRotor

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)
PRIORS = REAL.priors

SEEDS = 40


def deviation(fit) -> np.ndarray:
    return np.sqrt(np.diag(fit.covariance))


@pytest.mark.parametrize(
    "true, start",
    [
        ([LinearDrag(0.3, 0.1, 0.2)], [LinearDrag(0.0, 0.0, 0.0)]),
        ([MassError(0.25), LinearDrag()], [MassError(0.0), LinearDrag(0.1, 0.1, 0.1)]),
        ([MotorLag(0.045)], [MotorLag(0.03)]),
        ([CommandDelay(0.03)], [CommandDelay(0.02)]),
        ([WeakRotor(2, 0.85)], [WeakRotor(2, 1.0)]),
    ],
    ids=lambda effects: "+".join(e.identifier for e in effects),
)
def test_parameters_are_recovered_within_their_intervals(seen, noise, true, start):
    flight = seen(*true, noise=1.0, seconds=8.0)
    dut = refine([Term(e) for e in start], [], [flight], noise, temperature=1.0, priors=PRIORS)
    expected = read([Term(e) for e in true], dut.free)
    np.testing.assert_array_less(np.abs(dut.values - expected), 3.5 * deviation(dut))
    np.testing.assert_array_less(deviation(dut), 0.15 * np.maximum(np.abs(expected), 0.2))
    np.testing.assert_array_equal(read(dut.terms, dut.free), dut.values)


@pytest.mark.parametrize("lag", [(), (MotorLag(0.03),)], ids=["no lag", "lag"])
@pytest.mark.parametrize("kind", [ClockOffset, CommandDelay])
def test_a_time_shift_is_linearised_over_one_row_from_zero_too(seen, kind, lag):
    flight = seen(seconds=4.0)
    (parameter,) = kind.parameters
    others = [Term(e) for e in lag]
    now = [Term(kind.neutral()), *others]
    free = free_parameters(now[:1], [flight], {}, PRIORS)
    dut = scaled_jacobian(now, free, flight)[..., 0] / free[0].scale
    row = predicted_residual(flight, [Term(kind.of({parameter.name: flight.log.step})), *others])
    expected = (row - predicted_residual(flight, now)) / flight.log.step
    np.testing.assert_allclose(dut, expected, atol=1e-9 * np.abs(expected).max())
    assert np.linalg.norm(expected[:, 2]) > 0.1 * np.linalg.norm(expected[:, 3:6])


def test_a_rotor_of_negative_inertia_is_none(seen, noise):
    flight = seen(RotorGyroscopic(-1e-4), noise=1.0, seconds=6.0)
    dut = refine([Term(RotorGyroscopic(5e-5))], [], [flight], noise, temperature=1.0, priors=PRIORS)
    assert dut.values[0] == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("damping", [0.0, 0.25])
def test_a_payload_is_recovered_with_its_swing(seen, noise, damping):
    true = SuspendedPayload(0.2, 0.5, 0.0, 0.0, -0.05, damping)
    flight = seen(true, noise=1.0, seconds=7.0)
    dut = refine(
        [Term(SuspendedPayload(0.15, 0.46))], [], [flight], noise, temperature=1.0, priors=PRIORS
    )
    found = dut.terms[0].effect
    assert found.mass == pytest.approx(0.2, rel=0.05)
    assert found.length == pytest.approx(0.5, rel=0.03)
    assert found.hook_z == pytest.approx(-0.05, abs=0.02)
    assert found.damping == pytest.approx(damping, abs=0.05)  # [1/s]
    assert np.abs(dut.terms[0].hidden["a"]).max() < 0.2  # it begins at rest [rad, rad/s]


def test_95_percent_intervals_hold_the_truth_about_95_times_in_100(seen, noise):
    true = LinearDrag(0.3, 0.2, 0.25)
    inside = []
    for seed in range(SEEDS):
        flight = seen(true, seed=seed, noise=1.0, seconds=5.0)
        fit = refine(
            [Term(true)], [], [flight], noise, temperature=1.0, evaluations=2, priors=PRIORS
        )
        inside.append(np.abs(fit.values - [0.3, 0.2, 0.25]) < 1.96 * deviation(fit))
    assert 0.88 < np.mean(inside) < 1.0  # of 120: 0.95 less 3.5 sigma; some must miss


def test_the_residual_of_a_fit_is_what_its_terms_leave(seen, noise):
    flight = seen(MassError(0.2), noise=1.0, seconds=6.0)
    fit = refine([Term(MassError())], [], [flight], noise, temperature=1.0, priors=PRIORS)
    white = noise.whiten(fit.residual(flight))
    assert np.mean(white**2) == pytest.approx(1.0, abs=0.1)


def test_a_wrong_model_has_less_evidence(seen, noise):
    flight = seen(MassError(0.2), noise=1.0, seconds=6.0)
    right, wrong = (
        refine([Term(e)], [], [flight], noise, temperature=1.0, priors=PRIORS)
        for e in (MassError(), GyroBias())
    )
    assert right.log_evidence > wrong.log_evidence + 100


def test_calibration_moves_no_further_than_its_prior_lets_it(seen, noise):
    flight = seen(MassError(0.2), noise=1.0, seconds=6.0)
    tight, loose = (
        refine([], [(Term(MassError(0.0)), d)], [flight], noise, temperature=1.0, priors=PRIORS)
        for d in (1e-4, 1.0)
    )
    assert abs(tight.calibration[0].effect.delta_mass) < 0.02
    assert loose.calibration[0].effect.delta_mass == pytest.approx(0.2, rel=0.03)


def test_what_no_flight_tells_is_left_to_its_prior(seen, noise):
    dut = refine(
        [Term(MassError(0.1), {"a": NEVER})],
        [],
        [seen(seconds=5.0)],
        noise,
        temperature=1.0,
        priors=PRIORS,
    )
    (free,) = dut.free
    assert dut.values[0] == pytest.approx(free.neutral, abs=1e-6)
    assert deviation(dut)[0] == pytest.approx(free.scale)


def test_wander_takes_what_is_a_flights_own(seen, noise):
    flight = seen(noise=1.0, seconds=6.0)
    drift = np.zeros((*flight.y.shape, 1))
    drift[:, 2] = 1.0  # [N]
    pushed = dc.replace(flight, y=flight.y + 1.7 * drift[..., 0])
    sensor_drift = Candidate((), LINEAR, {"a": drift}, lambda c: [])
    fit = refine(
        [Term(LinearDrag(0, 0, 0))],
        [],
        [pushed],
        noise,
        temperature=1.0,
        linear=[sensor_drift],
        priors=PRIORS,
    )
    np.testing.assert_allclose(fit.sensor_drift["a"][:, 2], 1.7, atol=0.1)  # four sigma [N]
    np.testing.assert_array_equal(np.delete(fit.sensor_drift["a"], 2, axis=1), 0.0)
    assert abs(np.mean(fit.residual(pushed)[:, 2])) < 0.1


TERMS = [
    Term(WeakRotor(3, 0.9)),
    Term(SuspendedPayload(0.2, 0.7), {"b": NEVER}),
    Term(ThrustScale(0.95)),
]


def test_what_is_written_is_read(seen):
    flights = [seen(name=n, seed=i, seconds=4.0) for i, n in enumerate("ab")]
    free = free_parameters(TERMS, flights, {2: 0.01}, priors=PRIORS)
    values = np.linspace(0.1, 0.9, len(free))
    np.testing.assert_array_equal(read(write(TERMS, free, values), free), values)
    assert TERMS[0].effect.efficiency == 0.9  # the terms themselves stay


def test_choices_are_not_free_and_absent_payloads_do_not_swing(seen):
    flights = [seen(name=n, seed=i, seconds=4.0) for i, n in enumerate("ab")]
    free = free_parameters(TERMS, flights, {2: 0.01}, priors=PRIORS)
    assert [f.name for f in free if f.term == 0] == ["efficiency"]
    assert {f.flight for f in free if f.name == "swing"} == {"a"}
    assert [f.scale for f in free if f.term == 2] == [0.01]


@pytest.mark.parametrize("delay", [0.0262, 0.0271, 0.0287])
def test_forces_alone_tell_a_delay_wherever_between_two_rows_it_falls(seen, noise, delay):
    flight = seen(CommandDelay(delay), noise=1.0, seconds=8.0, name="1")
    deaf = np.ones(15)
    deaf[3:6] = 1e6  # to torque
    dut = refine(
        [Term(CommandDelay(delay))],
        [],
        [flight],
        dc.replace(noise, loudness={"1": deaf}),
        temperature=1.0,
        evaluations=1,
        priors=PRIORS,
    )
    assert deviation(dut)[0] < 0.1 * dut.free[0].scale
