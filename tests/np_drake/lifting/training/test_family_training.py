"""Laws of the training of a family of lifted linear systems, and of a network on top of it."""

import dataclasses as dc

import numpy as np
import pytest
import torch

from np_drake.lifting.model.lifted_model import NEURAL
from np_drake.lifting.model.neural_family import NeuralFamily, saturated, with_network
from np_drake.lifting.training.family_training import (
    TrainedAxis,
    placed,
    train_lifted,
    window_moments,
)
from np_drake.lifting.training.network_training import (
    HORIZONS,
    NeuralConfig,
    add_network,
    family_windows,
    judged,
    principal_components,
)
from np_drake.lifting.training.train import make_config, train
from np_drake.residual_models.flight_forecasts import model_predictions
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


def swinging(seed, count=400, frequency=None, mass=None):
    """Segment of a vehicle below which a mass swings along x and y so widely that its frequency
    falls.
    """
    rng, t = np.random.default_rng(seed), STEP * np.arange(count)
    drawn = rng.uniform(3.0, 5.0), rng.uniform(0.1, 0.4)
    frequency, mass = frequency or drawn[0], mass or drawn[1]
    chi, zeta = np.zeros((count, 6)), np.zeros((count, 6))
    tones, phases = rng.uniform(0.5, 5.0, (2, 4)), rng.uniform(0, 2 * np.pi, (2, 4))
    chi[:, 2], zeta[:, 2] = -9.81 * mass, 0.1 * np.sin(t)
    zeta[:, :2] = 0.6 * np.sin(t[:, None, None] * tones + phases).sum(axis=2)
    s, rate = rng.uniform(-1, 1, 2), np.zeros(2)
    for k in range(count - 1):
        chi[k, :2] = mass * frequency**2 * np.sin(s)
        rate = rate - STEP * (frequency**2 * np.sin(s) + 0.1 * rate)
        rate = rate - (zeta[k + 1, :2] - zeta[k, :2])
        s = s + STEP * rate
    chi[-1, :2] = chi[-2, :2]
    chi[:, :3] += 0.01 * rng.standard_normal((count, 3))
    return Segment(chi, zeta, STEP)


@pytest.fixture(scope="module")
def flights():
    """40 flights."""
    return [swinging(seed) for seed in range(40)]


@pytest.fixture(scope="module")
def unseen():
    return [swinging(seed) for seed in range(100, 112)]


@pytest.fixture(scope="module")
def family(flights):
    """Family of the flights, without network."""
    return train_lifted(flights, CONFIG, lambda *_: None)[0]


@pytest.fixture(scope="module")
def neural(family, flights):
    """The family with a network."""
    return add_network(family, flights, CONFIG)


def test_the_loss_of_the_moments_is_that_of_every_window():
    rng, horizons = np.random.default_rng(0), np.array([0, 1, 3, 6])
    seen, goals = [rng.standard_normal((2, 40, 3))], [rng.standard_normal((2, 40))]
    moments = window_moments(seen, goals, delay=4, horizons=horizons, noise=(1e-6, 1e-6))
    dut = TrainedAxis(moments, horizons, modes=(0.1,), decays=(0.05,), size=1, rng=rng)
    dut.encoder = torch.from_numpy(rng.standard_normal(dut.encoder.shape)).float()
    theta = torch.tensor([[0.7]])
    axis = dut.export(np.zeros((2, 3, 12)), np.zeros((2, 6)), step=1.0)
    A, B = axis.matrices(np.array([0.7]), 1.0)
    errors = []
    for v in range(2):
        for k in range(3, 40 - 6):
            z = axis.lift(seen[0][v, k - 3 : k + 1].ravel(), np.array([0.7]))
            course = [axis.C @ z]
            for j in range(6):
                z = A @ z + B @ seen[0][v, k + j, 1:]
                course.append(axis.C @ z)
            errors.append((np.array(course)[horizons] - goals[0][v, k + horizons]) ** 2)
    expected = np.mean(np.mean(errors, axis=0) / moments.power[0])
    assert dut.loss(torch.tensor([0]), theta).item() == pytest.approx(expected, rel=1e-4)


def forecasts(model, flight, origins, ahead):
    """Forecasts (o, h, 6) along the motion as flown."""
    dut = NeuralPredictor(model)
    return model_predictions(dut, flight.chi, flight.zeta, origins, ahead, zeta_known=True)


def errors(model, flights, horizon):
    """Mean square error of the force of each flight (f,), and that of persistence [N²]."""
    found = []
    for flight in flights:
        origins = np.arange(model.warm_up - 1, len(flight) - horizon)
        forecast = forecasts(model, flight, origins, [horizon])[:, 0, :3]
        goal = flight.goal[origins + horizon, :3]
        found.append([np.mean((held - goal) ** 2) for held in (forecast, flight.chi[origins, :3])])
    return np.array(found).T


def test_a_family_foresees_pendulums_that_it_has_not_seen(family, unseen):
    own, held = errors(family, unseen, 12)
    assert np.sqrt(own.mean() / held.mean()) < 0.45  # swings too wide for a linear system


def test_placing_takes_theta_to_the_swing_and_leaves_the_prior_as_wide(family):
    slow, fast = (placed(family, [swinging(50, frequency=w)]).encoder for w in (3.0, 5.0))
    deviation = np.sqrt(np.diag(family.encoder.covariance))
    assert np.abs((fast.mean - slow.mean) / deviation).max() > 1.0
    np.testing.assert_array_equal(fast.covariance, family.encoder.covariance)
    with pytest.raises(ValueError, match=r"0\.02 s a sample; the flights have 0\.04 s"):
        placed(family, [dc.replace(swinging(50), step=0.04)])


def test_one_flight_makes_a_family_of_one(flights):
    model, losses = train_lifted(flights[:1], CONFIG, lambda *_: None)
    assert losses[-1] < 0.2 * losses[0]
    still, covariance = np.zeros((model.window, 12)), model.encoder.covariance
    theta, _ = model.encoder.update(model.encoder.mean, covariance, still, STEP)
    assert theta.shape == (0,)


def test_the_network_foresees_unseen_wide_swings_better_than_the_family(family, neural, unseen):
    ratio = np.sqrt(errors(neural, unseen, 20)[0] / errors(family, unseen, 20)[0])
    assert np.median(ratio) < 0.95


def test_the_share_is_never_worse_than_none_where_it_was_judged(family, neural, unseen):
    rng, network = np.random.default_rng(0), neural.encoder.network
    wild = dc.replace(network, weights=tuple(rng.standard_normal(W.shape) for W in network.weights))
    wild = dc.replace(neural, encoder=with_network(family.encoder, wild))
    assert judged(wild, unseen).encoder.network.share == 0.0
    assert judged(neural, unseen).encoder.network.share > 0.0
    assert judged(family, unseen) is family


@pytest.mark.parametrize("name", ["family", "neural"])
def test_the_loss_is_the_error_over_that_of_persistence(name, request):
    model = request.getfixturevalue(name)
    some, encoder = [swinging(50, 120), swinging(51, 160)], model.encoder
    own, options = isinstance(encoder, NeuralFamily), {"step": STEP, "count": 1000, "noise": 0.0}
    white = encoder.network.white if own else principal_components(encoder, some, 3)
    data = family_windows(encoder, white, some, **options)
    dz, change = torch.zeros(len(data), encoder.K), torch.zeros(len(data), len(encoder.mean))
    if own:
        theta = (data.theta.numpy() - encoder.network.center) / encoder.network.spread
        x = saturated(np.concatenate([data.inputs.numpy(), theta], axis=1))
        dz, change = (torch.from_numpy(part).float() for part in encoder.network.correction(x))
    expected = []
    for flight in some:
        origins = np.arange(encoder.delay - 1, len(flight) - HORIZONS[-1])
        goal = flight.goal[origins[:, None] + HORIZONS, :3]
        error = forecasts(model, flight, origins, list(HORIZONS))[..., :3] - goal
        still = flight.chi[origins, None, :3] - goal
        expected.append(np.mean(np.sum(error**2, axis=(0, 2)) / np.sum(still**2, axis=(0, 2))))
    assert data.loss(dz, change).item() == pytest.approx(np.mean(expected), rel=1e-3)


def test_it_is_trained_by_its_name_and_is_the_same_again(flights):
    short = {f.name: getattr(CONFIG, f.name) for f in dc.fields(CONFIG)} | {
        "steps": 3,
        "updates": 3,
    }
    told, config = [], make_config(NEURAL, **short)
    model = train(flights[:12], config, on_epoch=lambda *at: told.append(at[:2])).model
    assert model.configuration == NEURAL
    assert told == [(i, 6) for i in range(1, 7)]
    again = train(flights[:12], config).model.encoder
    np.testing.assert_array_equal(again.axes[0].inputs, model.encoder.axes[0].inputs)
    np.testing.assert_array_equal(again.network.weights[0], model.encoder.network.weights[0])
