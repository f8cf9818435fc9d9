"""Laws of faults of measurements and solves."""

import numpy as np
import pytest

from np_drake.control.faults import (
    SENSORS,
    FaultySolver,
    FrozenSamples,
    LateSamples,
    NanBurst,
    SolverFault,
)
from np_drake.mpc.problem import MpcConfig, MpcProblem, SolverFailure
from np_drake.mpc.sqp import SqpSolver
from np_drake.residual_model import no_forecast
from np_drake.vehicle import Vehicle

PERIOD = 0.02  # [s]
SPAN = {"onset": 1.0, "duration": 0.2, "sensor": "all"}


@pytest.mark.parametrize(
    "dut, sources",
    [(FrozenSamples(**SPAN), [49] * 10), (LateSamples(**SPAN, samples=3), list(range(47, 57)))],
)
def test_a_fault_delivers_an_older_sample(dut, sources):
    assert [dut.delivered(k, PERIOD) for k in range(50, 60)] == sources


@pytest.mark.parametrize("sensor", SENSORS)
def test_a_burst_spoils_its_own_sensor_alone(sensor):
    spoilt = NanBurst(**SPAN | {"sensor": sensor}).reads(np.ones(23))
    assert np.flatnonzero(np.isnan(spoilt)).tolist() == sorted(SENSORS[sensor])


def test_a_fault_acts_from_its_onset_until_its_end():
    dut = NanBurst(**SPAN)
    assert [dut.acts(t) for t in (0.99, 1.0, 1.19, 1.2)] == [False, True, True, False]


def test_a_solve_fails_only_while_the_fault_acts():
    vehicle, config = Vehicle(), MpcConfig(horizon=5)
    x = np.zeros(13)
    x[3] = 1.0
    hover, rest = np.tile(vehicle.hover_input, (5, 1)), np.tile(x, (6, 1))
    solver = SqpSolver(vehicle, config)
    dut = FaultySolver(solver, [SolverFault(onset=1.0, duration=0.5)])
    for t in (0.98, 1.5):
        problem = MpcProblem(x, rest, hover, no_forecast(5), t)
        np.testing.assert_array_equal(dut.solve(problem).u, solver.solve(problem).u)
    with pytest.raises(SolverFailure, match=r"SolverFault at 1\.000 s"):
        dut.solve(MpcProblem(x, rest, hover, no_forecast(5), 1.0))
