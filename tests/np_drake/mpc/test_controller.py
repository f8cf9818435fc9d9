"""Laws of one period of the controller: what the solver is given, and what flies where it fails."""

import dataclasses as dc
import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake.command_delay import FINE, KEPT, commands_under_way
from np_drake.mpc.controller import MpcController, shift
from np_drake.mpc.dynamics import DiscreteDynamics
from np_drake.mpc.look_ahead import LookAhead
from np_drake.mpc.problem import MpcSolution, MpcStatus, SolverFailure
from np_drake.references.base import Hover
from np_drake.residual_model import Sample
from np_drake.residual_models.hold import Constant, Hold
from np_drake.vehicle import Vehicle
from tests.np_drake.mpc.conftest import lagging

LEVEL = np.array([0.3, 0, 1.0, 1.0, 0, 0, 0, 0.2, 0, 0, 0, 0, 0])
PERIOD = 0.02


class Scripted:
    """A solver with a plan of its own that fails where told and keeps what it was given."""

    name = "scripted"

    def __init__(self, fails=()):
        self.fails, self.given = set(fails), []

    def solve(self, problem, warm_start=None):
        self.given.append(warm_start)
        self.acting = problem.acting
        if len(self.given) - 1 in self.fails:
            raise SolverFailure("scripted: fails as told.")
        n, rng = len(problem.u_ref), np.random.default_rng(len(self.given))
        x = np.tile(problem.x0, (n + 1, 1)) + 0.01 * rng.standard_normal((n + 1, 13))
        x[:, 3:7] /= np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
        u = problem.u_ref + 0.1 * rng.standard_normal((n, 4))
        return MpcSolution(u, x, rng.standard_normal((n, 6)), MpcStatus.OPTIMAL, 0.0, 0.0, 0.0, 1)


@pytest.fixture
def flown(vehicle, config):
    """Return a function that runs periods at these states: (memories, solver, controller)."""

    def run(states, fails=(), lag=0.0):
        solver, own = Scripted(fails), dc.replace(vehicle, rotor_time_constant=lag)
        dut = MpcController(own, config, solver, period=PERIOD)
        flat = Hover(np.array([0.0, 0.0, 1.0])).sample(np.arange(config.horizon + 1))
        memories = [dut.initial_memory()]
        for x in states:
            memories.append(dut.step(memories[-1], x=x, flat=flat, forecast=None))
        return memories, solver, dut

    return run


def as_solution(memory) -> MpcSolution:
    return MpcSolution(memory.u, memory.x, memory.chi, MpcStatus.SHIFTED_PLAN, 0.0, 0.0, 0.0, 0)


def test_what_acts_follows_the_flown_inputs_with_the_lag_of_the_file(flown):
    memories, solver, _ = flown([LEVEL] * 4, lag=0.05)
    for before, after in itertools.pairwise(memories):
        acting = before.u[0] + np.exp(-PERIOD / 0.05) * (before.acting - before.u[0])
        np.testing.assert_allclose(after.acting, acting, rtol=1e-12)
    np.testing.assert_array_equal(solver.acting, memories[-1].acting)


def same(a, b) -> None:
    for name in ("u", "x", "chi"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


def test_the_last_plan_one_period_on_is_the_next_guess_and_hover_never_is(flown, config):
    memories, solver, _ = flown([LEVEL] * 4, fails={0})
    assert solver.given[0] is None
    assert solver.given[1] is None  # hover was flown, which is no plan
    for k in (2, 3):
        expected = shift(as_solution(memories[k]), elapsed=PERIOD, step=config.step)
        same(solver.given[k], expected)
        assert solver.given[k].status == MpcStatus.SHIFTED_PLAN


def test_after_a_failure_that_guess_is_flown_and_is_a_plan_again(flown, config):
    memories, solver, _ = flown([LEVEL] * 3, fails={1, 2})
    same(memories[2], solver.given[1])
    assert memories[2].flags[0] == MpcStatus.SHIFTED_PLAN
    same(solver.given[2], shift(as_solution(memories[2]), elapsed=PERIOD, step=config.step))


@pytest.mark.parametrize("entry", [0, 3, 12])
def test_hover_after_a_reading_that_is_no_number_has_a_finite_plan(flown, vehicle, entry):
    bad = LEVEL.copy()
    bad[entry] = np.nan
    memories, *_ = flown([bad], fails={0})
    np.testing.assert_array_equal(
        memories[1].u, np.broadcast_to(vehicle.hover_input, memories[1].u.shape)
    )
    np.testing.assert_array_equal(memories[1].x, memories[0].x)
    np.testing.assert_array_equal(
        flown([LEVEL], fails={0})[0][1].x, np.broadcast_to(LEVEL, memories[1].x.shape)
    )
    assert memories[1].flags[0] == MpcStatus.HOVER
    assert memories[1].flags[2] == 0.0


STEP = 0.04


def random_plan(seed=0, N=6):
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(N + 1, 13))
    x[:, 3:7] = [1.0, 0.0, 0.0, 0.0] + 0.1 * rng.normal(size=(N + 1, 4))
    x[:, 3:7] /= np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
    return MpcSolution(
        rng.uniform(size=(N, 4)), x, rng.normal(size=(N, 6)), MpcStatus.OPTIMAL, 1.0, 0.0, 0.01, 3
    )


def test_a_whole_step_moves_the_rows_and_half_a_step_averages():
    plan = random_plan()
    dut = shift(plan, elapsed=STEP, step=STEP)
    np.testing.assert_allclose(dut.u[:-1], plan.u[1:])
    np.testing.assert_allclose(dut.x[:-1], plan.x[1:])
    np.testing.assert_allclose(dut.chi[:-1], plan.chi[1:])
    np.testing.assert_allclose(dut.u[-1], plan.u[-1])
    np.testing.assert_allclose(shift(plan, elapsed=0.0, step=STEP).x, plan.x)
    assert dut.status == MpcStatus.SHIFTED_PLAN
    half = shift(plan, elapsed=0.5 * STEP, step=STEP)
    np.testing.assert_allclose(half.u[:-1], 0.5 * (plan.u[:-1] + plan.u[1:]))


@given(elapsed=st.floats(0.0, 1.0), seed=st.integers(0, 50))
def test_a_shifted_plan_keeps_the_input_set_and_unit_quaternions(elapsed, seed):
    dut = shift(random_plan(seed), elapsed=elapsed, step=STEP)
    assert np.all((dut.u >= 0) & (dut.u <= 1))
    np.testing.assert_allclose(np.linalg.norm(dut.x[:, 3:7], axis=1), 1.0, atol=1e-12)


VEHICLE = Vehicle()
MOVING = np.array([0, 0, 1.0, 1.0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0])
DRAW = np.random.default_rng(3)
SENT = VEHICLE.hover_input + DRAW.normal(size=(KEPT, 4)) * [1.0, 0.05, 0.05, 0.01]


def simulated(x, commands, chi):
    """Return the state after commands of a fine step each."""
    dynamics = DiscreteDynamics(VEHICLE, PERIOD / FINE)
    for u in commands:
        x = np.array(dynamics.advance(x.tolist(), u.tolist(), chi.tolist()))
    return x


@pytest.mark.parametrize("parts", [1, 4, 7, 24])
def test_the_next_command_acts_on_the_state_of_commands_under_way(parts):
    model = Hold(step=PERIOD)
    chi = np.array([0.5, -0.2, -2.0, 0.01, 0.0, 0.0])
    memory = model.update(model.initial_memory(), Sample(MOVING, SENT[0], chi))
    _, x = LookAhead(model, VEHICLE)(memory, MOVING, SENT, parts * PERIOD / FINE)
    # drift of the quaternion [1]
    ahead = simulated(MOVING, commands_under_way(SENT, parts), chi)
    np.testing.assert_allclose(x, ahead, atol=1e-9)
    assert np.linalg.norm(x[3:7]) == pytest.approx(1.0)


def test_commands_under_way_act_through_the_lag_of_the_rotors():
    dut = LookAhead(Hold(step=PERIOD), dc.replace(VEHICLE, rotor_time_constant=0.05))
    _, x = dut(Hold(step=PERIOD).initial_memory(), MOVING, SENT, 9 * PERIOD / FINE)
    acting = lagging(commands_under_way(SENT, FINE * KEPT), SENT[-1], 0.05, PERIOD / FINE)
    np.testing.assert_allclose(x, simulated(MOVING, acting[-9:], np.zeros(6)), atol=1e-9)


def test_without_delay_nothing_moves():
    model = Constant(np.zeros(6), step=PERIOD, name="nominal")
    memory, x = LookAhead(model, VEHICLE)(model.initial_memory(), MOVING, SENT, 0.0)
    assert memory == {}
    np.testing.assert_array_equal(x, MOVING)
