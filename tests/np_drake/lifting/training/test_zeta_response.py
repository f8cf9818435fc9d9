import numpy as np
import pytest

from np_drake.lifting.training.mode_dictionary import (
    coupled,
    departures,
    fit_response,
    time_constants,
)

MODES = time_constants((3.0, 20.0), (3.0, 20.0), 1e4)
HORIZONS = np.array([0, 1, 3, 10, 30])
B = 0.1 * np.random.default_rng(5).standard_normal((MODES.K, 6))
B[[2, 5, 8]] = 0.0  # the levels


def walk(n: int = 500, seed: int = 0) -> np.ndarray:
    return np.cumsum(0.1 * np.random.default_rng(seed).standard_normal((n, 6)), axis=0)


def test_departures_are_what_the_system_adds_to_a_held_forecast():
    zeta, k = walk(), 100
    system = coupled(MODES, B, 1.0 - 1e-12, 0.01)
    z = np.concatenate([np.zeros(MODES.K), zeta[k]])
    course = system.rollout(z, zeta[k : k + 31])[HORIZONS]
    u = departures(zeta, np.array([k]), HORIZONS, MODES.poles[0])[0]
    np.testing.assert_allclose(
        course[:, 0], np.einsum("hmp,mp->h", u, B[MODES.places[0]]), atol=1e-9
    )


def test_a_held_zeta_leaves_the_held_forecast():
    system = coupled(MODES, B, 1.0 - 1e-12, 0.01)
    a, zeta = np.random.default_rng(1).standard_normal(MODES.K), np.arange(6.0)
    course = system.rollout(np.concatenate([a, zeta]), np.tile(zeta, (31, 1)))[HORIZONS]
    np.testing.assert_allclose(course, MODES.readout(HORIZONS) @ a, atol=1e-9)
    assert system.spectral_radius <= 1.0


def fitted(**settings):
    zeta = walk(4000)
    origins = np.arange(0, 3900, 3)
    rest = np.stack(
        [
            np.einsum(
                "ohmp,mp->oh",
                departures(zeta, origins, HORIZONS, MODES.poles[c]),
                B[MODES.places[c]],
            )
            for c in range(6)
        ],
        axis=-1,
    )
    settings = {"noise": 1e-6, "strength": 1e6, "symmetry": 0.0} | settings
    return fit_response([(zeta, origins, rest, np.ones((5, 2)))], MODES, HORIZONS, **settings)


def test_the_response_that_made_the_data_is_found():
    np.testing.assert_allclose(fitted(), B, atol=1e-3)


@pytest.mark.parametrize("doubt", [{"strength": 1e-6}, {"noise": 1e6}])
def test_where_nothing_is_believed_there_is_no_response(doubt):
    assert np.abs(fitted(**doubt)).max() < 1e-3
