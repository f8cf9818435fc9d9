"""Laws of a node: what it commands and when, when it stops, what it records, its real time."""

import dataclasses as dc
import threading
import time

import numpy as np
import pytest

from diagrams.autopilot.node import SolverThread, answer_of, make_companion_diagram
from diagrams.loop.flight_diagram import make_flight_diagram, make_simulator
from np_drake.autopilot.simulated import thrust_of
from np_drake.rigid_body import P, V
from tests.diagrams.autopilot.rail import (
    KINDS,
    PLACE,
    SOLVER,
    STATE_LOST,
    TICK,
    Busy,
    Fault,
    FaultyAutopilot,
    Rail,
    flight,
    hover,
)

FLYING_AT = 3.2  # when any flight here has long been handed over [s]


@pytest.mark.parametrize("controller", ["np", "payload_filter", "observer"])
def test_a_companion_commands_what_the_diagram_of_a_flight_commands(controller):
    config = flight(controller)
    diagram = make_flight_diagram(config)
    simulator = make_simulator(diagram, config, seed=3)
    context = simulator.get_context()
    sensors, mpc = diagram.GetSubsystemByName("sensor_model"), diagram.GetSubsystemByName("np_mpc")

    def read(system, name):
        return system.GetOutputPort(name).Eval(system.GetMyContextFromRoot(context)).copy()

    dut, in_force = make_companion_diagram(config), read(mpc, "rates_thrust")
    memory = dut.CreateDefaultContext()
    for k in range(60):
        if k > 0:
            simulator.AdvanceTo(k * config.controller.period)
        seen = {name: read(sensors, name) for name in ("x", "acceleration")}
        simulator.AdvancePendingEvents()
        answer = answer_of(dut, memory, context.get_time(), in_force=in_force, **seen)
        in_force = read(mpc, "rates_thrust")
        np.testing.assert_allclose(answer.rates_thrust, in_force, rtol=0, atol=1e-9)


def test_it_flies_once_all_is_in_order_and_the_pilot_hands_over():
    rail = Rail(hover()).advance(FLYING_AT)
    assert rail.phases == ["ready", "flying"]
    assert rail.config.offboard.settle <= rail.sent[0][0] <= rail.autopilot.handovers[0]
    np.testing.assert_allclose(np.diff([t for t, _ in rail.sent]), TICK, atol=1e-9)
    _, last = rail.sent[-1]
    vehicle = rail.config.vehicle
    share = vehicle.mass * vehicle.gravity / (4 * vehicle.max_rotor_thrust)
    np.testing.assert_allclose(last.rates, 0.0, atol=1e-3)
    assert last.thrust == pytest.approx(share, rel=0.02)
    log = rail.node.flown
    np.testing.assert_allclose(log.p, rail.config.motion.sample(log.t)[0], atol=1e-5)
    assert not np.allclose(log.p[0], PLACE)
    assert log.t[0] == pytest.approx(0.0, abs=1e-9)
    assert np.all(np.diff(log.t) > 0)
    np.testing.assert_allclose(log.commanded_rates[-1], last.rates, atol=1e-6)
    assert np.isfinite(np.column_stack([log.p, log.q, log.v, log.w, log.u, log.a, log.al])).all()
    pairs = Rail(hover(), pairs=True).advance(FLYING_AT)
    assert pairs.phases == ["ready", "flying"]
    np.testing.assert_allclose(pairs.node.flown.x[-1], log.x[-1], atol=1e-5)


def stays_in_offboard(rail: Rail) -> None:
    rail.autopilot.step = lambda t, x: rail.autopilot.in_force
    rail.autopilot.hold = lambda: None


def test_an_autopilot_that_is_in_offboard_already_is_not_taken():
    rail = Rail(hover()).advance(FLYING_AT)
    rail.node, before = rail.new_node(), len(rail.sent)
    stays_in_offboard(rail)
    rail.advance(rail.time + 3.0)
    assert rail.autopilot.engaged
    assert len(rail.sent) == before


@pytest.mark.parametrize("kind", KINDS)
def test_no_fault_raises_and_one_that_lasts_ends_the_commands(kind):
    rail = Rail(hover(), Fault(kind, FLYING_AT, 3.0)).advance(FLYING_AT + 0.5)
    if kind == "node restart":
        rail.node = rail.new_node()
    rail.advance(FLYING_AT + 1.5)
    assert rail.sent
    assert all(np.isfinite([*said.rates, said.thrust]).all() for _, said in rail.sent)
    assert rail.node.counts["errors"] == 0
    if kind in (*STATE_LOST, *SOLVER):
        assert rail.silent_from(FLYING_AT) <= levelled_for(rail.config, kind) + 0.03


def levelled_for(config, kind) -> float:
    """Longest time from a fault until nothing is sent [s]."""
    limits, solves = config.offboard, (config.offboard.late_solves + 1) * config.controller.period
    return limits.level + (limits.stale_after if kind in STATE_LOST else solves)


@pytest.mark.parametrize(
    ("kind", "lasts"), [("silence", 0.05), ("silence", 0.3), ("failing solve", 0.3)]
)
def test_a_short_fault_is_levelled_and_flown_on_from(kind, lasts):
    rail = Rail(hover(), Fault(kind, FLYING_AT, lasts)).advance(FLYING_AT + 1.0)
    assert rail.phases == ["ready", "flying", *(["level", "flying"] if lasts > 0.1 else [])]


def test_a_vehicle_that_the_pilot_flies_on_is_commanded_and_braked():
    rail = Rail(hover()).advance(1.0)
    before = len(rail.sent)
    for k in range(100):
        rail.x[V] = [1.5, 0.0, 0.5]
        rail.x[P] = PLACE + 0.01 * (k + 1) * rail.x[V]
        rail.autopilot.step = lambda t, x: rail.autopilot.in_force  # the pilot's
        rail.advance(rail.time + TICK)
    assert rail.phases == ["ready"]
    assert len(rail.sent) == before + 100
    rail.autopilot.engaged = rail.node.readings.engaged = True
    rail.advance(rail.time + 0.2)
    assert rail.node.flown_for == 0.0
    assert rail.sent[-1][1].rates[1] < -0.1  # nose up
    rail.x[V] = 0.0
    rail.advance(rail.time + 0.2)
    start = rail.config.motion.sample(np.zeros(1))[0, 0]
    np.testing.assert_allclose(rail.node.flown.p[0], start, atol=1e-3)


@pytest.mark.parametrize("kind", [*STATE_LOST, *SOLVER])
def test_one_that_is_ready_levels_before_it_is_silent(kind):
    rail = Rail(hover(), Fault(kind, 1.0, 3.0)).advance(3.0)
    assert rail.phases == ["ready", "level", "waiting"]
    longest = levelled_for(rail.config, kind) + 0.03
    assert rail.config.offboard.level <= rail.silent_from(1.0) <= longest


def test_one_that_is_ready_leaves_after_a_heartbeat_and_asks_for_nothing():
    rail = Rail(hover()).advance(0.6)
    rail.node.leave(rail.time)
    rail.advance(1.5)
    assert not rail.node.is_over(rail.time)
    assert rail.silent_from(0.6) is None
    assert not rail.autopilot.asked_to_hold
    rail.advance(1.7)
    assert rail.node.is_over(rail.time)


def test_level_thrust_is_what_held_height_before():
    rail = Rail(hover(), Fault("hanging solve", FLYING_AT, 3.0))
    heavy = dc.replace(rail.config.vehicle, mass=1.2 * rail.config.vehicle.mass)
    rail.autopilot = FaultyAutopilot(heavy, rail.fault)
    rail.advance(FLYING_AT + 0.5)
    assert rail.phases[-1] == "level"
    thrust = thrust_of(heavy, rail.sent[-1][1].thrust)
    assert thrust == pytest.approx(heavy.mass * heavy.gravity, rel=0.03)


def test_a_machine_that_is_too_slow_commands_nothing_and_says_so():
    rail = Rail(hover(), Fault("slow machine", 0.0, 9.0)).advance(2.0)
    assert rail.sent == []
    assert "too slow" in rail.node.lacks


def test_when_the_pilot_takes_over_it_is_silent_for_good():
    rail = Rail(hover()).advance(FLYING_AT)
    rail.autopilot.hold()
    rail.advance(FLYING_AT + 1.1)
    assert rail.phases == ["ready", "flying", "stopped"]
    before, rail.autopilot.engaged = len(rail.sent), True
    stays_in_offboard(rail)
    rail.advance(FLYING_AT + 3.0)
    assert len(rail.sent) == before


@pytest.mark.parametrize("holds", [True, False])
def test_when_it_leaves_the_autopilot_holds_its_place_or_is_left_level(holds):
    rail = Rail(hover()).advance(FLYING_AT)
    if not holds:
        stays_in_offboard(rail)
    rail.node.leave(rail.time)
    rail.advance(FLYING_AT + 4.5)
    assert rail.phases == ["ready", "flying", *([] if holds else ["level"]), "stopped"]
    assert ("does not hold" in rail.node.phases.reason) == (not holds)
    assert holds or rail.silent_from(FLYING_AT) == pytest.approx(3.5, abs=0.05)


# Of a machine that is busy: controller, payload [kg], real-time factor [1], when heartbeats come
# [s], mean time of a solve where it is idle [s].
HANDOVERS = [("np", 0.26, 0.6, 0.1, 0.01), ("payload_filter", 0.4, 0.3, 0.95, 0.004)]
_rng = np.random.default_rng(90)
MANY = [
    (kind, *_rng.uniform([0.0, 0.2, 0.0, 0.002], [0.4, 1.0, 1.0, 0.02]).tolist())
    for kind in [*66 * ["np", "payload_filter", "hold"], "np", "payload_filter"]
]


@pytest.mark.parametrize(
    "case", [*HANDOVERS, *(pytest.param(one, marks=pytest.mark.nightly) for one in MANY)]
)
def test_a_payload_is_taken_over_on_a_busy_machine_without_sagging(case, monkeypatch):
    dut = Busy(*case).fly(0.7, monkeypatch)
    phases = [phase.value for _, phase, _ in dut.node.events]
    if phases:  # a solve that takes 0.1 s is levelled
        assert phases in (["ready", "flying"], ["ready", "flying", "level", "flying"])
        assert min(dut.heights) > dut.heights[0] - 0.1  # [m]
    else:  # the machine is too slow
        assert dut.node.counts["late"] > 0.4 * dut.node.counts["periods"]
        assert not dut.autopilot.handovers


def test_a_solve_that_hangs_or_fails_stops_nothing_else():
    released, begun = threading.Event(), []
    dut = SolverThread()
    dut.submit(lambda: released.wait(10.0))
    begin = time.monotonic()
    assert dut.answer(0.01) is None
    assert time.monotonic() - begin < 1.0
    dut.submit(lambda: begun.append(1))
    released.set()
    assert dut.answer(5.0) is True
    assert dut.answer(0.1) is None
    assert begun == []
    dut.submit(lambda: 1 / 0)
    assert dut.answer(1.0) is None
    dut.submit(lambda: 7)
    assert dut.answer(1.0) == 7
    dut.close()
