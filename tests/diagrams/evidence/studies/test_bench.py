"""Laws of the benchmark."""

import numpy as np
import pytest

from diagrams.evidence.studies import bench
from np_drake.mpc.problem import SolverFailure
from np_drake.mpc.sqp import SqpSolver


class AlwaysFails:
    name = "always_fails"

    def solve(self, problem, warm_start=None):
        raise SolverFailure("on purpose")


@pytest.fixture(scope="module")
def problems(vehicle, config):
    return bench.record_problems(12, seed=0, horizon=config.horizon)[1]


def test_lines_have_times_gaps_failures_and_ratios_of_medians(vehicle, config, problems):
    patient = SqpSolver(vehicle, config, steps=30, max_steps=30, time_limit=np.inf)
    peer = SqpSolver(vehicle, config, steps=2)
    peer.name = "acados"
    solvers = [SqpSolver(vehicle, config), peer, AlwaysFails()]
    good, other, bad = bench.run(solvers, problems, step=config.step, optimum=patient)
    assert (good["failures"], bad["failures"]) == (0, 12)
    assert 0 < good["median_ms"] <= good["p95_ms"] <= good["p99_ms"] <= good["max_ms"]
    assert -1e-8 <= good["gap_median"] <= good["gap_max"] < 0.05
    assert np.isnan(bad["gap_max"])
    assert good["ratio_to_acados"] == pytest.approx(good["median_ms"] / other["median_ms"])
    assert other["ratio_to_acados"] == 1.0
    alone = bench.run(solvers[:1], problems[:1], step=config.step)
    assert alone[0]["ratio_to_acados"] is None  # it did not run


def test_predictions_are_timed_in_every_period():
    config, _, signals = bench.record_problems(12, seed=0)
    times = bench.prediction_times(config, signals)
    assert len(times) == len(signals["t"]) - 1
    assert 2e-5 < np.median(times) < 2e-2  # [s]
