"""Laws of the peer on acados; what needs acados is skipped without it."""

import dataclasses as dc
import importlib.util

import numpy as np
import pytest

from diagrams.evidence.studies.bench import FOLDER, AcadosSolver
from np_drake.mpc.controller import shift
from np_drake.mpc.sqp import SqpSolver


def peer(vehicle, config, **how):
    try:
        return AcadosSolver(vehicle, config, **how)
    except (ImportError, FileNotFoundError) as reason:
        pytest.skip(f"optional peer: {reason}")


@pytest.mark.parametrize("K", [0, 24])
def test_the_peer_has_the_same_optimum(vehicle, config, make_problem, K):
    problems = [make_problem(config, K=K, seed=k) for k in range(5)]
    sqp = SqpSolver(vehicle, config, steps=30, max_steps=30, time_limit=np.inf)
    dut = peer(vehicle, config, steps=15)
    gaps = [dut.solve(p).cost / sqp.solve(p).cost - 1 for p in problems]
    np.testing.assert_allclose(gaps, 0.0, atol=1e-6)  # relative; HPIPM's tolerance


def test_one_iteration_is_our_sqp_step(vehicle, config, make_problem):
    """Both are full Gauss-Newton steps of the same problem from the same plan."""
    first, second = (make_problem(config, offset=offset) for offset in (0.1, 0.09))
    sqp = SqpSolver(vehicle, config, max_steps=1, time_limit=np.inf)
    plan = shift(sqp.solve(first), elapsed=0.02, step=config.step)
    ours, theirs = (s.solve(second, plan) for s in (sqp, peer(vehicle, config)))
    np.testing.assert_allclose(theirs.u, ours.u, atol=1e-3)  # [N, N·m]
    assert theirs.cost == pytest.approx(ours.cost, rel=1e-6)
    assert theirs.solve_time > 0.0


def test_a_vehicle_whose_rotors_lag_is_refused(vehicle, config):
    with pytest.raises(ValueError, match="knows no lag"):
        AcadosSolver(dc.replace(vehicle, rotor_time_constant=0.1), config)


def test_the_peer_names_what_it_lacks(vehicle, config, monkeypatch):
    monkeypatch.delenv(FOLDER, raising=False)
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    with pytest.raises(ImportError, match="comma-deps-acados"):
        AcadosSolver(vehicle, config)
