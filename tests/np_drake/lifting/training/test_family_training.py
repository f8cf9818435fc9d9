"""Laws of the training of a family of lifted linear systems."""

import dataclasses as dc

import numpy as np
import pytest
import torch

from np_drake.lifting.model.adaptive_family import AdaptiveFamily
from np_drake.lifting.training.family_training import (
    LiftedConfig,
    TrainedAxis,
    placed,
    train_lifted,
    window_moments,
)
from np_drake.training_data.segments import Segment

STEP = 0.02
CONFIG = LiftedConfig(
    delay=10,
    horizon=12,
    horizons=5,
    size=2,
    steps=400,
    batch=8,
    lags=(4, 8),
    memory=500.0,
    zeta_noise=0.01,
    label_noise=0.01,
)


def swinging(frequency, mass, seconds=14.0, seed=0):
    """Segment of a vehicle below which a mass swings as a linear pendulum, along x and y."""
    rng, n = np.random.default_rng(seed), round(seconds / STEP)
    t = STEP * np.arange(n)
    chi, zeta = np.zeros((n, 6)), np.zeros((n, 6))
    for i in range(2):
        tones, phases = rng.uniform(0.5, 6.0, 4), rng.uniform(0, 2 * np.pi, 4)
        zeta[:, i] = np.sin(t[:, None] * tones + phases).sum(axis=1)
        s, rate = 0.1 * rng.standard_normal(), 0.0
        for k in range(n):
            chi[k, i] = mass * frequency**2 * s
            a = (zeta[min(k + 1, n - 1), i] - zeta[k, i]) / STEP
            rate += STEP * (-(frequency**2) * s - 0.05 * rate - a)
            s += STEP * rate
    chi[:, 2] = -9.81 * mass
    chi[:, :3] += 0.01 * rng.standard_normal((n, 3))
    zeta[:, 2] = 0.1 * np.sin(t)
    return Segment(chi, zeta, STEP)


def fitted(segments, **changes):
    config = dc.replace(CONFIG, **changes)
    return train_lifted(segments, config, lambda *_: None)


@pytest.fixture(scope="module")
def family():
    """Family of eight flights, four pendulums."""
    flights = [
        swinging(w, m, seed=i)
        for i, (w, m) in enumerate(4 * [(3.0, 0.2), (5.0, 0.2), (3.0, 0.4), (4.0, 0.1)])
    ]
    return fitted(flights, steps=1200)[0]


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


def test_a_family_foresees_a_pendulum_that_it_has_not_seen(family):
    flight = swinging(3.6, 0.3, seed=99)
    at = placed(family, [flight])
    samples, h = np.hstack([flight.chi, flight.zeta]), 12
    errors, naive = [], []
    for k in range(300, len(samples) - h, 7):
        z = at.lift(samples[k - at.window + 1 : k + 1])
        for j in range(h):
            z = at.system.A @ z + at.system.B @ samples[k + j, 6:]
        errors.append((at.system.C @ z - samples[k + h, :6])[:2])
        naive.append((samples[k, :6] - samples[k + h, :6])[:2])
    assert np.sqrt(np.mean(np.square(errors)) / np.mean(np.square(naive))) < 0.35


def test_placing_takes_theta_to_the_swing_and_leaves_the_prior_as_wide(family):
    assert isinstance(family.encoder, AdaptiveFamily)
    slow, fast = (placed(family, [swinging(w, 0.2, seed=50)]).encoder for w in (3.0, 5.0))
    deviation = np.sqrt(np.diag(family.encoder.covariance))
    assert np.abs((fast.mean - slow.mean) / deviation).max() > 1.0
    np.testing.assert_array_equal(fast.covariance, family.encoder.covariance)


def test_one_flight_makes_a_family_of_one(family):
    model, losses = fitted([swinging(3.0, 0.2)])
    assert model.encoder.mean.shape == (0,)
    assert losses[-1] < 0.2 * losses[0]
    theta, _ = model.encoder.update(
        model.encoder.mean, model.encoder.covariance, np.zeros((model.window, 12)), STEP
    )
    assert theta.shape == (0,)


def test_training_is_the_same_again():
    flights = [swinging(3.0, 0.2), swinging(4.0, 0.3, seed=1)]
    (first, _), (second, _) = (fitted(flights, steps=20) for _ in range(2))
    np.testing.assert_array_equal(first.system.B, second.system.B)


def test_flights_at_another_step_are_refused(family):
    flight = swinging(3.0, 0.2)
    with pytest.raises(ValueError, match=r"0\.02 s a sample; the flights have 0\.04 s"):
        placed(family, [dc.replace(flight, step=0.04)])
