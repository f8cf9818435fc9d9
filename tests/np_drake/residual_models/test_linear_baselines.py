import numpy as np
import pytest

from np_drake.residual_model import Sample
from np_drake.residual_models.linear_baselines import fit_all, fit_dmdc, fit_ridge
from np_drake.skill.skill import model_predictions
from np_drake.training_data.segments import Segment

STEP, HORIZONS = 0.01, np.array([1, 2, 5, 10])
A = 0.9 * np.linalg.qr(np.random.default_rng(0).standard_normal((6, 6)))[0]
B = 0.1 * np.random.default_rng(1).standard_normal((6, 6))
A2 = -0.3 * np.eye(6)


def flight(seed: int, *, delayed: bool = False, n: int = 500) -> Segment:
    """chi+ = A chi + B zeta, with delays 0.5 A chi + A2 chi_(k-1) + B zeta_(k-1) in its place."""
    generator = np.random.default_rng(seed)
    chi, zeta = generator.standard_normal((n, 6)), generator.standard_normal((n, 6))
    for k in range(1, n - 1):
        chi[k + 1] = (0.5 if delayed else 1.0) * A @ chi[k] + B @ zeta[k]
        if delayed:
            chi[k + 1] += A2 @ chi[k - 1] + B @ zeta[k - 1]
    return Segment(chi, zeta, STEP)


def test_dmdc_finds_the_system_that_made_the_data():
    dut = fit_dmdc([flight(0), flight(1)])
    np.testing.assert_allclose(
        dut.system.A, A, atol=0.02
    )  # the first sample of each flight fits nothing
    np.testing.assert_allclose(dut.system.B, B, atol=0.02)


def test_with_delays_a_longer_memory_is_found():
    unseen, origins = flight(5, delayed=True), np.arange(20, 400)
    for delays, small in ((1, False), (3, True)):
        dut = fit_dmdc([flight(3, delayed=True)], delays=delays)
        chi_hat = model_predictions(dut, unseen.chi, unseen.zeta, origins, [1, 5], zeta_known=True)
        error = np.abs(chi_hat - unseen.chi[origins[:, None] + [1, 5]]).max()
        assert (error < 0.1) == small


def test_the_ridge_is_as_good_as_any_linear_map_one_step_ahead():
    unseen, origins = flight(6), np.arange(20, 400)
    dut = fit_ridge([flight(0), flight(1)], HORIZONS)
    chi_hat = model_predictions(dut, unseen.chi, unseen.zeta, origins, [1], zeta_known=False)[:, 0]
    assert np.abs(chi_hat - unseen.chi[origins + 1]).max() < 0.15


def test_the_ridge_is_linear_between_its_horizons_and_held_beyond():
    unseen, origins = flight(6), np.arange(20, 30)
    dut = fit_ridge([flight(0)], HORIZONS)
    two, three, five, ten, far = np.moveaxis(
        model_predictions(
            dut, unseen.chi, unseen.zeta, origins, [2, 3, 5, 10, 40], zeta_known=False
        ),
        1,
        0,
    )
    np.testing.assert_allclose(three, two + (five - two) / 3, atol=1e-12)
    np.testing.assert_array_equal(far, ten)


@pytest.mark.parametrize("known", [False, True])
@pytest.mark.parametrize("name", ["DMDc", "delay DMDc", "ridge by horizon"])
def test_a_whole_flight_at_once_is_the_flight_sample_by_sample(name, known):
    dut, unseen = fit_all([flight(0), flight(1)], HORIZONS)[name], flight(7, n=80)
    arguments = (dut, unseen.chi, unseen.zeta, np.arange(12, 60), [0, 1, 4, 15])
    at_once = model_predictions(*arguments, zeta_known=known)
    np.testing.assert_allclose(
        at_once, model_predictions(*arguments, zeta_known=known, at_once=False), atol=1e-9
    )


@pytest.mark.parametrize("name", ["DMDc", "delay DMDc", "ridge by horizon"])
def test_the_label_is_held_until_the_window_is_full_or_while_missing(name):
    dut = fit_all([flight(0)], HORIZONS)[name]
    memory, x = dut.initial_memory(), np.zeros(13)
    for chi in (np.ones(6), np.full(6, np.nan)):
        memory = dut.update(memory, Sample(x, np.zeros(4), chi))
    np.testing.assert_array_equal(memory["window"][-1, :6], 1.0)
    if dut.window > 2:
        np.testing.assert_array_equal(
            dut.forecast(memory, horizon=3, stride=1).rollout(np.zeros((3, 6))), 1.0
        )
