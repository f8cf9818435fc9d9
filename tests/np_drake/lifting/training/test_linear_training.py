"""The plain configurations as lifted linear systems that fly."""

import numpy as np
import pytest

from np_drake.lifting.model.encoders import DelayTaps
from np_drake.lifting.model.lifted_model import DELAY_DMDC, DMDC
from np_drake.lifting.training.linear_fits import flight_moments, horizon_ridge, sample_scale
from np_drake.lifting.training.train import (
    DmdcConfig,
    RidgeConfig,
    course_register,
    make_config,
    train,
)
from np_drake.training_data.segments import Segment

STEP = 0.02
A = 0.9 * np.linalg.qr(np.random.default_rng(0).standard_normal((6, 6)))[0]
B = 0.1 * np.random.default_rng(1).standard_normal((6, 6))


def flight(seed: int, radius: float = 1.0, n: int = 400) -> Segment:
    """chi+ = radius A chi + B zeta."""
    generator = np.random.default_rng(seed)
    chi, zeta = generator.standard_normal((n, 6)), generator.standard_normal((n, 6))
    for k in range(n - 1):
        chi[k + 1] = radius * A @ chi[k] + B @ zeta[k]
    return Segment(chi, zeta, STEP)


def test_a_course_register_plays_its_course_and_holds_the_end():
    course = np.random.default_rng(0).standard_normal((5, 3))
    chi = course_register(4, STEP).rollout(course.ravel(), np.ones((8, 6)))
    np.testing.assert_array_equal(chi[:, :3], course[[0, 1, 2, 3, 4, 4, 4, 4]])
    np.testing.assert_array_equal(chi[:, 3:], 0.0)


def test_the_ridge_flies_as_the_best_linear_map_of_every_horizon():
    config, made = RidgeConfig(delay=20, dense=4, averages=3, horizon=6), flight(0)
    model = train([made], config).model
    scale, taps = sample_scale([made]), DelayTaps(20, 4, 3)
    samples = np.hstack([made.chi, made.zeta])
    moments = flight_moments(
        samples / scale,
        made.chi / scale[:6],
        taps=taps,
        horizons=np.arange(7),
        max_origins=6000,
        symmetry=0.0,
    )
    features = np.append(taps.features(samples / scale, np.array([50]))[0], 1.0)
    course = (
        np.einsum("p,phc->hc", features, horizon_ridge([moments], noise=config.noise)) * scale[:6]
    )
    chi = model.system.rollout(model.lift(samples[31:51]), np.zeros((7, 6)))
    np.testing.assert_allclose(chi[:, :3], course[:, :3], atol=1e-10)


@pytest.mark.parametrize("name, K", [(DMDC, 6), (DELAY_DMDC, 114)])
def test_dmdc_is_the_law_of_the_data(name, K):
    model = train([flight(0), flight(1)], make_config(name)).model
    assert (model.configuration, model.system.K) == (name, K)
    unseen = flight(2)
    window = np.hstack([unseen.chi, unseen.zeta])[100 - model.window + 1 : 101]
    chi = model.system.rollout(model.lift(window), unseen.zeta[100:106])
    np.testing.assert_allclose(chi, unseen.chi[100:106], atol=0.1)


@pytest.mark.parametrize("delays", [1, 3])
def test_dmdc_of_a_wrench_that_grows_is_stable(delays):
    growing = flight(0, radius=1.13, n=200)
    model = train([growing], DmdcConfig(delays=delays)).model
    assert model.summary["spectral_radius_as_fitted"] > 1.01
    assert model.system.spectral_radius <= 1.0


def test_a_flight_too_short_for_the_ridge_is_refused():
    with pytest.raises(ValueError, match="at least 101 samples"):
        train([flight(0, n=90)], make_config("ridge"))
