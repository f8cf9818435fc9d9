"""Laws of the training of a network on top of a family."""

import dataclasses as dc

import numpy as np
import pytest
import torch

from np_drake.lifting.model.lifted_model import NEURAL
from np_drake.lifting.model.neural_family import (
    NeuralFamily,
    WindowNetwork,
    saturated,
    with_network,
)
from np_drake.lifting.training.family_training import train_lifted
from np_drake.lifting.training.network_training import (
    HORIZONS,
    NeuralConfig,
    add_network,
    family_windows,
    judged,
    principal_components,
)
from np_drake.lifting.training.train import make_config, train
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.training_data.segments import Segment

STEP = 0.02
CONFIG = NeuralConfig(
    delay=10,
    horizons=5,
    size=2,
    steps=300,
    batch=20,
    lags=(4, 8),
    width=16,
    components=6,
    windows=60,
    updates=400,
    group=128,
)


def swinging(seed, count=400):
    """Segment of a vehicle below which a mass swings along x and y so widely that its frequency
    falls.
    """
    rng, t = np.random.default_rng(seed), STEP * np.arange(count)
    frequency, mass = rng.uniform(3.0, 5.0), rng.uniform(0.1, 0.4)
    chi, zeta = np.zeros((count, 6)), np.zeros((count, 6))
    tones, phases = rng.uniform(0.5, 5.0, (2, 4)), rng.uniform(0, 2 * np.pi, (2, 4))
    chi[:, 2], zeta[:, 2] = -9.81 * mass, 0.1 * np.sin(t)
    zeta[:, :2] = 0.6 * np.sin(t[:, None, None] * tones + phases).sum(axis=2)
    s, rate = rng.uniform(-1, 1, 2), np.zeros(2)
    for k in range(count - 1):
        chi[k, :2] = mass * frequency**2 * np.sin(s)
        rate = (
            rate - STEP * (frequency**2 * np.sin(s) + 0.1 * rate) - (zeta[k + 1, :2] - zeta[k, :2])
        )
        s = s + STEP * rate
    chi[-1, :2] = chi[-2, :2]
    chi[:, :3] += 0.01 * rng.standard_normal((count, 3))
    return Segment(chi, zeta, STEP)


@pytest.fixture(scope="module")
def flights():
    """40 flights."""
    return [swinging(seed) for seed in range(40)]


@pytest.fixture(scope="module")
def family(flights):
    """Family of the flights, without network."""
    return train_lifted(flights, CONFIG, lambda *_: None)[0]


@pytest.fixture(scope="module")
def neural(family, flights):
    """The family with a network."""
    return add_network(family, flights, CONFIG)


def errors(model, flights, horizon):
    """Mean square error of the force of each flight (f,) [N²]."""
    found = []
    for flight in flights:
        course = NeuralPredictor(model).along(flight.chi, flight.zeta)
        origins = np.arange(course.first, len(flight) - horizon)
        forecast = course.at([horizon], origins, flight.zeta, zeta_known=True)[:, 0, :3]
        found.append(np.mean((forecast - flight.goal[origins + horizon, :3]) ** 2))
    return np.array(found)


def test_it_foresees_unseen_wide_swings_better_than_the_family(family, neural):
    unseen = [swinging(seed) for seed in range(100, 112)]
    ratio = np.sqrt(errors(neural, unseen, 20) / errors(family, unseen, 20))
    assert np.median(ratio) < 0.95


def test_the_share_is_never_worse_than_none_where_it_was_judged(family, neural):
    rng, network = np.random.default_rng(0), neural.encoder.network
    unseen = [swinging(seed) for seed in range(100, 106)]
    wild = dc.replace(network, weights=tuple(rng.standard_normal(W.shape) for W in network.weights))
    wild = dc.replace(neural, encoder=with_network(family.encoder, wild))
    assert judged(wild, unseen).encoder.network.share == 0.0
    assert judged(neural, unseen).encoder.network.share > 0.0
    assert judged(judged(wild, unseen), unseen).encoder.network.share == 0.0
    assert judged(family, unseen) is family


def test_the_loss_is_the_error_over_that_of_persistence(family, neural):
    some = [swinging(50, 120), swinging(51, 160)]
    for model in (family, neural):
        encoder = model.encoder
        white = principal_components(encoder, some, 3)
        data = family_windows(encoder, white, some, step=STEP, count=1000, noise=0.0)
        if isinstance(encoder, NeuralFamily):
            own = family_windows(
                encoder, encoder.network.white, some, step=STEP, count=1000, noise=0.0
            )
            theta = (own.theta.numpy() - encoder.network.center) / encoder.network.spread
            x = saturated(np.concatenate([own.inputs.numpy(), theta], axis=1))
            dz, change = (torch.from_numpy(part).float() for part in encoder.network.correction(x))
        else:
            dz, change = (
                torch.zeros(len(data), encoder.K),
                torch.zeros(len(data), len(encoder.mean)),
            )
        expected = []
        for flight in some:
            origins = np.arange(encoder.delay - 1, len(flight) - HORIZONS[-1])
            course = NeuralPredictor(model).along(flight.chi, flight.zeta)
            goal = flight.goal[origins[:, None] + HORIZONS, :3]
            error = course.at(list(HORIZONS), origins, flight.zeta, zeta_known=True)[..., :3] - goal
            still = flight.chi[origins, None, :3] - goal
            expected.append(np.mean(np.sum(error**2, axis=(0, 2)) / np.sum(still**2, axis=(0, 2))))
        assert data.loss(dz, change).item() == pytest.approx(np.mean(expected), rel=1e-3)


def test_the_network_starts_from_the_familys_own_forecasts(family, flights):
    untrained = add_network(family, flights, dc.replace(CONFIG, updates=0))
    np.testing.assert_allclose(
        errors(untrained, flights[:2], 10), errors(family, flights[:2], 10), rtol=1e-9
    )


def test_training_is_the_same_again(family, flights):
    short = dc.replace(CONFIG, updates=5)
    first, second = (add_network(family, flights, short).encoder.network for _ in range(2))
    for a, b in zip(first.weights, second.weights, strict=True):
        np.testing.assert_array_equal(a, b)


def test_hidden_layers_are_normalised(neural):
    network = neural.encoder.network
    assert isinstance(network, WindowNetwork)
    for W in network.weights[:-1]:
        assert np.linalg.norm(W, 2) == pytest.approx(CONFIG.gain, rel=1e-4)
    assert neural.summary["network"]["lipschitz_bound"] == pytest.approx(
        network.lipschitz_bound, abs=1e-3
    )


def test_it_is_trained_by_its_name(flights):
    settings = {f.name: getattr(CONFIG, f.name) for f in dc.fields(CONFIG)} | {
        "steps": 3,
        "updates": 3,
    }
    told = []
    config = make_config(NEURAL, **settings)
    model = train(flights[:12], config, on_epoch=lambda *at: told.append(at[:2])).model
    assert model.configuration == NEURAL
    assert told == [(i, 6) for i in range(1, 7)]


def test_few_flights_train_no_network(flights):
    with pytest.raises(
        ValueError, match=r"neural: at least 10 flights are needed; got 9\. Use lifted\."
    ):
        train(flights[:9], CONFIG)
