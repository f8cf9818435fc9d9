"""The default configuration for wrenches in body axes, on a made-up flight whose wrench has a
law.
"""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.lifting.model.model_file import load_model, save_model
from np_drake.lifting.training.mode_dictionary import ModeDictionaryConfig
from np_drake.lifting.training.train import make_config, train
from np_drake.residual_model import Sample
from np_drake.residual_models.neural_predictor import NeuralPredictor, PredictorOptions
from np_drake.skill.skill import model_predictions, skill_table
from np_drake.training_data.segments import Segment

STEP, HORIZONS = 0.0025, [5, 20, 40]  # [s]; one step ahead, smooth motion is a straight line
CONFIG = ModeDictionaryConfig(delay=30, averages=4, horizon=60, horizons=10)


def flight(seed: int, n: int = 3000) -> Segment:
    """Six swinging velocities; force is drag and a level, torque what turns the body."""
    generator = np.random.default_rng(seed)
    t = STEP * np.arange(n + 1)[:, None]
    rate, phase = generator.uniform(2.0, 12.0, (6, 4)), generator.uniform(0, 6.3, (6, 4))
    zeta = np.sin(t[..., None] * rate + phase).sum(axis=2)
    level = generator.uniform(-2.0, 2.0, 3)
    chi = np.hstack([level - 0.5 * zeta[:-1, :3], 0.01 * np.diff(zeta[:, 3:], axis=0) / STEP])
    return Segment(chi, zeta[:-1], STEP)


@pytest.fixture(scope="module")
def model():
    return train([flight(0), flight(1)], CONFIG).model


@pytest.fixture(scope="module")
def dut(model):
    return NeuralPredictor(model, PredictorOptions(torque="predict"))


def test_default_in_body_axes_is_this_configuration():
    assert isinstance(make_config("mode-dictionary", frame="body"), ModeDictionaryConfig)
    assert not isinstance(make_config(""), ModeDictionaryConfig)
    with pytest.raises(ValueError, match="world axes need lifted"):
        make_config("mode-dictionary")
    with pytest.raises(ValueError, match="frame must be"):
        make_config("lifted", frame="moon")


def test_it_is_stable_whatever_the_data_say(model):
    assert model.system.spectral_radius <= 1.0
    noise = np.random.default_rng(0)
    wild = Segment(noise.standard_normal((600, 6)) * 1e3, noise.standard_normal((600, 6)), STEP)
    assert train([wild], CONFIG).model.system.spectral_radius <= 1.0


@pytest.mark.parametrize("known", [False, True])
def test_an_unseen_flight_is_predicted_better_than_by_any_naive_row(dut, known):
    unseen = flight(7)
    rows = skill_table(
        {"np": dut},
        unseen.chi,
        unseen.zeta,
        horizons=HORIZONS,
        mean=np.zeros(6),
        zeta_known=known,
        warm_up=29,
    )
    for row in (row for row in rows if row.model == "np"):
        assert row.force_skill < 0.9, row
        assert row.torque_skill < 0.9, row


def test_training_twice_gives_the_same_model(model):
    again = train([flight(0), flight(1)], CONFIG).model
    np.testing.assert_array_equal(again.encoder.E, model.encoder.E)
    np.testing.assert_array_equal(again.system.B, model.system.B)


def test_units_do_not_matter(model):
    """In millinewtons the same model, a thousand times larger."""
    flights = [flight(0), flight(1)]
    milli = train([dc.replace(f, chi=1e3 * f.chi, target=None) for f in flights], CONFIG).model
    window = np.hstack([flight(2).chi, flight(2).zeta])[:30]
    scaled = window * np.repeat([1e3, 1.0], 6)
    chi, zeta = model.system.C @ model.lift(window), window[-1, 6:]
    np.testing.assert_allclose(milli.system.C @ milli.lift(scaled), 1e3 * chi, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(milli.lift(scaled)[-6:], zeta)


def test_the_file_holds_all_of_it(model, dut, tmp_path):
    save_model(model, tmp_path / "np.safetensors")
    loaded = NeuralPredictor(load_model(tmp_path / "np.safetensors"), dut.options)
    unseen = flight(3, 400)
    for name in ("z", "offset", "A", "B", "C"):
        np.testing.assert_array_equal(
            getattr(loaded.along(unseen.chi, unseen.zeta), name),
            getattr(dut.along(unseen.chi, unseen.zeta), name),
        )


@pytest.mark.parametrize("torque", ["predict", "hold"])
@pytest.mark.parametrize("known", [False, True])
def test_a_whole_flight_at_once_is_the_flight_sample_by_sample(model, torque, known):
    dut, unseen = NeuralPredictor(model, PredictorOptions(torque=torque)), flight(4, 300)
    origins = np.arange(29, 230)
    arguments = (dut, unseen.chi, unseen.zeta, origins, [0, 1, 7, 60])
    at_once = model_predictions(*arguments, zeta_known=known)
    np.testing.assert_allclose(
        at_once, model_predictions(*arguments, zeta_known=known, at_once=False), atol=1e-9
    )


def test_missing_samples_leave_a_forecast_and_a_long_gap_ends_evidence(dut):
    unseen = flight(5, 400)
    memory = dut.initial_memory()
    for k in range(400):
        x = np.concatenate([np.zeros(3), [1.0, 0, 0, 0], unseen.zeta[k]])
        missing = 100 <= k < 110 or 200 <= k < 260
        memory = dut.update(
            memory, Sample(x, np.zeros(4), np.full(6, np.nan) if missing else unseen.chi[k])
        )
        assert all(np.isfinite(value).all() for value in memory.values())
        if k in (115, 259):  # after a gap shorter than the window, and in one that is longer
            assert (memory["trust/lifted"][0] > 0) == (k == 115)
    chi_hat = dut.forecast(memory, horizon=5, stride=1).rollout(np.tile(unseen.zeta[-1], (5, 1)))
    assert np.abs(chi_hat[0] - unseen.chi[-1]).max() < 0.1  # [N]


def test_a_flight_too_short_for_the_horizon_is_refused():
    with pytest.raises(ValueError, match="at least 91 samples"):
        train([flight(0, 80)], CONFIG)
