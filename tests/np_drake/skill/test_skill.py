"""Laws of the tables of skill, and of their intervals."""

import numpy as np
import pytest

from np_drake.residual_model import WrenchForecast
from np_drake.residual_models.hold import Hold
from np_drake.skill.skill import NAIVE, diverged, skill_table
from np_drake.training_data.segments import Segment

STEP, HORIZONS = 0.02, [0, 1, 3, 7]


def test_a_flight_on_which_a_forecast_diverges_is_named():
    """Nothing keeps a naive row from it. Without torque in the label its peak is NaN."""
    row = {"flight": "one", "model": "lifted", "force_rmse": 1.0, "torque_rmse": 1.0}
    row |= {"force_peak": 1.2, "torque_peak": float("nan")}
    assert diverged([row, {**row, "flight": "two", "model": "linear", "force_peak": 1e9}]) == []
    assert diverged([row, {**row, "flight": "two", "force_peak": 11.0}]) == ["two"]
    assert diverged([{**row, "torque_rmse": float("inf")}]) == ["one"]


class Linear:
    """chi+ = A chi + B zeta, known exactly."""

    name, step = "linear system", STEP
    A = np.diag([0.9, 0.8, 0.95, 0.7, 0.6, 0.5])
    B = 0.1 * np.ones((6, 6))

    def initial_memory(self):
        return {"chi": np.zeros(6)}

    def update(self, memory, sample):
        return {"chi": sample.chi}

    def forecast(self, memory, *, horizon, stride):
        return WrenchForecast(self.A, self.B, np.eye(6), memory["chi"], np.zeros((horizon, 6)))


def sequence(n: int = 60) -> tuple[np.ndarray, np.ndarray]:
    zeta, chi = np.random.default_rng(0).standard_normal((n, 6)), np.zeros((n, 6))
    for k in range(n - 1):
        chi[k + 1] = Linear.A @ chi[k] + Linear.B @ zeta[k]
    return chi, zeta


def table(models, chi, zeta, target=None, **settings):
    options = {"horizons": HORIZONS, "mean": np.full(6, 2.0), "warm_up": 5} | settings
    rows = skill_table(models, Segment(chi, zeta, STEP, target), **options)
    return {(row["model"], row["horizon"]): row for row in rows}


def test_a_model_that_knows_everything_has_the_error_of_a_held_zeta():
    chi, zeta = sequence()
    rows = table({"np": Linear()}, chi, zeta)
    for horizon in HORIZONS:
        for kind in ("force", "torque"):
            assert rows["np", horizon][f"{kind}_rmse"] == pytest.approx(0.0, abs=1e-12)
    other = table({"np": Linear()}, chi, zeta, target=chi + 1.0)
    assert other["np", 0]["force_rmse"] == pytest.approx(np.sqrt(3))
    held = table({"np": Linear()}, chi, zeta, motion="held")
    assert held["np", 1]["force_rmse"] == pytest.approx(0.0, abs=1e-12)
    assert held["np", 3]["force_rmse"] > 0.01


def test_a_ramp_is_extrapolated_exactly_and_persistence_lags_by_its_slope():
    chi = np.arange(50.0)[:, None] * [3.0, 4.0, 0.0, 0.0, 0.0, 1.0]
    rows = table({}, chi, np.zeros((50, 6)))
    for horizon in HORIZONS:
        assert rows["linear", horizon]["force_rmse"] == pytest.approx(0.0, abs=1e-9)
        assert rows["persistence", horizon]["force_rmse"] == pytest.approx(5.0 * horizon)
        assert rows["persistence", horizon]["torque_rmse"] == pytest.approx(1.0 * horizon)


def test_the_means_are_of_the_training_and_of_the_past():
    assert table({}, *np.zeros((2, 50, 6)))["mean", 3]["force_rmse"] == pytest.approx(
        2 * np.sqrt(3)
    )
    chi = np.zeros((50, 6))
    chi[40:, 0] = 1e6  # no origin but the last three has seen it
    rows = table({}, chi, np.zeros((50, 6)))
    # Origins 33 … 42, 7 ahead
    error = 1e6 * np.array([1.0 - max(k - 39, 0) / (k + 1) for k in range(33, 43)])
    expected = np.sqrt((error**2).sum() / 38)
    assert rows["past mean", 7]["force_rmse"] == pytest.approx(expected)


def test_skill_is_over_the_best_naive_row_and_holding_is_persistence():
    rows = table({"hold": Hold(step=STEP)}, *sequence())
    for horizon in HORIZONS[1:]:
        best = min(rows[name, horizon]["force_rmse"] for name in NAIVE)
        row = rows["hold", horizon]
        assert row["force_rmse"] == rows["persistence", horizon]["force_rmse"]
        assert row["force_skill"] == pytest.approx(row["force_rmse"] / best)
        assert row["force_ratio"] == pytest.approx(1.0)
