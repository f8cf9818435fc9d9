"""Laws of the neural window: of its symmetry, and of what it foresees."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.lifting.model.lifted_model import save_model
from np_drake.lifting.training.neural_window import NeuralWindowConfig
from np_drake.lifting.training.paper_training import IMAGES
from np_drake.lifting.training.train import train
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.skill.skill import skill_table
from np_drake.training_data.segments import Segment

CONFIG = NeuralWindowConfig(epochs=60)
STEP = 0.02


@pytest.fixture(scope="module")
def model(dithered):
    return train([dithered.segment], CONFIG).model


def windows(model, flight) -> np.ndarray:
    samples, D = np.hstack([flight.chi, flight.zeta]), model.encoder.delay
    return np.stack([samples[k - D + 1 : k + 1] for k in range(D - 1, len(samples), 7)])


def test_forecasts_turn_with_the_flight(model, lemniscate):
    w, s = windows(model, lemniscate), model.system
    ahead = [s.C @ np.linalg.matrix_power(s.A, steps) for steps in (0, 1, 30)]
    response = [s.C @ np.linalg.matrix_power(s.A, steps) @ s.B for steps in (0, 5)]
    for image in IMAGES:
        turn = image[:6, :6]
        for readout in ahead:
            found = model.encoder(w @ image) @ readout.T
            np.testing.assert_allclose(found, model.encoder(w) @ readout.T @ turn, atol=1e-9)
        for markov in response:
            np.testing.assert_allclose(turn @ markov @ turn.T, markov, atol=1e-9)


def test_the_network_foresees_more_than_its_linear_start(model, dithered, lemniscate):
    linear = train([dithered.segment], dc.replace(CONFIG, epochs=0)).model
    assert not np.any(linear.encoder.weights[-1])
    rows = skill_table(
        {"np": NeuralPredictor(model), "linear start": NeuralPredictor(linear)},
        lemniscate.chi,
        lemniscate.zeta,
        **{"horizons": [25], "mean": np.zeros(6), "warm_up": 60, "zeta_known": True},
        target=lemniscate.truth,
    )
    error = {row["model"]: row["force_rmse"] for row in rows}
    assert error["np"] < error["linear start"] < 0.3 * error["persistence"]


def test_it_is_what_theorem_1_assumes_in_a_small_file(model, tmp_path):
    assert model.system.spectral_radius < 1.0
    *hidden, last = model.encoder.weights
    assert max(np.linalg.norm(W, 2) for W in hidden) <= 1.0 + 1e-12
    assert last.any()
    save_model(model, tmp_path / "m.safetensors")
    assert (tmp_path / "m.safetensors").stat().st_size < 2e6  # [B]


def oscillator(seed: int, stiffness: float, level: float) -> Segment:
    """Force of a swing in x, y, z that the velocity drives, on a level along z; noisy labels."""
    generator = np.random.default_rng(seed)
    t = STEP * np.arange(1200)[:, None]
    rate, phase = generator.uniform(1.0, 6.0, (2, 6, 4))
    zeta = np.sin(t[..., None] * rate + phase).sum(axis=2)
    chi, force, drift = np.zeros((1200, 6)), np.zeros(3), np.zeros(3)
    for k in range(1200):
        chi[k, :3] = force + [0.0, 0.0, level]
        drift = drift + STEP * (zeta[k, :3] - stiffness * force - 0.3 * drift)
        force = force + STEP * drift
    return Segment(chi + 0.02 * generator.standard_normal((1200, 6)), zeta, STEP)


def test_several_flights_with_different_loads_are_one_training():
    loads = [(8.0, -1.0), (12.0, -2.0), (16.0, -4.0)]
    segments = [oscillator(k, *load) for k, load in enumerate(loads)]
    short = Segment(segments[0].chi[:60], segments[0].zeta[:60], STEP)
    model = train([*segments, short], dc.replace(CONFIG, epochs=20)).model
    unseen = oscillator(9, 12.0, -3.0)
    rows = skill_table(
        {"np": NeuralPredictor(model)},
        unseen.chi,
        unseen.zeta,
        **{"horizons": [20], "mean": np.zeros(6), "warm_up": 60, "zeta_known": True},
    )
    error = {row["model"]: row["force_rmse"] for row in rows}
    assert error["np"] < 0.5 * error["persistence"]
    again = train([*segments, short], dc.replace(CONFIG, epochs=20)).model
    np.testing.assert_array_equal(again.system.A, model.system.A)
