"""Laws of the dictionary of decaying modes, for wrenches in body axes, on a made-up flight whose
wrench has a law.
"""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.lifting.training.mode_dictionary import (
    ModeDictionaryConfig,
    departures,
    fit_response,
    time_constants,
)
from np_drake.lifting.training.train import train
from np_drake.residual_model import Sample
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.skill.skill import skill_table
from np_drake.training_data.segments import Segment, of_wrenches

MODES, HORIZONS = time_constants((2.0, 8.0, 30.0), (2.0, 8.0, 30.0), 1e5), np.array([0, 1, 5, 20])


def test_a_trajectory_of_modes_is_projected_onto_its_amplitudes():
    """A longer horizon repeats modes; a nearly constant one is ill-conditioned, and pulled."""
    a = np.random.default_rng(0).standard_normal(MODES.K)
    chi = MODES.readout(HORIZONS) @ a
    found = np.einsum("khc,hc->k", MODES.projector(HORIZONS, np.ones((4, 2)), ridge=1e-12), chi)
    np.testing.assert_allclose(MODES.readout(HORIZONS) @ found, chi, atol=1e-6)


def fitted(**settings):
    """B of a response that made the data, and as found."""
    modes, horizons = time_constants((3.0, 20.0), (3.0, 20.0), 1e4), np.array([0, 1, 3, 10, 30])
    B = 0.1 * np.random.default_rng(5).standard_normal((modes.K, 6))
    B[[2, 5, 8]] = 0.0  # the levels
    zeta = np.cumsum(0.1 * np.random.default_rng(0).standard_normal((4000, 6)), axis=0)
    origins, rest = np.arange(0, 3900, 3), np.zeros((1300, 5, 6))
    for c in range(6):
        u = departures(zeta, origins, horizons, modes.poles[c])
        rest[..., c] = np.einsum("ohmp,mp->oh", u, B[modes.places[c]])
    settings = {"noise": 1e-6, "strength": 1e6, "symmetry": 0.0} | settings
    return B, fit_response([(zeta, origins, rest, np.ones((5, 2)))], modes, horizons, **settings)


def test_the_response_that_made_the_data_is_found():
    expected, found = fitted()
    np.testing.assert_allclose(found, expected, atol=1e-3)
    for doubt in ({"strength": 1e-6}, {"noise": 1e6}):
        assert np.abs(fitted(**doubt)[1]).max() < 1e-3


STEP = 0.0025  # [s]; one step ahead, smooth motion is a straight line
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
    return NeuralPredictor(model, torque="predict")


def test_it_is_stable_whatever_the_data_say(model):
    assert model.system.spectral_radius <= 1.0
    noise = np.random.default_rng(0)
    wild = Segment(noise.standard_normal((600, 6)) * 1e3, noise.standard_normal((600, 6)), STEP)
    assert train([wild], CONFIG).model.system.spectral_radius <= 1.0


@pytest.mark.parametrize("known", [False, True])
def test_an_unseen_flight_is_predicted_better_than_by_any_naive_row(dut, known):
    unseen, options = flight(7), {"horizons": [5, 20, 40], "mean": np.zeros(6), "warm_up": 29}
    rows = skill_table({"np": dut}, unseen.chi, unseen.zeta, zeta_known=known, **options)
    for row in (row for row in rows if row["model"] == "np"):
        assert row["force_skill"] < 0.9, row
        assert row["torque_skill"] < 0.9, row


def test_a_held_zeta_leaves_the_held_forecast(model):
    """B acts on what the coming motion adds."""
    window = np.hstack([flight(2).chi, flight(2).zeta])[:30]
    s, z = model.system, model.encoder(window)
    without = dc.replace(s, A=s.A.copy(), B=0 * s.B)
    without.A[:-6, -6:] = 0.0
    for _ in range(40):
        np.testing.assert_allclose(s.C @ z, without.C @ z, atol=1e-9)
        moved, still = s.A @ z + s.B @ z[-6:], without.A @ z
        np.testing.assert_allclose(moved, still, atol=1e-9)
        z = moved


def test_missing_samples_leave_a_forecast_and_a_long_gap_ends_evidence(dut):
    unseen = flight(5, 400)
    flown, memory = of_wrenches(unseen.chi, unseen.zeta, STEP), dut.initial_memory()
    for k in range(400):
        sample = flown.sample(k)
        if 100 <= k < 110 or 200 <= k < 260:
            sample = Sample(sample.x, sample.u, np.full(6, np.nan))
        memory = dut.update(memory, sample)
        assert all(np.isfinite(value).all() for value in memory.values())
        if k in (115, 259):  # after a gap shorter than the window, and in one that is longer
            assert (memory["trust/lifted"][0] > 0) == (k == 115)
    chi_hat = dut.forecast(memory, horizon=5, stride=1).rollout(np.tile(unseen.zeta[-1], (5, 1)))
    assert np.abs(chi_hat[0] - unseen.chi[-1]).max() < 0.1  # [N]
