"""Laws of generic structure as regressors."""

from types import SimpleNamespace

import numpy as np
import pytest

from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import PREFIX, generic_candidates
from np_drake.diagnosis.regressors.generic import FlightState, _twist

REAL = Options.for_sensors(True)


def magnus(v, w):
    return 0.5 * np.cross(w, v), 0.0


def plate(v, w):
    return np.outer(np.abs(v[:, 0]) * v[:, 2], [0.0, 0.5, 0.0]), 0.0


def damper(v, w):
    return 0.0, -0.02 * w


@pytest.mark.parametrize(
    "wrench, name", [(magnus, "side force"), (damper, "rates"), (plate, "cross flow")]
)
def test_what_no_effect_explains_is_in_the_columns_where_it_lives(groups, wrench, name):
    flights, candidates = groups
    state = FlightState(flights[0])
    y = np.zeros((len(state.v), 6))
    y[:, :3], y[:, 3:] = wrench(state.v, state.w)
    left = {}
    for c in candidates:
        X = c.columns["1"][:, :6].reshape(y.size, -1)
        left[c.identifiers[0]] = np.linalg.norm(
            y.ravel() - X @ np.linalg.lstsq(X, y.ravel(), rcond=None)[0]
        )
    assert left[PREFIX + name] < 1e-6 * np.linalg.norm(y)
    assert min(left, key=lambda group: left[group]) == PREFIX + name


@pytest.fixture(scope="module")
def groups(seen):
    flights = [seen(name=str(i), seed=i, noise=1.0, seconds=6.0) for i in (1, 2)]
    return flights, generic_candidates(flights, priors=REAL.priors)


def test_groups_are_of_the_size_of_their_prior_and_leave_sensors_alone(groups):
    weight = 2.0 * 9.81
    for c in groups[1]:
        X = c.columns["1"]
        np.testing.assert_array_equal(X[:, 6:], 0.0)
        rms = np.sqrt(np.mean(X**2, axis=0))
        assert 1e-4 * weight < rms[:3].max() or 1e-6 * weight < rms[3:].max()
        assert rms[:3].max() < 0.2 * weight


def test_a_force_at_a_place_is_along_the_axes_of_the_world(groups):
    flights, candidates = groups
    place = next(c for c in candidates if c.identifiers == (PREFIX + "place",)).columns["1"]
    R = flights[0].R_WB
    force_W = np.einsum("nij,njk->nik", R, place[:, :3])
    each = place.shape[-1] // 3
    for axis in range(3):
        own = force_W[:, :, axis * each : (axis + 1) * each]
        others = np.delete(own, axis, axis=1)
        assert np.abs(others).max() < 0.02 * np.abs(own).max()
        assert np.all(own[25:-25, axis] >= -1e-3)


@pytest.mark.parametrize("frequency", [1.0, 3.0])
def test_a_resonance_is_at_its_peak_as_large_as_its_drive(frequency):
    t = 0.005 * np.arange(8000)
    u = np.column_stack([0 * t, *[np.sin(2 * np.pi * frequency * t)] * 3])
    state = SimpleNamespace(step=0.005, u=u, weight=20.0, torque_unit=0.5)
    columns = _twist(frequency, priors=REAL.priors)(state)[4000:]
    drive = REAL.priors.twist_torque / (REAL.priors.generic_size * 20.0 * 0.5)
    for axis in range(3):  # of G, D G / w, and the same of G², sampled
        sizes = np.abs(columns[:, 3 + axis]).max(axis=0)
        np.testing.assert_allclose(sizes[4 * axis : 4 * axis + 4], drive, rtol=0.03)
