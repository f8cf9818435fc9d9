"""Laws of generic structure as regressors."""

import dataclasses as dc
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from np_drake import attitude
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import (
    PREFIX,
    RegressionProblem,
    generic_candidates,
    library_candidates,
)
from np_drake.diagnosis.regressors.generic import _twist
from np_drake.diagnosis.selection.map_model import search
from np_drake.effects.base import WrenchEffect
from np_drake.rigid_body import P, Q, V, W

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)


@dc.dataclass(frozen=True)
class Spring(WrenchEffect):
    """A force in W towards one place, strongest half a metre away."""

    identifier: ClassVar[str] = "spring"

    def wrench(self, vehicle, motion):
        off = motion.x[..., P] - [0.6, -0.4, 1.2]
        chi = np.zeros((*off.shape[:-1], 6))
        chi[..., :3] = -0.8 * off * np.exp(-2.0 * np.sum(off**2, axis=-1))[..., None]
        return chi


@dc.dataclass(frozen=True)
class Magnus(WrenchEffect):
    """A force across body rate and velocity."""

    identifier: ClassVar[str] = "magnus"

    def wrench(self, vehicle, motion):
        f_B = 0.5 * np.cross(
            motion.x[..., W], attitude.rotate_back(motion.x[..., Q], motion.x[..., V])
        )
        return np.concatenate([attitude.rotate(motion.x[..., Q], f_B), 0 * f_B], axis=-1)


@dc.dataclass(frozen=True)
class Damper(WrenchEffect):
    """A torque against the body rate."""

    identifier: ClassVar[str] = "damper"

    def wrench(self, vehicle, motion):
        return np.concatenate([np.zeros_like(motion.x[..., W]), -0.02 * motion.x[..., W]], axis=-1)


@dc.dataclass(frozen=True)
class Plate(WrenchEffect):
    """A force along body y with the product of the two other velocities."""

    identifier: ClassVar[str] = "plate"

    def wrench(self, vehicle, motion):
        v_B = attitude.rotate_back(motion.x[..., Q], motion.x[..., V])
        f_B = np.zeros_like(v_B)
        f_B[..., 1] = 0.5 * np.abs(v_B[..., 0]) * v_B[..., 2]
        return np.concatenate([attitude.rotate(motion.x[..., Q], f_B), 0 * f_B], axis=-1)


def problem_of(seen, noise, *effects) -> RegressionProblem:
    flights = [seen(*effects, name=str(i), seed=i, noise=1.0) for i in (1, 2)]
    candidates = [*library_candidates(flights), *generic_candidates(flights, priors=REAL.priors)]
    return RegressionProblem(flights, noise, [], candidates, temperature=2.0, options=REAL)


def found(problem: RegressionProblem) -> list[str]:
    return [n for i in search(problem)[0].members for n in problem.candidates[i].identifiers]


@pytest.mark.parametrize(
    "effect, name",
    [(Spring(), "place"), (Magnus(), "side force"), (Damper(), "rates"), (Plate(), "cross flow")],
    ids=lambda e: str(e),
)
def test_what_no_effect_explains_is_found_where_it_lives(seen, noise, effect, name):
    assert found(problem_of(seen, noise, effect)) == [PREFIX + name]


@pytest.fixture(scope="module")
def groups(seen):
    flights = [seen(name=str(i), seed=i, noise=1.0, seconds=6.0) for i in (1, 2)]
    return flights, generic_candidates(flights, priors=REAL.priors)


def test_groups_are_of_the_size_of_their_prior_and_leave_sensors_alone(groups):
    _, candidates = groups
    weight = 2.0 * 9.81
    for c in candidates:
        X = c.columns["1"]
        np.testing.assert_array_equal(X[:, 6:], 0.0)
        rms = np.sqrt(np.mean(X**2, axis=0))
        assert np.isfinite(X).all()
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
    u = np.column_stack([0 * t, np.sin(2 * np.pi * frequency * t), 0 * t, 0 * t])
    state = SimpleNamespace(step=0.005, u=u, weight=20.0, torque_unit=0.5)
    columns = _twist(frequency, priors=REAL.priors)(state)[4000:, 3]
    drive = REAL.priors.twist_torque / (REAL.priors.generic_size * 20.0 * 0.5)
    sizes = np.abs(columns).max(axis=0)
    np.testing.assert_allclose(
        sizes[:4], drive, rtol=0.03
    )  # of G, D G / w, and the same of G², sampled
