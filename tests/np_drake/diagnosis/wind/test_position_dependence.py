"""Laws of what follows a place."""

import numpy as np
import pytest

from np_drake import attitude
from np_drake.diagnosis.slow_force import position_p_value


@pytest.fixture(scope="module")
def flights(seen):
    return [seen(name=str(i), seed=i, seconds=20.0) for i in (1, 2)]


def field(e, slope, normal):
    """(n, 3) force in W that grows along `normal`."""
    p = np.stack([np.interp(e.t, e.rows.t, axis) for axis in e.rows.x[:, :3].T], axis=1)
    return slope * (p @ normal)[:, None] * normal


def test_gusts_follow_the_place_as_often_as_chance_has_it(seen, pushed):
    flights, found = [seen(name=str(i), seed=i, seconds=12.0) for i in (1, 2)], []
    for seed in range(60):
        residual = pushed(flights, np.random.default_rng(seed), 0.6)
        found.append(position_p_value(flights, residual, {}))
    assert 0.35 < np.mean(found) < 0.65
    assert np.mean(np.array(found) < 0.1) < 0.25


def test_a_force_tied_to_a_place_is_no_gust_whatever_its_mean_in_a_flight(flights, pushed):
    normal = np.array([0.8, 0.6, 0.0])
    residual = pushed(flights, np.random.default_rng(3), 0.6)
    for i, e in enumerate(flights):
        tied = field(e, 1.0, normal) + 0.3 * i
        residual[e.name] = 0.3 * residual[e.name]
        residual[e.name][:, :3] += attitude.rotate_back(e.q, tied)
    assert position_p_value(flights, residual, {}) < 1e-6
