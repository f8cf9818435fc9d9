"""Laws of a whole flight, and of tuning on one."""

import dataclasses as dc

import numpy as np
import pytest
import torch

from np_drake.estimation import mhe_tuning
from np_drake.estimation.mhe_config import MheConfig, MheWeights
from np_drake.estimation.motion import motion_from_attitude
from np_drake.estimation.moving_horizon import run_mhe
from np_drake.estimation.moving_horizon_program import ProgramWindow


@pytest.fixture(scope="module")
def motion(made, vehicle):
    return motion_from_attitude(made.sequence, vehicle, made.q)


@pytest.fixture(scope="module")
def noisy(motion):
    """As measured: 2 mm/s and 3 mrad/s."""
    noise = np.random.default_rng(5).normal(size=motion.y.shape) * ([2e-3] * 3 + [3e-3] * 3)
    return dc.replace(motion, y=motion.y + noise)


def test_the_wrench_of_a_clean_flight_is_found_a_few_steps_late(made, motion):
    d = motion.acceleration(made.sequence.chi)
    found = motion.acceleration(run_mhe(motion, MheConfig()).wrench)
    error, late = (np.mean(e[100:] ** 2, axis=0) for e in (found - d, d[8:] - d[:-8]))
    assert np.all(error < late)


def test_a_run_on_the_program_is_the_run_in_closed_form(motion):
    short, config = motion.first(60), MheConfig(forgetting_process=0.5)
    exact, program = (
        run_mhe(short, config),
        run_mhe(short, config, ProgramWindow(config, short.step)),
    )
    assert program.held == exact.held == 0
    np.testing.assert_allclose(program.wrench, exact.wrench, atol=1e-7)
    assert program.step_time > 0


def test_a_flight_that_begins_with_a_gap_starts_from_the_first_sample(made, motion):
    y = motion.y.copy()
    y[:30, :3] = np.nan
    run = run_mhe(dc.replace(motion, y=y), MheConfig())
    assert np.isfinite(run.wrench).all()
    assert np.abs((run.wrench - made.sequence.chi)[100:, :3]).max() < 0.1  # [N]


def test_a_flight_without_any_sample_of_a_channel_is_refused(motion):
    y = motion.y.copy()
    y[:, 1] = np.nan
    with pytest.raises(ValueError, match="must be finite"):
        run_mhe(dc.replace(motion, y=y), MheConfig())


def test_the_recursion_that_is_tuned_is_the_estimator(made, noisy):
    config = MheConfig(forgetting_measurement=0.8, forgetting_process=0.6)
    start = noisy.wrench(np.tile(noisy.hover, (len(noisy.y), 1)))[0]
    chi = np.concatenate([[start], made.sequence.chi[1:]])
    errors = mhe_tuning._Data(noisy, chi, config.horizon).errors(MheWeights.of(config))
    d, truth = (noisy.acceleration(wrench) for wrench in (run_mhe(noisy, config).wrench, chi))
    expected = np.mean((d - truth)[config.horizon :] ** 2, axis=0)
    np.testing.assert_allclose(errors.numpy(), expected, rtol=1e-6)


def test_the_gradient_is_that_of_differences(made, noisy):
    data = mhe_tuning._Data(noisy.first(200), made.sequence.chi[:200], 10)
    process = torch.full((6,), 1e-5, dtype=torch.float64, requires_grad=True)
    weights = dc.replace(MheWeights.of(MheConfig()), process=process)
    data.errors(weights)[2].backward()
    step = 1e-8

    def error(change):
        with torch.no_grad():
            return data.errors(dc.replace(weights, process=process + change))[2].item()

    assert process.grad[2].item() == pytest.approx(
        (error(step) - error(-step)) / (2 * step), rel=1e-4
    )
    assert process.grad[0].item() == 0.0  # channels do not meet


def test_tuning_mends_nervous_weights_on_rows_it_has_not_seen(made, noisy):
    nervous, half = MheConfig(process=[1e-7] * 3 + [1e-9] * 3), len(noisy.y) // 2
    tuned = mhe_tuning.tune(noisy.first(half), made.sequence.chi[:half], nervous, iterations=8)
    before, after = (
        np.mean((run_mhe(noisy, c).wrench - made.sequence.chi)[half:] ** 2, axis=0)
        for c in (nervous, tuned)
    )
    assert after[:3].sum() < 0.5 * before[:3].sum()
    assert after[3:].sum() < 0.5 * before[3:].sum()
    assert tuned.measurement == nervous.measurement


def straying_step(optimizer, closure):
    """The step of an optimiser whose last move is its worst."""
    for stray in (0.05, 1.0):
        closure()
        with torch.no_grad():
            optimizer.param_groups[0]["params"][1] -= stray


def test_tuning_returns_the_best_weights_it_met(made, noisy, monkeypatch):
    monkeypatch.setattr(torch.optim.LBFGS, "step", straying_step)
    short, chi = noisy.first(300), made.sequence.chi[:300]
    tuned = mhe_tuning.tune(short, chi)
    data = mhe_tuning._Data(short, chi, 10)
    before, after = (data.errors(MheWeights.of(c)) for c in (MheConfig(), tuned))
    assert (after / before).mean() <= 1.0


def test_what_cannot_be_tuned_on_is_refused(made, motion):
    y = motion.y.copy()
    y[5, 0] = np.nan
    for flight, n in ((dc.replace(motion, y=y), len(y)), (motion.first(8), 8)):
        with pytest.raises(ValueError, match="longer than a window and without gaps"):
            mhe_tuning.tune(flight, made.sequence.chi[:n])
