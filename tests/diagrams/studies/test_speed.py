"""Laws of the timing table and of the benchmark of the solvers."""

import numpy as np
import pytest

from diagrams.loop.flight_result import fly
from diagrams.studies import bench, speed
from diagrams.studies.sweep import configure, named
from np_drake.mpc.problem import SolverFailure
from np_drake.mpc.sqp import SqpSolver


def test_load_is_the_share_of_a_period():
    spent = {"predict": np.full(10, 1.0), "solve": np.full(10, 4.0)}  # [ms]
    spent |= {"reference": np.full(5, 0.5), "status": np.full(10, 9)}
    line = speed.timing_line("np", "sqp", spent)
    assert line["load_50"] == pytest.approx(0.25)  # 5 of 20 ms
    assert line["load_100"] == pytest.approx(0.5)
    assert (line["predict_ratio"], line["solve_ratio"]) == pytest.approx((2.0, 8.0))
    assert line["failures"] == 10
    _, header, rows = speed.printed([line], "title")
    cells = dict(zip(header, rows[0], strict=True))
    assert cells["load at 50 Hz [%]"] == "25 / 25"
    assert cells["solve [ms]"] == "4.0 / 4.0"


@pytest.mark.parametrize("name", ["nominal", "np"])
def test_the_replay_solves_every_period_once(name):
    config = configure("lemniscate", named(speed.ROWS, name), solver="sqp")
    config.reference.ramp, config.duration = 1.0, 30 * config.controller.period
    flight = fly(config.check(), seed=1)
    spent = speed.replay(flight, "sqp")
    assert len(spent["predict"]) == len(spent["solve"]) == np.sum(flight.scored)
    assert np.all(spent["status"] == 0)
    assert len(spent["reference"]) > 0
    assert spent["solve"].min() > 0.1  # [ms]: far below any solve, far above nothing
    assert (np.median(spent["predict"]) > 0.02) == (name == "np")  # [ms]


class AlwaysFails:
    name = "always_fails"

    def solve(self, problem, warm_start=None):
        raise SolverFailure("on purpose")


@pytest.fixture(scope="module")
def problems(vehicle, config):
    return bench.tracking_problems(vehicle, config, count=12)


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
    assert good["ratio_to_casadi"] is None  # it did not run
    assert good["ratio_to_acados"] == pytest.approx(good["median_ms"] / other["median_ms"])
    assert other["ratio_to_acados"] == 1.0
