"""Laws of the drag that feels gusts."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake import attitude
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.result import Cause, Estimate
from np_drake.diagnosis.wind.gust_drag import drag_in_gusts
from np_drake.diagnosis.wind.gusts import as_gusts
from np_drake.effects.linear_drag import LinearDrag
from np_drake.rigid_body import P, V

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)

D = np.array([0.25, 0.2, 0.15])
MASS, STIFFNESS, DAMPING = 1.0, 3.0, 3.0
LATE = 8.0


@pytest.fixture(scope="module")
def flights(seen):
    return [seen(name=str(i), seed=i, seconds=20.0) for i in (1, 2)]


def yielding(
    e,
    rng,
    mean,
    *,
    D=D,
    deviation=2.0,
    time=1.5,
    effort=1.0,
    stiff=1.0,
    white=0.02,
    begin=-np.inf,
    early=False,
):
    """The flight of a vehicle that a soft controller holds in gusts, and what they leave of it (m, 15) by their drag.

    effort [N]: of the slow forces that move it about on purpose.   stiff: how much less it gives way [1].
    white [N]: noise.   early: does the drag act before the wind begins?
    """
    t, q, R_WB = e.t, e.q, attitude.rotation_matrix(e.q)
    step, x = e.grid.step, np.zeros((len(t), 6))
    force, wind = np.zeros((len(t), 3)), deviation * rng.standard_normal(3)
    phase = rng.uniform(0, 2 * np.pi, (2, 3))
    push = effort * np.sin(np.array([[1.0], [3.4]]) * t[:, None, None] + phase).sum(axis=1)
    decay = np.exp(-step / time)
    for k in range(len(t)):
        blown = t[k] >= begin
        felt = R_WB[k].T @ (x[k, 3:] - (mean + wind) * blown)
        force[k] = -R_WB[k] @ (D * felt) * (blown or early)
        a = (force[k] + push[k] - stiff * (STIFFNESS * x[k, :3] + DAMPING * x[k, 3:])) / MASS
        if k + 1 < len(t):
            x[k + 1, 3:] = x[k, 3:] + step * a
            x[k + 1, :3] = x[k, :3] + step * 0.5 * (x[k, 3:] + x[k + 1, 3:])
        wind = decay * wind + deviation * np.sqrt(1 - decay**2) * rng.standard_normal(3)
    rows = e.rows.x.copy()
    for columns, own in ((P, x[:, :3]), (V, x[:, 3:])):
        rows[:, columns] = np.stack([np.interp(e.rows.t, t, axis) for axis in own.T], axis=1)
    residual = np.zeros_like(e.y)
    residual[:, :3] = attitude.rotate_back(q, force + white * rng.standard_normal(force.shape))
    moved = dc.replace(e.rows, x=rows)
    return dc.replace(e, rows=moved, mids=dc.replace(e.mids, x=between(rows))), residual


def between(x):
    return 0.5 * (x[1:] + x[:-1])


def cause(*values):
    estimates = {
        f"d_{a}": Estimate(v, "N·s/m", (v - 0.1, v + 0.1)) for a, v in zip("xyz", values, strict=True)
    }
    return Cause("linear_drag", 1.0, estimates, {}, effect=LinearDrag(*values), share=0.5)


def found(flights, rng, first=(0.1, 0.1, 0.1), begins=None, **how):
    """The drag as a cause, of two flights in wind."""
    begins = begins or {}
    mean = np.array([1.0, -0.5, 0.0])
    pairs = [yielding(e, rng, mean, begin=begins.get(e.name, -np.inf), **how) for e in flights]
    felt = {e.name: residual for e, residual in pairs}
    drag = dc.replace(cause(*first), onset={} if how.get("early") else begins)
    return drag_in_gusts(drag, [e for e, _ in pairs], felt, begins, priors=REAL.priors)


def ends_of(drag):
    return [drag.parameters[f"d_{a}"].ci95 for a in "xyz"]


def values_of(drag):
    return np.array([drag.parameters[f"d_{a}"].value for a in "xyz"])


WAYS = {
    "throughout": {},
    "late": {"begins": {"1": LATE, "2": LATE}},
    "strong": {"D": 4 * np.array([0.25, 0.25, 0.2]), "first": (0.4, 0.4, 0.4)},
    "upright": {"D": np.array([0.25, 0.25, 0.75])},
}


@pytest.mark.parametrize("how", WAYS.values(), ids=WAYS)
def test_a_vehicle_that_yields_to_gusts_has_the_drag_it_has_and_intervals_hold_it(flights, how):
    true = how.get("D", D)
    drags = [found(flights, np.random.default_rng(seed), effort=2.0, **how) for seed in range(8)]
    values = np.array([values_of(drag) for drag in drags])
    error = values.std(axis=0) / np.sqrt(len(values))
    if how is not WAYS["upright"]:  # which is drawn to the others
        assert np.all(np.abs(values.mean(axis=0) - true) < np.minimum(3 * error + 0.02 * true, 0.3 * true))
    inside = [[low < d < high for d, (low, high) in zip(true, ends_of(drag), strict=True)] for drag in drags]
    assert np.all(np.mean(inside, axis=0) > 0.6)
    assert np.mean(inside) > 0.8


def test_a_drag_that_acts_before_the_wind_is_known_from_then(flights):
    rng, begins = np.random.default_rng(5), {"1": 17.0, "2": 17.0}
    early = found(flights, rng, begins=begins, early=True)
    np.testing.assert_allclose(values_of(early), D, rtol=0.1)
    assert all(high - low < 0.1 for low, high in ends_of(early))


def test_it_does_not_matter_from_which_drag_the_search_starts(flights):
    some = [
        values_of(found(flights, np.random.default_rng(3), first))
        for first in ((0.1,) * 3, (0.4, 0.5, 0.3), (-0.09, -0.04, 0.1))  # the last lost to the gusts
    ]
    assert some[0] == pytest.approx(some[1], rel=0.02)
    assert some[0] == pytest.approx(some[2], rel=0.02)


def test_an_axis_along_which_nothing_moves_is_like_the_other_level_one(flights):
    for seed in range(4):
        rng, effort = np.random.default_rng(seed), np.array([20.0, 0.0, 20.0])
        still = found(flights, rng, deviation=0.3, effort=effort, stiff=10.0, white=1.0)
        x, y = still.parameters["d_x"], still.parameters["d_y"]
        assert abs(y.value - x.value) < 0.1
        assert y.ci95[1] - y.ci95[0] > x.ci95[1] - x.ci95[0]


def test_where_flights_hardly_show_the_drag_that_feels_gusts_it_is_a_usual_one_in_wide_intervals(flights):
    true = np.array([0.4, 0.35, 0.3])
    for seed in range(4):
        drag = found(flights, np.random.default_rng(seed), (-0.1, -0.1, 0.3), D=true, effort=0.0, stiff=20.0)
        assert drag is not None
        assert np.all(np.abs(np.log(values_of(drag) / true)) < np.log(4.0))
        assert all(low < d < high for d, (low, high) in zip(true, ends_of(drag), strict=True))


def test_a_calm_of_no_bins_before_the_wind_tells_nothing(flights):
    begins = {"1": 0.05, "2": LATE}
    drag = found(flights, np.random.default_rng(6), begins=begins, early=True, effort=2.0)
    assert np.all(np.abs(values_of(drag) - D) < 0.5 * D)


def test_where_no_drag_is_there_the_cause_stays_as_it_is(flights):
    felt = {e.name: np.zeros_like(e.y) for e in flights}
    rng = np.random.default_rng(2)
    for e in flights:  # a force along the motion is no drag
        v = np.stack([np.interp(e.t, e.rows.t, axis) for axis in e.rows.x[:, V].T], axis=1)
        force = 0.3 * v + 0.05 * rng.standard_normal(v.shape)
        felt[e.name][:, :3] = attitude.rotate_back(e.q, force)
    drag = cause(0.1, 0.1, 0.1)
    assert drag_in_gusts(drag, flights, felt, {}, priors=REAL.priors) is drag
    against = cause(-0.1, -0.1, 0.1)  # through which no wind acts
    assert drag_in_gusts(against, flights, felt, {}, priors=REAL.priors) is None
    assert as_gusts(flights, felt, [against], 0.9, IDEAL) == [against]
