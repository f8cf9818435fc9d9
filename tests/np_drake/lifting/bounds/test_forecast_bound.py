"""Laws of the bound on forecasts whose matrices change from solve to solve."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.lifting.bounds.forecast_bound import forecast_bound
from np_drake.residual_model import WrenchForecast, constant_forecast

N, K = 12, 4
CHI, ZETA = np.array([1.0, 1.0, 2.0, 0.1, 0.1, 0.05]), np.array([1.0, 1.5, 1.0, 2.0, 2.0, 0.5])


def changes(values, scale):
    """Largest scaled change over 0 … N-1 rows from the first."""
    return np.maximum.accumulate(np.linalg.norm((values - values[0]) / scale, axis=1))


def random_forecast(draw):
    A = draw.normal(size=(K, K))
    A *= draw.uniform(0.3, 1.0) / np.abs(np.linalg.eigvals(A)).max()
    return WrenchForecast(
        A, draw.normal(size=(K, 6)), draw.normal(size=(6, K)), draw.normal(size=K), draw.normal(size=(N, 6))
    )


@given(st.integers(0, 2**31 - 1))
@settings(max_examples=80, deadline=None)
def test_no_error_exceeds_the_bound_whatever_the_matrices(seed):
    draw = np.random.default_rng(seed)
    forecast = random_forecast(draw)
    chi, zeta = (np.cumsum(draw.normal(size=(N, 6)), axis=0) for _ in range(2))
    bound = forecast_bound(
        forecast, chi[0], zeta[0], changes(chi, CHI), changes(zeta, ZETA), chi_scale=CHI, zeta_scale=ZETA
    )
    error = np.linalg.norm((chi - forecast.rollout(zeta)) / CHI, axis=1)
    assert np.all(error <= bound * (1 + 1e-9) + 1e-9)


def test_it_is_met_with_equality_where_only_the_wrench_moves_along_one_line():
    forecast = constant_forecast(np.zeros(6), N)
    chi = np.outer(np.arange(N), [0.3, 0, 0, 0, 0, 0])
    bound = forecast_bound(
        forecast, chi[0], np.zeros(6), changes(chi, CHI), np.zeros(N), chi_scale=CHI, zeta_scale=ZETA
    )
    np.testing.assert_allclose(bound, 0.3 * np.arange(N))


def test_changes_that_are_understated_break_it():
    chi = np.cumsum(np.ones((N, 6)), axis=0)
    bound = forecast_bound(
        constant_forecast(chi[0], N), chi[0], np.zeros(6), 0.5 * changes(chi, CHI), np.zeros(N),
        chi_scale=CHI, zeta_scale=ZETA,
    )  # fmt: skip
    error = np.linalg.norm((chi - chi[0]) / CHI, axis=1)
    assert np.any(error > bound)


def test_a_forecast_that_reacts_at_once_is_refused():
    class Reaction:
        def __call__(self, zeta):
            return zeta

    forecast = constant_forecast(np.zeros(6), N)
    reacting = WrenchForecast(
        forecast.A, forecast.B, forecast.C, forecast.z, forecast.offset, reaction=Reaction()
    )
    with pytest.raises(ValueError, match="reaction"):
        forecast_bound(
            reacting, np.zeros(6), np.zeros(6), np.zeros(N), np.zeros(N), chi_scale=CHI, zeta_scale=ZETA
        )
