"""Laws of what follows a place."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake import attitude
from np_drake.diagnosis.slow_force import position_p_value
from np_drake.rigid_body import P, V


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


def jet(e):
    """(n, 3) level force in W about the middle of a flight: it points one way on all sides."""
    p = np.stack([np.interp(e.t, e.rows.t, axis) for axis in e.rows.x[:, :3].T], axis=1)
    away = (p - p.mean(axis=0)) / p.std(axis=0)
    return np.exp(-0.5 * np.sum(away[:, :2] ** 2, axis=1))[:, None] * np.array([1.0, -0.5, 0.0])


def behind(e):
    """(n, 3) a drag's force in W."""
    return -0.3 * np.stack([np.interp(e.t, e.rows.t, axis) for axis in e.rows.x[:, 7:10].T], axis=1)


@pytest.mark.parametrize(("force", "tied"), [(jet, True), (behind, False)])
def test_a_force_beside_gusts_depends_on_place_if_velocity_does_not_tell(
    flights, force, tied, pushed
):
    residual = pushed(flights, np.random.default_rng(4), 0.6)
    for e in flights:
        residual[e.name] = 0.3 * residual[e.name]
        residual[e.name][:, :3] += attitude.rotate_back(e.q, force(e))
    chance = position_p_value(flights, residual, {})
    assert chance < 1e-6 if tied else chance > 1e-2


def around(e):
    """The flight on a circle, its attitude kept."""
    angle, x = 2 * np.pi * 0.25 * e.rows.t, e.rows.x.copy()
    zero = np.zeros_like(angle)
    x[:, P] = np.stack([np.cos(angle), np.sin(angle), zero + 1.2], axis=1)
    x[:, V] = 0.5 * np.pi * np.stack([-np.sin(angle), np.cos(angle), zero], axis=1)
    return dc.replace(e, rows=dc.replace(e.rows, x=x))


def test_on_a_circle_where_velocity_goes_with_the_place_a_field_is_no_drag(flights, pushed):
    normal, residual = np.array([0.8, 0.6, 0.0]), pushed(flights, np.random.default_rng(5), 0.6)
    circles = [around(e) for e in flights]
    assert position_p_value(circles, residual, {}) > 1e-2
    for e in circles:
        residual[e.name] = 0.3 * residual[e.name]
        residual[e.name][:, :3] += attitude.rotate_back(e.q, field(e, 0.6, normal))
    assert position_p_value(circles, residual, {}) < 1e-3


def test_gusts_in_one_flight_alone_or_from_late_on_are_tied_to_no_place(flights, pushed):
    for seed in range(20):
        begins = ({}, {e.name: 10.0 for e in flights}, {flights[0].name: np.inf})[seed % 3]
        residual = pushed(flights, np.random.default_rng(seed), 0.6)
        for e in flights:
            residual[e.name] *= (e.t >= begins.get(e.name, -np.inf))[:, None]
        assert position_p_value(flights, residual, begins) > 1e-3


def test_where_no_wind_blows_nothing_follows_the_place(flights, pushed):
    residual = pushed(flights, np.random.default_rng(1), 0.6, begin=15.0)
    assert (
        position_p_value(flights, residual, {flights[0].name: 19.95, flights[1].name: 15.0}) > 1e-3
    )
