"""Laws of the peers on acados and CasADi; skipped without them."""

import dataclasses as dc
import importlib.util
import sys

import numpy as np
import pytest

from diagrams.studies.acados_peer import FOLDER, AcadosSolver
from diagrams.studies.casadi_peer import CasadiSolver, ProblemInCasadi
from np_drake.mpc.controller import shift
from np_drake.mpc.sqp import SqpSolver
from np_drake.rigid_body import state_derivative


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


@pytest.fixture(scope="module")
def casadi_peer(vehicle, config):
    pytest.importorskip("casadi", reason="optional extra `bench`", exc_type=ImportError)
    return CasadiSolver(vehicle, config)


def test_the_casadi_peer_flies_eq_1(casadi_peer, vehicle, config):
    import casadi

    x, u, chi = (casadi.SX.sym("v", n) for n in (13, 4, 6))
    f = casadi.Function("f", [x, u, chi], [ProblemInCasadi(vehicle, config).derivative(x, u, chi)])
    rng = np.random.default_rng(0)
    values = [rng.normal(size=n) for n in (13, 4, 6)]
    np.testing.assert_allclose(
        np.array(f(*values)).ravel(), state_derivative(vehicle, *values), atol=1e-12
    )


@pytest.mark.parametrize("K", [0, 24])
def test_the_casadi_peer_solves_the_same_problem(casadi_peer, vehicle, config, make_problem, K):
    problem = make_problem(config, K=K, offset=0.3)
    sqp = SqpSolver(vehicle, config, steps=30, max_steps=30, time_limit=np.inf)
    assert casadi_peer.solve(problem).cost == pytest.approx(sqp.solve(problem).cost, rel=1e-5)
    with pytest.raises(ValueError, match="knows no lag"):
        CasadiSolver(dc.replace(vehicle, rotor_time_constant=0.1), config)


@pytest.mark.parametrize(
    "peer, remedy", [(AcadosSolver, "comma-deps-acados"), (CasadiSolver, r"np_drake\[bench\]")]
)
def test_a_peer_names_what_it_lacks(vehicle, config, monkeypatch, peer, remedy):
    monkeypatch.delenv(FOLDER, raising=False)
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    monkeypatch.setitem(sys.modules, "casadi", None)
    with pytest.raises(ImportError, match=remedy):
        peer(vehicle, config)
