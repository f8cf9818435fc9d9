import numpy as np
import pytest

from np_drake.lifting.model.encoders import Trust
from np_drake.lifting.training.mode_dictionary import time_constants

HORIZONS = np.array([1, 2, 5, 10, 20])
MODES = time_constants((2.0, 8.0, 30.0), (2.0, 8.0, 30.0), 1e5)
DUT = Trust(
    HORIZONS,
    MODES.readout(HORIZONS),
    MODES.projector(HORIZONS, np.ones((5, 2)), ridge=1e-12),
    np.zeros(6),
    half=20.0,
    evidence=10.0,
    caution=30.0,
    settle=20.0,
)


def sway(n: int = 800) -> np.ndarray:
    """(n, 6) a sum of slow lines on a level of 3 in force."""
    t = np.arange(n)[:, None]
    phase = np.arange(6.0)
    return np.sin(0.05 * t + phase) + 0.5 * np.sin(0.13 * t + 2 * phase) + 3.0 * (np.arange(6) < 3)


def course(chi: np.ndarray, origins: np.ndarray, gain: float) -> np.ndarray:
    """(o, K) lifted states whose forecast departs `gain` times as much as the wrench will."""
    future = chi[origins[:, None] + HORIZONS]
    base = np.where(np.arange(6) < 3, chi[origins], 0.0)[:, None]
    return np.einsum("khc,ohc->ok", DUT.projector, base + gain * (future - base))


def errors(z: np.ndarray, chi: np.ndarray, origins: np.ndarray) -> np.ndarray:
    """(5, 2) RMSE of force and torque by horizon, over the second half."""
    error = np.einsum("hck,ok->ohc", DUT.readout, z) - chi[origins[:, None] + HORIZONS]
    square = (error[len(error) // 2 :] ** 2).mean(axis=0)
    return np.sqrt(np.stack([square[:, :3].sum(1), square[:, 3:].sum(1)], axis=1))


def test_the_whole_flight_at_once_is_the_flight_sample_by_sample():
    chi = sway(200) + 0.1 * np.random.default_rng(0).standard_normal((200, 6))
    first = 7
    z = np.random.default_rng(1).standard_normal((len(chi) - first, MODES.K))
    memory, one_by_one = DUT.initial_memory(), []
    for k, label in enumerate(chi):
        memory = DUT.observe(memory, label)
        if k >= first:
            memory, corrected = DUT.correct(memory, z[k - first], label)
            one_by_one.append(corrected)
    np.testing.assert_allclose(one_by_one, DUT.along(z, chi, first), atol=1e-9)


def test_a_forecast_of_the_future_is_never_used_before_it_is_verified():
    chi = sway(300)
    origins = np.arange(len(chi) - 21)
    z = course(chi, origins, 1.0)
    changed = chi.copy()
    changed[150:] += 5.0
    before = DUT.along(z, chi[: len(z)], 0)[:150]
    np.testing.assert_array_equal(before, DUT.along(z, changed[: len(z)], 0)[:150])


def test_a_good_forecast_comes_to_be_trusted():
    chi = sway()
    origins = np.arange(len(chi) - 21)
    z = course(chi, origins, 1.0)
    after = errors(DUT.along(z, chi[: len(z)], 0), chi, origins)
    held = errors(course(chi, origins, 0.0), chi, origins)
    assert np.all(after < 0.25 * held)


def test_a_forecast_in_the_wrong_direction_comes_to_be_ignored():
    chi = sway()
    origins = np.arange(len(chi) - 21)
    z = course(chi, origins, -1.0)
    after, raw = (errors(x, chi, origins) for x in (DUT.along(z, chi[: len(z)], 0), z))
    held = errors(course(chi, origins, 0.0), chi, origins)
    assert np.all(after < 1.1 * held)
    assert np.all(raw > 1.5 * held)


def test_before_any_evidence_a_far_forecast_is_half_believed():
    dut, chi = DUT, np.array([1.0, 0, 0, 0, 0, 0])
    z = np.einsum("khc,hc->k", dut.projector, np.tile([2.0, 0, 0, 1.0, 0, 0], (5, 1)))
    _, corrected = dut.correct(dut.observe(dut.initial_memory(), chi), z, chi)
    forecast = (dut.readout @ corrected)[:, 0]
    assert forecast[-1] == pytest.approx(1.5, abs=0.05)  # half = the last horizon
    assert forecast[0] == pytest.approx(1.95, abs=0.05)


def test_two_flights_do_not_influence_each_other():
    chi, z = sway(60), np.random.default_rng(2).standard_normal((60, MODES.K))

    def step(memory, k):
        return DUT.correct(DUT.observe(memory, chi[k]), z[k], chi[k])[0]

    memory = DUT.initial_memory()
    for k in range(40):
        memory = step(memory, k)
    kept = {name: value.copy() for name, value in memory.items()}
    step(memory, 40)
    for name, value in kept.items():
        np.testing.assert_array_equal(memory[name], value)
