import importlib

import numpy as np
import pytest

from diagrams.studies.casadi_peer import CasadiSolver, ProblemInCasadi
from np_drake.mpc.sqp import SqpSolver
from np_drake.rigid_body import state_derivative


@pytest.fixture(scope="module")
def dut(vehicle, config):
    pytest.importorskip("casadi", reason="optional extra `bench`", exc_type=ImportError)
    return CasadiSolver(vehicle, config)


def test_the_peer_flies_eq_1(dut, vehicle, config):
    import casadi

    x, u, chi = (casadi.SX.sym("v", n) for n in (13, 4, 6))
    f = casadi.Function("f", [x, u, chi], [ProblemInCasadi(vehicle, config).derivative(x, u, chi)])
    rng = np.random.default_rng(0)
    values = [rng.normal(size=n) for n in (13, 4, 6)]
    np.testing.assert_allclose(
        np.array(f(*values)).ravel(), state_derivative(vehicle, *values), atol=1e-12
    )


@pytest.mark.parametrize("K", [0, 24])
def test_the_peer_solves_the_same_problem(dut, vehicle, config, make_problem, K):
    problem = make_problem(config, K=K, offset=0.3)
    sqp = SqpSolver(vehicle, config, steps=30, max_steps=30, time_limit=np.inf)
    assert dut.solve(problem).cost == pytest.approx(sqp.solve(problem).cost, rel=1e-5)


def test_without_casadi_the_error_says_what_to_install(vehicle, config, monkeypatch):
    def missing(name, *_):
        raise ImportError(name)

    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(ImportError, match=r"np_drake\[bench\]"):
        CasadiSolver(vehicle, config)
