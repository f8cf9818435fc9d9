"""Laws of the maximum a posteriori fit and its covariance."""

import numpy as np
import pytest

from np_drake.diagnosis.effect_prior import EffectPrior
from np_drake.diagnosis.fitting import (
    at_its_bound,
    free_parameters,
    impossible,
    interval,
    prior_whitening,
    read,
    refine,
    write,
)
from np_drake.diagnosis.forward_model import NEVER, Term
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import RegressionProblem
from np_drake.effects.base import Effect, prior_root
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.inertia_error import InertiaError
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.quadratic_drag import QuadraticDrag
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.vehicle import Vehicle

REAL = Options.for_sensors(True)
PRIORS = REAL.priors
SEEDS = 40


def deviation(fit) -> np.ndarray:
    return np.sqrt(np.diag(fit.covariance))


def fitted(terms, flight, noise, calibration=(), evaluations=8):
    problem = RegressionProblem([flight], noise, [], [], temperature=1.0, options=REAL)
    return refine(problem, terms, calibration, noise, evaluations)


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
    dut = fitted([Term(e) for e in start], flight, noise)
    expected = read([Term(e) for e in true], dut.free)
    np.testing.assert_array_less(np.abs(dut.values - expected), 3.5 * deviation(dut))
    np.testing.assert_array_less(deviation(dut), 0.15 * np.maximum(np.abs(expected), 0.2))
    np.testing.assert_array_equal(read(dut.terms, dut.free), dut.values)


@pytest.mark.parametrize("damping", [0.0, 0.25])
def test_a_payload_is_recovered_with_its_swing(seen, noise, damping):
    true = SuspendedPayload(0.2, 0.5, 0.0, 0.0, -0.05, damping)
    flight = seen(true, noise=1.0, seconds=7.0)
    dut = fitted([Term(SuspendedPayload(0.15, 0.46))], flight, noise)
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
        fit = fitted([Term(true)], flight, noise, evaluations=2)
        inside.append(np.abs(fit.values - [0.3, 0.2, 0.25]) < 1.96 * deviation(fit))
    assert 0.88 < np.mean(inside) < 1.0  # of 120: 0.95 less 3.5 sigma; some must miss


def test_calibration_moves_no_further_than_its_prior_lets_it(seen, noise):
    flight = seen(MassError(0.2), noise=1.0, seconds=6.0)
    tight, loose = (
        fitted([], flight, noise, [d])
        for d in (EffectPrior(MassError, {"delta_mass": width}) for width in (1e-4, 1.0))
    )
    assert abs(tight.calibration[0].effect.delta_mass) < 0.02
    assert loose.calibration[0].effect.delta_mass == pytest.approx(0.2, rel=0.03)


TERMS = [
    Term(WeakRotor(3, 0.9)),
    Term(SuspendedPayload(0.2, 0.7), {"b": NEVER}),
    Term(ThrustScale(0.95)),
]
KNOWN = {2: EffectPrior(ThrustScale, {"scale": 0.01})}


def test_what_is_written_is_read(seen):
    flights = [seen(name=n, seed=i, seconds=4.0) for i, n in enumerate("ab")]
    free = free_parameters(TERMS, flights, KNOWN, priors=PRIORS)
    values = np.linspace(0.1, 0.9, len(free))
    np.testing.assert_array_equal(read(write(TERMS, free, values), free), values)
    assert TERMS[0].effect.efficiency == 0.9  # the terms themselves stay


@pytest.mark.parametrize(
    "effect, at_end",
    [
        (ConstantWind(1.0, -15.0, 0.0), True),
        (BladeFlapping(-0.2), True),
        (ConstantWind(1.0, -14.0, 0.0), False),
        (MotorLag(0.0), False),  # neutral
        (LinearDrag(0.3, 0.0, 0.3), False),
        (WeakRotor(4, 0.9), False),  # a choice
    ],
    ids=str,
)
def test_a_figure_at_its_bound_is_none_unless_it_is_neutral(effect: Effect, at_end):
    assert at_its_bound(effect) is at_end


@pytest.mark.parametrize("height, possible", [(1.5, True), (0.4, False), (np.inf, True)])
def test_a_payload_hangs_clear_of_the_ground_at_the_top_of_a_flight(fit_at, height, possible):
    payload = SuspendedPayload(mass=0.1, length=1.0, damping=0.1)
    why = impossible(fit_at(payload, covariance=1e-4), 0, Vehicle(), height)
    assert (not why) is possible


def test_an_interval_is_that_of_the_figure_of_its_own_term(fit_at):
    fit = fit_at(LinearDrag(0.1, 0.2, 0.3), InertiaError(1.0, 1.1, 1.2), covariance=0.1)
    assert interval(fit, 1, "scale_yy") == pytest.approx((1.1 - 0.196, 1.1 + 0.196))
    assert interval(fit_at(WeakRotor(4, 0.9), covariance=0.1), 0, "rotor") == (4.0, 4.0)


@pytest.mark.parametrize("effect", [LinearDrag, QuadraticDrag, GyroBias])
def test_whitened_deviations_of_the_prior_are_independent(seen, monkeypatch, effect):
    monkeypatch.setattr(effect, "widens", False)  # a prior is as wide as it is typical
    flight, terms = seen(seconds=4.0), [Term(GyroBias()), Term(effect())]
    free = free_parameters(terms, [flight], {}, PRIORS)
    W, root = prior_whitening(terms, free), prior_root(effect, flight.vehicle)
    scaled = root / np.array([f.scale for f in free if f.term == 1])[:, None]
    np.testing.assert_allclose(W[3:, 3:] @ scaled, np.eye(3), atol=1e-12)
    np.testing.assert_array_equal(W[:3], np.eye(6)[:3])
