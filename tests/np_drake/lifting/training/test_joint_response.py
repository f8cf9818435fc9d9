"""Encoder and B in one fit, on a made-up flight that repeats itself and on one that does not."""

from functools import cache

import numpy as np
import pytest

from np_drake.lifting.training.train import make_config, train
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.skill.skill import model_predictions
from np_drake.training_data.segments import Segment

STEP, HORIZONS = 0.02, [5, 10, 20, 38]


@cache
def flight(rate: float, seed: int, n: int = 1500) -> Segment:
    """Force is a level and a drag that lags 0.1 s behind the velocity, which circles with a dither; rate [rad/s]."""
    generator = np.random.default_rng(seed)
    t = STEP * np.arange(n)[:, None]
    zeta = np.cos(rate * t + np.arange(6)) + 0.01 * generator.standard_normal((n, 6))
    for w in (0.6, 2.3, 3.7, 5.1):
        zeta += 0.15 * np.cos(w * t + generator.uniform(0, 6.3, 6))
    chi = np.zeros((n, 6))
    for k in range(n - 1):
        chi[k + 1, :3] = 0.8 * chi[k, :3] - 0.1 * zeta[k, :3]
    return Segment(chi + [0, 0, -2.5, 0, 0, 0], zeta, STEP)


@cache
def trained(joint: bool = True):
    """The model of one flight; trained once."""
    return train([flight(1.5, 0)], make_config("dictionary", joint=joint)).model


def error(joint: bool, *, zeta_known: bool) -> np.ndarray:
    """(horizons,) RMSE of the force on a track of other rates than that of the training [N]."""
    model = trained(joint)
    unseen, origins = flight(2.9, 1), np.arange(200, 1400)
    chi = model_predictions(
        NeuralPredictor(model), unseen.chi, unseen.zeta, origins, HORIZONS, zeta_known=zeta_known
    )
    rest = (chi - unseen.chi[origins[:, None] + HORIZONS])[..., :3]
    return np.sqrt(np.mean(np.sum(rest**2, axis=-1), axis=0))


def test_where_the_motion_is_known_another_track_is_predicted_better_than_by_two_fits():
    known = error(True, zeta_known=True)
    assert np.all(known[1:] < 0.5 * error(False, zeta_known=True)[1:]), known
    assert np.all(known[1:] < 0.5 * error(True, zeta_known=False)[1:])  # and the motion is what it listens to


def test_training_twice_gives_the_same_stable_model_without_trust():
    first, again = trained(), train([flight(1.5, 0)], make_config("dictionary")).model
    np.testing.assert_array_equal(first.encoder.E, again.encoder.E)
    np.testing.assert_array_equal(first.system.B, again.system.B)
    assert first.system.spectral_radius <= 1.0
    assert first.trust is None


def test_units_do_not_matter():
    made = flight(1.5, 0)
    milli = Segment(1e3 * made.chi, made.zeta, STEP)
    model, scaled = trained(), train([milli], make_config("dictionary")).model
    np.testing.assert_allclose(scaled.system.B[:-6], 1e3 * model.system.B[:-6], rtol=1e-5, atol=1e-6)


def test_a_symmetric_fit_turns_with_the_flight():
    """A quarter turn of the data is a quarter turn of the forecast."""
    turn = np.kron(np.eye(4), [[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    made = flight(1.5, 0)
    samples = np.hstack([made.chi, made.zeta]) @ turn.T
    turned = Segment(samples[:, :6], samples[:, 6:], STEP)
    model = trained()
    other = train([turned], make_config("dictionary")).model
    window = np.hstack([made.chi, made.zeta])[300 : 300 + model.window]
    chi = model.system.rollout(model.lift(window), made.zeta[359:380])
    chi_turned = other.system.rollout(other.lift(window @ turn.T), made.zeta[359:380] @ turn[:6, :6].T)
    np.testing.assert_allclose(chi_turned[:, :3], chi[:, :3] @ turn[:3, :3].T, atol=1e-5)  # [N]


def test_two_flights_alike_teach_what_one_does():
    made = flight(1.5, 0)
    one, two = trained(), train(2 * [made], make_config("dictionary")).model
    np.testing.assert_allclose(two.system.B, one.system.B, rtol=1e-6, atol=1e-9)
    assert two.summary["samples"] == 2 * one.summary["samples"]


@pytest.mark.parametrize("n", [50, 100])
def test_a_flight_too_short_is_refused(n):
    with pytest.raises(ValueError, match="at least 101 samples"):
        train([flight(1.5, 0, n)], make_config("dictionary"))
