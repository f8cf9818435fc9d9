import numpy as np
import pytest

from np_drake.residual_model import Memory, Sample, WrenchForecast, constant_forecast
from np_drake.skill.skill import (
    NAIVE,
    mean_interval,
    model_predictions,
    ratio_interval,
    skill_table,
)

HORIZONS = [0, 1, 3, 7]


class Linear:
    """chi+ = A chi + B zeta, known exactly."""

    name, step = "linear system", 0.02
    A = np.diag([0.9, 0.8, 0.95, 0.7, 0.6, 0.5])
    B = 0.1 * np.ones((6, 6))

    def initial_memory(self) -> Memory:
        return {"chi": np.zeros(6)}

    def update(self, memory: Memory, sample: Sample) -> Memory:
        return {"chi": sample.chi}

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        return WrenchForecast(self.A, self.B, np.eye(6), memory["chi"], np.zeros((horizon, 6)))

    def sequence(self, n: int = 60) -> tuple[np.ndarray, np.ndarray]:
        zeta = np.random.default_rng(0).standard_normal((n, 6))
        chi = np.zeros((n, 6))
        for k in range(n - 1):
            chi[k + 1] = self.A @ chi[k] + self.B @ zeta[k]
        return chi, zeta


class Hold(Linear):
    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        return constant_forecast(memory["chi"], horizon)


def table(models, chi, zeta, **settings):
    rows = skill_table(
        models, chi, zeta, horizons=HORIZONS, mean=np.full(6, 2.0), warm_up=5, **settings
    )
    return {(row.model, row.horizon): row for row in rows}


def test_a_model_that_knows_everything_has_no_error():
    rows = table({"np": Linear()}, *Linear().sequence())
    for horizon in HORIZONS:
        assert rows["np", horizon].force_rmse == pytest.approx(0.0, abs=1e-12)
        assert rows["np", horizon].torque_rmse == pytest.approx(0.0, abs=1e-12)


def test_holding_the_label_is_persistence():
    rows = table({"hold": Hold()}, *Linear().sequence())
    for horizon in HORIZONS:
        assert rows["hold", horizon].force_rmse == rows["persistence", horizon].force_rmse


def test_a_ramp_is_extrapolated_exactly_and_persistence_lags_by_its_slope():
    chi = np.arange(50.0)[:, None] * [3.0, 4.0, 0.0, 0.0, 0.0, 1.0]
    rows = table({}, chi, np.zeros((50, 6)))
    for horizon in HORIZONS:
        assert rows["linear", horizon].force_rmse == pytest.approx(0.0, abs=1e-9)
        assert rows["persistence", horizon].force_rmse == pytest.approx(5.0 * horizon)
        assert rows["persistence", horizon].torque_rmse == pytest.approx(1.0 * horizon)


def test_the_mean_is_that_of_the_training():
    rows = table({}, np.zeros((50, 6)), np.zeros((50, 6)))
    assert rows["mean", 3].force_rmse == pytest.approx(2.0 * np.sqrt(3))


def test_the_past_mean_is_that_of_the_flight_up_to_the_origin():
    chi = np.zeros((50, 6))
    chi[40:, 0] = 1e6  # no origin but the last three has seen it
    rows = table({}, chi, np.zeros((50, 6)))
    error = 1e6 * np.array(
        [1.0 - max(k - 39, 0) / (k + 1) for k in range(33, 43)]
    )  # origins 33 … 42, 7 ahead
    assert rows["past mean", 7].force_rmse == pytest.approx(np.sqrt((error**2).sum() / 38))


def test_skill_is_relative_to_the_best_naive_row():
    rows = table({"hold": Hold()}, *Linear().sequence())
    for horizon in HORIZONS[1:]:
        best = min(rows[name, horizon].force_rmse for name in NAIVE)
        row = rows["hold", horizon]
        assert row.force_skill == pytest.approx(row.force_rmse / best)
        assert row.force_ratio == pytest.approx(1.0)


def test_held_zeta_and_known_zeta_differ_only_beyond_one_step():
    chi, zeta = Linear().sequence()
    known, held = (table({"np": Linear()}, chi, zeta, zeta_known=known) for known in (True, False))
    assert held["np", 1].force_rmse == pytest.approx(0.0, abs=1e-12)
    assert held["np", 3].force_rmse > known["np", 3].force_rmse + 0.01


def test_batched_rollouts_are_the_forecasts_one_by_one():
    dut, (chi, zeta) = Linear(), Linear().sequence()
    origins = np.arange(10, 40)
    batch = model_predictions(dut, chi, zeta, origins, HORIZONS, zeta_known=True)
    for prediction, k in zip(batch, origins, strict=True):
        forecast = dut.forecast({"chi": chi[k]}, horizon=8, stride=1)
        np.testing.assert_allclose(
            prediction, forecast.rollout(zeta[k : k + 8])[HORIZONS], atol=1e-12
        )


def test_the_target_counts_where_it_is_given():
    chi, zeta = Linear().sequence()
    rows = table({"np": Linear()}, chi, zeta, target=chi + 1.0)
    assert rows["np", 0].force_rmse == pytest.approx(np.sqrt(3))


def test_a_flight_without_an_origin_is_refused():
    with pytest.raises(ValueError, match="more than 12 samples are needed; got 12"):
        table({}, np.zeros((12, 6)), np.zeros((12, 6)))


def errors(
    ratio: float, n: int = 4000, memory: int = 1, seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Squared errors (n, 1, 2) of a model and of its reference, alike over `memory` samples."""
    generator = np.random.default_rng(seed)
    base, own = (
        np.repeat(generator.standard_normal((n // memory, 1, 2)) ** 2, memory, axis=0)
        for _ in range(2)
    )
    return ratio**2 * own, base


def test_the_interval_holds_the_ratio_in_about_nineteen_of_twenty_flights():
    hits = []
    for seed in range(60):
        low, high = ratio_interval(*errors(0.6, seed=seed), [1])[0, 0]
        hits.append(low < 0.6 < high)
    assert np.mean(hits) > 0.85


def test_alike_neighbours_are_worth_less():
    def width(memory):
        return float(np.ptp(ratio_interval(*errors(0.6, memory=memory), [1])[0, 0]))

    assert width(100) > 3 * width(1)


def test_a_model_that_is_the_reference_has_ratio_one_for_certain():
    _, base = errors(1.0)
    np.testing.assert_allclose(ratio_interval(base, base, [1]), 1.0)


def test_of_too_short_a_flight_nothing_is_said():
    square, base = errors(0.6, n=40)
    assert np.isnan(ratio_interval(square, base, [10])).all()


def test_over_flights_each_flight_is_one_observation():
    mean, low, high = mean_interval(np.array([0.4, 0.6, 0.5]))
    assert mean == pytest.approx(0.5)
    assert (high - low) / 2 == pytest.approx(
        4.303 * 0.1 / np.sqrt(3), rel=1e-3
    )  # Student's t, 2 degrees of freedom
    assert np.isnan(mean_interval(np.array([0.4]))[1])
