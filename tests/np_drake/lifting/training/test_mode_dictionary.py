"""Laws of the dictionary of decaying modes, for wrenches in body axes, on a made-up flight whose
wrench has a law.
"""

import numpy as np
import pytest

from np_drake.lifting.model.lifted_linear_system import Taps
from np_drake.lifting.training.excitation import turns
from np_drake.lifting.training.mode_dictionary import (
    ModeDictionaryConfig,
    flight_moments,
    horizon_ridge,
    relative_error,
    time_constants,
)
from np_drake.lifting.training.train import train
from np_drake.residual_model import Sample
from np_drake.residual_models.lifted_predictor import LiftedPredictor
from np_drake.skill.skill import skill_table
from np_drake.training_data.segments import Segment, of_wrenches

MODES, HORIZONS = time_constants((2.0, 8.0, 30.0), (2.0, 8.0, 30.0), 1e5), np.array([0, 1, 5, 20])


def test_a_trajectory_of_modes_is_projected_onto_its_amplitudes():
    """A longer horizon repeats modes; a nearly constant one is ill-conditioned, and pulled."""
    a = np.random.default_rng(0).standard_normal(len(MODES.poles))
    chi = MODES.readout(HORIZONS) @ a
    found = np.einsum("khc,hc->k", MODES.projector(HORIZONS, np.ones((4, 2)), ridge=1e-12), chi)
    np.testing.assert_allclose(MODES.readout(HORIZONS) @ found, chi, atol=1e-6)


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
def dut():
    return LiftedPredictor(train([flight(0), flight(1)], CONFIG).model)


def test_an_unseen_flight_is_predicted_better_than_by_any_naive_row(dut):
    unseen, options = flight(7), {"horizons": [5, 20, 40], "mean": np.zeros(6), "warm_up": 29}
    rows = skill_table({"np": dut}, unseen, motion="held", **options)
    for row in (row for row in rows if row["model"] == "np"):
        assert row["force_skill"] < 0.9, row
        assert row["torque_skill"] < 0.9, row


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


TAPS, AHEAD = Taps.averaging(4, 4, 0), np.array([0, 1, 3, 9])


def oscillation(seed: int) -> np.ndarray:
    """(600, 12) damped oscillators driven by noise, six of them beside white zeta."""
    generator = np.random.default_rng(seed)
    x = np.zeros((600, 12))
    x[:, 6:] = generator.standard_normal((600, 6))
    for k in range(2, 600):
        x[k, :6] = 1.9 * x[k - 1, :6] - 0.95 * x[k - 2, :6] + 0.1 * generator.standard_normal(6)
    return x


def moments(samples: np.ndarray, symmetry: float = 0.0, most: int = 10**6):
    options = {"taps": TAPS, "horizons": AHEAD, "max_origins": most, "symmetry": symmetry}
    return flight_moments(samples, samples[:, :6], **options)


def test_now_is_the_newest_sample_and_a_recursion_is_found():
    W = horizon_ridge([moments(oscillation(0)), moments(oscillation(1))], noise=1e-6)
    np.testing.assert_allclose(W[:6, 0], np.eye(6), atol=1e-6)
    np.testing.assert_allclose(W[6:, 0], 0.0, atol=1e-6)
    assert np.diag(W[:6, 1]) == pytest.approx(1.9, abs=0.1)  # of 1200 noisy samples
    assert np.diag(W[12:18, 1]) == pytest.approx(-0.95, abs=0.1)


def test_a_calm_flight_counts_as_much_as_a_wild_one():
    """The same flight a hundred times smaller tells the same; a pooled fit would not listen."""
    wild, calm = oscillation(0), 0.01 * oscillation(1)
    calm[:, 6:] *= 100  # of zeta, the fit takes all alike
    flights = [moments(wild), moments(calm)]
    both = horizon_ridge(flights, noise=1e-9)
    ratios = []
    for flight in flights:
        alone = horizon_ridge([flight], noise=1e-9)
        ratios.append(
            relative_error(flight, both)[1:].mean() / relative_error(flight, alone)[1:].mean()
        )
    assert ratios[1] == pytest.approx(ratios[0], rel=0.1)


def test_relative_error_is_that_of_the_forecasts():
    x = oscillation(2)
    dut, W = moments(x), horizon_ridge([moments(x)], noise=1e-3)
    origins = np.arange(3, 600 - 9)
    windows = np.stack([x[k - 3 : k + 1] for k in origins])
    F = np.hstack([TAPS.features(windows), np.ones((len(origins), 1))])
    error = np.einsum("op,phc->ohc", F, W) - x[origins[:, None] + AHEAD, :6]
    force = (error[..., :3] ** 2).sum(axis=2).mean(axis=0) / dut.power[:, 0]
    np.testing.assert_allclose(relative_error(dut, W)[:, 0], force, rtol=1e-9, atol=1e-12)


def test_full_symmetry_makes_the_turned_flight_the_same_flight():
    x = oscillation(3)
    turned = [np.hstack(pair) for pair in zip(turns(x[:, :6]), turns(x[:, 6:]), strict=True)]
    for image in turned[1:]:
        for name in ("gram", "cross"):
            found, expected = (getattr(moments(y, 1.0), name) for y in (image, x))
            np.testing.assert_allclose(found, expected, atol=1e-9)
    assert np.abs(moments(turned[1]).gram - moments(x).gram).max() > 0.01


@pytest.mark.parametrize(("most", "stride"), [(588, 1), (300, 2), (7, 84)])
def test_origins_are_thinned_evenly_to_the_most_that_are_allowed(most, stride):
    samples = oscillation(3)
    origins = np.arange(TAPS.delay - 1, len(samples) - AHEAD[-1], stride)
    assert len(origins) <= most
    expected = np.mean(samples[origins[:, None] + AHEAD, :6] ** 2, axis=0)
    np.testing.assert_allclose(moments(samples, most=most).square, expected)
