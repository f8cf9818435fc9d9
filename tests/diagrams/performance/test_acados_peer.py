import dataclasses as dc

import numpy as np
import pytest

from diagrams.performance import acados_code
from diagrams.performance.acados_model import solver_options
from diagrams.performance.acados_peer import AcadosSolver
from diagrams.performance.problems import tracking_problems
from np_drake.mpc.controller import shift
from np_drake.mpc.problem import SolverFailure
from np_drake.mpc.sqp import SqpSolver


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory):
    """An empty cache for this module."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield acados_code.cache_folder()


@pytest.fixture(scope="module")
def acados(cache):
    """acados and a compiler, or a skipped test."""
    try:
        acados_code.find_compiler()
        return acados_code.find_acados()
    except (ImportError, FileNotFoundError) as reason:
        pytest.skip(f"optional peer: {reason}")


@pytest.mark.parametrize("N", [10, 20])
@pytest.mark.parametrize("K", [0, 24])
def test_the_peer_has_the_same_optimum(acados, vehicle, config, N, K):
    config = dc.replace(config, horizon=N)
    problems = tracking_problems(vehicle, config, count=10, lifted=K)
    sqp = SqpSolver(vehicle, config, steps=30, max_steps=30, time_limit=np.inf)
    dut = AcadosSolver(vehicle, config, steps=15)
    gaps = [dut.solve(p).cost / sqp.solve(p).cost - 1 for p in problems]
    np.testing.assert_allclose(gaps, 0.0, atol=1e-6)  # relative; HPIPM's tolerance


def test_one_iteration_is_our_sqp_step(acados, vehicle, config):
    """Both are full Gauss-Newton steps of the same problem from the same plan."""
    first, second = tracking_problems(vehicle, config, count=2)
    sqp = SqpSolver(vehicle, config, max_steps=1, time_limit=np.inf)
    plan = shift(sqp.solve(first), elapsed=0.02, step=config.step)
    ours, peers = (s.solve(second, plan) for s in (sqp, AcadosSolver(vehicle, config)))
    np.testing.assert_allclose(peers.u, ours.u, atol=1e-3)  # [N, N·m]
    assert peers.cost == pytest.approx(ours.cost, rel=1e-6)


def test_an_active_soft_set_holds_and_has_the_same_optimum(acados, vehicle, config, make_problem):
    config = dc.replace(config, max_speed=0.25)
    problem = make_problem(
        config, offset=0.3
    )  # begins at 0.15 m/s; without the set it would reach 0.96 m/s
    sqp = SqpSolver(vehicle, config, steps=30, max_steps=30, time_limit=np.inf)
    answer = AcadosSolver(vehicle, config, steps=30).solve(problem)
    assert np.abs(answer.x[:, 7:10]).max() == pytest.approx(0.25, abs=1e-5)  # [m/s]
    assert answer.cost == pytest.approx(sqp.solve(problem).cost, rel=1e-6)


def test_the_price_on_the_swing_is_the_same(acados, vehicle, config, make_problem):
    config = dc.replace(config, weight_swing=5.0)
    problem = make_problem(config, K=4)
    sqp = SqpSolver(vehicle, config, steps=30, max_steps=30, time_limit=np.inf)
    dut = AcadosSolver(vehicle, config, steps=15)
    assert dut.solve(problem).cost == pytest.approx(sqp.solve(problem).cost, rel=1e-5)


def test_neither_a_solve_nor_a_failure_leaves_a_trace(acados, vehicle, config, make_problem):
    config = dc.replace(config, max_speed=0.15)
    dut = AcadosSolver(vehicle, config, steps=30)
    easy, hard, impossible = (make_problem(config, offset=size) for size in (0.01, 0.1, 0.2))
    before = dut.solve(easy)
    dut.solve(hard)
    np.testing.assert_array_equal(dut.solve(easy).u, before.u)
    with pytest.raises(SolverFailure, match="status 4"):
        dut.solve(impossible)
    np.testing.assert_array_equal(dut.solve(easy).u, before.u)


def test_the_solve_time_is_the_sum_of_the_phases(acados, vehicle, config, make_problem):
    dut = AcadosSolver(vehicle, config)
    answer, times = dut.solve(make_problem(config, K=0)), dut.times
    assert min(times.setting, times.preparation, times.feedback, times.packing) > 0
    assert answer.solve_time == times.setting + times.preparation + times.feedback


def test_a_wrench_that_reacts_is_refused(acados, vehicle, config, make_problem, reaction):
    with pytest.raises(SolverFailure, match="linear forecasts only"):
        AcadosSolver(vehicle, config).solve(make_problem(config, reaction=reaction))


def test_the_cache_is_used_again(acados, cache, vehicle, config, make_problem, monkeypatch):
    problem = make_problem(config, K=0)
    AcadosSolver(vehicle, config).solve(problem)
    count = len(list(cache.iterdir()))
    monkeypatch.setattr(acados_code, "_build", None)  # another build would raise
    AcadosSolver(vehicle, config).solve(problem)
    assert len(list(cache.iterdir())) == count


def test_another_vehicle_has_another_solver(acados, vehicle, config):
    key = acados_code._key
    same = key(acados, vehicle, config, 4, solver_options(10))
    assert key(acados, vehicle.with_mass(2.5), config, 4, solver_options(10)) != same
    assert key(acados, vehicle, dc.replace(config, max_speed=3.0), 4, solver_options(10)) != same
    assert key(acados, vehicle, config, 5, solver_options(10)) != same


def test_a_failed_build_says_why_and_leaves_nothing(
    acados, cache, vehicle, config, make_problem, monkeypatch
):
    monkeypatch.setenv("CC", "false")
    with pytest.raises(RuntimeError, match="must succeed"):
        AcadosSolver(vehicle, config).solve(make_problem(config, K=3))
    key = acados_code._key(acados, vehicle, config, 3, solver_options(config.horizon))
    assert not list((cache / key).iterdir())


def test_without_acados_the_error_says_what_to_install(vehicle, config, monkeypatch, tmp_path):
    monkeypatch.setenv(acados_code.FOLDER, str(tmp_path))
    with pytest.raises(ImportError, match=f"{acados_code.FOLDER} must name a folder"):
        AcadosSolver(vehicle, config)
    monkeypatch.delenv(acados_code.FOLDER)
    monkeypatch.setattr(acados_code.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(ImportError, match="comma-deps-acados"):
        AcadosSolver(vehicle, config)


def test_without_a_compiler_the_error_is_one_clear_line(monkeypatch):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", "")
    with pytest.raises(FileNotFoundError, match="a C compiler must be on the PATH"):
        acados_code.find_compiler()
