import dataclasses as dc

import numpy as np
import pytest

from diagrams.performance import problems as benchmark_problems
from diagrams.performance import solver_bench as benchmark
from diagrams.performance.split_sqp import SplitSqpSolver
from np_drake.mpc.problem import MpcConfig, SolverFailure
from np_drake.mpc.sqp import SqpSolver


class AlwaysFails:
    name = "always_fails"

    def solve(self, problem, warm_start=None):
        raise SolverFailure("on purpose")


@pytest.fixture(scope="module")
def problems(vehicle, config):
    return benchmark_problems.tracking_problems(vehicle, config, count=12)


def test_reports_have_times_gaps_and_failures(vehicle, config, problems):
    patient = SqpSolver(vehicle, config, steps=30, max_steps=30, time_limit=np.inf)
    good, bad = benchmark.run(
        [SqpSolver(vehicle, config), AlwaysFails()], problems, step=config.step, optimum=patient
    )
    assert (good.failures, bad.failures) == (0, 12)
    assert 0 < good.median_ms <= good.p95_ms <= good.p99_ms <= good.max_ms
    assert -1e-8 <= good.gap_median <= good.gap_max < 0.05
    assert np.isnan(bad.gap_max)
    assert good.ratio_to_casadi is None  # the peers did not run
    assert good.ratio_to_acados is None


@pytest.mark.parametrize("name", benchmark.PEERS)
def test_the_ratio_is_of_median_times(vehicle, config, problems, name):
    peer = SqpSolver(vehicle, config)
    peer.name = name
    a, b = benchmark.run([SqpSolver(vehicle, config, steps=2), peer], problems, step=config.step)
    assert getattr(a, f"ratio_to_{name}") == pytest.approx(a.median_ms / b.median_ms)
    assert getattr(b, f"ratio_to_{name}") == 1.0


def test_the_feedback_is_that_part_of_a_solve_that_follows_the_measurement(
    vehicle, config, problems
):
    solvers = [SplitSqpSolver(vehicle, config), SqpSolver(vehicle, config)]
    split, whole = benchmark.run(solvers, problems, step=config.step)
    assert 0 < split.feedback_ms < split.median_ms
    assert whole.feedback_ms is None


def test_peers_that_cannot_run_have_no_row(vehicle, config, monkeypatch):
    def missing(*_):
        raise ImportError("on purpose")

    def without_compiler(*_):
        raise FileNotFoundError("on purpose")

    monkeypatch.setattr(benchmark, "CasadiSolver", missing)
    monkeypatch.setattr(benchmark, "AcadosSolver", without_compiler)
    names = [solver.name for solver in benchmark.make_solvers(vehicle, config)]
    assert "sqp" in names
    assert not set(names) & set(benchmark.PEERS)


def test_every_problem_has_its_own_stable_model(problems):
    radii = [np.abs(np.linalg.eigvals(p.forecast.A)).max() for p in problems]
    assert max(radii) < 1.0
    assert not np.array_equal(problems[0].forecast.C, problems[1].forecast.C)
    assert problems[0].forecast.A.shape == (24, 24)


def test_the_benchmark_vehicle_stays_on_the_circle(problems):
    errors = [np.linalg.norm(p.x0[:3] - p.x_ref[0, :3]) for p in problems]
    assert max(errors) < 0.03  # [m] in a quarter of a second


def test_infeasible_starts_break_every_soft_set(vehicle, config):
    for p in benchmark_problems.infeasible_problems(vehicle, config, count=3):
        w, x, y, z = p.x0[3:7]
        assert np.linalg.norm(p.x0[7:10]) == pytest.approx(9.0)  # [m/s]
        assert np.degrees(np.arccos(w * w - x * x - y * y + z * z)) == pytest.approx(80.0)  # [deg]


def test_the_suite_covers_horizons_cold_and_infeasible_starts(vehicle, monkeypatch):
    config = MpcConfig(horizon=5).check()
    monkeypatch.setattr(benchmark, "make_solvers", lambda v, c, **limit: [SqpSolver(v, c, **limit)])
    seen = []
    reports = benchmark.suite(
        vehicle, config, count=4, progress=lambda done, total: seen.append((done, total))
    )
    growth = [benchmark.growth_name(n, K) for n, K in benchmark.GROWTH]
    assert list(reports) == ["tracking", *growth, "cold start", "infeasible start"]
    assert seen[-1][0] == seen[-1][1] == sum(r[0].problems for r in reports.values())
    assert all(r[0].failures == 0 for r in reports.values())
    assert dc.asdict(reports["tracking"][0])["name"] == "sqp"
