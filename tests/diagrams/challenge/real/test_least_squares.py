"""Laws of the opponents: a planted effect is found and measured, and BIC is sure of it."""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.challenge.real.effect_columns import (
    DAMPING,
    LENGTHS,
    Columns,
    drag_columns,
    library_columns,
    payload_columns,
    stacked,
    wind_columns,
)
from diagrams.challenge.real.least_squares import (
    fit,
    probability,
    select_by_bic,
    told_ground,
    told_payload,
    told_wind,
)
from diagrams.challenge.real.payload_position import wrench_of
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.effects.ground_effect import GroundEffect
from np_drake.effects.pendulum import hanging, swing_many
from np_drake.vehicle import Vehicle

DRAG = 0.4  # N s/m
WIND = np.array([-3.0, 1.0, 0.0])  # m/s


@pytest.fixture(scope="module")
def dragged(make_flight):
    return [make_flight_residuals(make_flight(1, lambda t, p, v, a: -DRAG * v), Vehicle())]


def test_a_better_bic_is_a_probability_above_one_half():
    assert probability(0.0) == 0.5
    assert probability(2 * np.log(9)) == pytest.approx(0.9)
    assert probability(-1e9) == pytest.approx(0.0)


def test_a_planted_drag_is_found_first_and_for_sure(dragged):
    found = select_by_bic(dragged, [*library_columns(dragged), wind_columns(dragged)])
    assert next(iter(found)) in ("linear_drag", "quadratic_drag")
    assert found.get("linear_drag", 0.0) > 0.99


def test_columns_of_noise_are_not_chosen():
    draw = np.random.default_rng(0)

    class Made:
        y = draw.normal(size=(2000, 6))

    noise = [Columns(f"noise_{i}", draw.normal(size=(2000, 6, 2))) for i in range(5)]
    assert select_by_bic([Made()], noise) == {}
    planted = Columns("planted", Made.y[..., None] + draw.normal(size=(2000, 6, 1)))
    assert list(select_by_bic([Made()], [*noise, planted])) == ["planted"]


def test_the_columns_of_drag_are_in_units_of_its_coefficient(dragged):
    own = fit(stacked(dragged), [drag_columns(dragged)])
    assert own.c == pytest.approx(np.full(3, DRAG), rel=0.05)  # rotor speed enters the drag


def test_told_drag_and_wind_gives_their_force_and_speed(make_flight):
    log = make_flight(2, lambda t, p, v, a: -DRAG * (v - WIND))
    _, wind, force = told_wind([make_flight_residuals(log, Vehicle())])
    assert force[:2] == pytest.approx(DRAG * WIND[:2], abs=0.05)  # N
    assert wind.x == pytest.approx(WIND[0], rel=0.1)


def test_told_a_payload_gives_its_mass_and_length(make_flight):
    mass, length = 0.15, 0.7

    def pull(t, p, v, a):
        start = hanging(np.array([[0.1, -0.05]]), np.zeros((1, 2)), length)
        a, v = 0.5 * (a[1:] + a[:-1]), 0.5 * (v[1:] + v[:-1])
        how = {"damping": DAMPING, "v_hook": v}
        pulls = swing_many(np.array([length]), *start, a, t[1] - t[0], 9.81, **how)[:, 0]
        return mass * np.concatenate([pulls[:1], 0.5 * (pulls[1:] + pulls[:-1]), pulls[-1:]])

    flights = [make_flight_residuals(make_flight(4, pull), Vehicle())]
    found = told_payload(flights)
    assert found["mass"]["value"] == pytest.approx(mass, rel=0.02)
    assert found["length"]["value"] == pytest.approx(length, rel=0.02)
    names = select_by_bic(flights, [*library_columns(flights), *payload_columns(flights, LENGTHS)])
    assert names.get("suspended_payload", 0.0) > 0.99


@pytest.mark.parametrize("radius", [0.2, 0.45])
def test_told_a_ground_effect_its_radius_is_that_planted_beside_a_drift(make_flight, radius):
    vehicle = Vehicle()
    log = make_flight(3, lambda t, p, v, a: 0 * v)
    log = dc.replace(log, p=log.p + [0.0, 0.0, 0.3])
    e = make_flight_residuals(log, vehicle)
    planted = wrench_of(log, vehicle, [GroundEffect(radius)], e.t)
    planted[:, 2] += 0.02 * e.t  # thrust that drifts [N]
    dut = told_ground(
        [dc.replace(e, y=e.y + np.pad(planted, ((0, 0), (0, e.y.shape[1] - planted.shape[1]))))]
    )
    assert dut["effective_radius"]["value"] == pytest.approx(
        radius, rel=0.03
    )  # of noise and the residual's grid
