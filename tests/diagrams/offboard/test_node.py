"""Laws of a node: when it commands, when it stops, and what it records."""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.offboard.faults import KINDS, SOLVER, STATE_LOST, Fault
from diagrams.offboard.report import deadlines, flight_metrics
from diagrams.offboard.study import flight, stated_time
from diagrams.offboard.virtual_flight import VirtualFlight
from np_drake.offboard.phases import Phase
from tests.diagrams.offboard.rail import PLACE, Rail, hover

FLYING_AT = 3.2  # when any flight here has long been handed over [s]


def test_it_flies_once_all_is_in_order_and_the_pilot_hands_over():
    rail = Rail(hover()).advance(FLYING_AT)
    assert rail.phases == ["ready", "flying"]
    assert rail.sent[0][0] >= rail.config.offboard.settle
    assert rail.autopilot.handovers[0] >= rail.sent[0][0]


def test_position_and_attitude_in_two_messages_are_flown_by_as_one():
    rail, pairs = Rail(hover()).advance(FLYING_AT), Rail(hover(), pairs=True).advance(FLYING_AT)
    assert pairs.phases == rail.phases == ["ready", "flying"]
    np.testing.assert_allclose(pairs.node.flown.log.x[-1], rail.node.flown.log.x[-1], atol=1e-5)


def test_it_sends_at_its_rate_while_it_flies():
    rail = Rail(hover()).advance(FLYING_AT)
    times = [t for t, _ in rail.sent]
    np.testing.assert_allclose(np.diff(times), 1 / rail.config.offboard.rate, atol=1e-9)


def test_a_vehicle_at_rest_at_its_place_is_held_level():
    rail = Rail(hover()).advance(FLYING_AT)
    _, last = rail.sent[-1]
    np.testing.assert_allclose(last.rates, 0.0, atol=1e-3)
    weight = rail.config.vehicle.mass * rail.config.vehicle.gravity
    assert last.thrust == pytest.approx(
        weight / (4 * rail.config.vehicle.max_rotor_thrust), rel=0.02
    )


def test_the_reference_begins_where_the_vehicle_is_wherever_that_is():
    rail = Rail(hover()).advance(FLYING_AT)
    flown = rail.node.flown
    np.testing.assert_allclose(flown.log.p, flown.reference, atol=1e-5)
    assert not np.allclose(flown.reference[0], PLACE)


def test_an_autopilot_that_is_in_offboard_already_is_not_taken():
    rail = Rail(hover()).advance(FLYING_AT)
    rail.node = rail.new_node()
    rail.autopilot.step = lambda t, x: rail.autopilot.in_force  # stays in offboard whatever comes
    before = len(rail.sent)
    rail.advance(rail.time + 3.0)
    assert rail.autopilot.engaged
    assert len(rail.sent) == before


@pytest.mark.parametrize("kind", KINDS)
def test_no_fault_raises_or_sends_what_is_not_finite(kind):
    fault = dc.replace(Fault.drawn(kind, 5, (FLYING_AT, FLYING_AT)), lasts=1.0)
    rail = Rail(hover(), fault).advance(FLYING_AT + 0.5)
    if kind == "node restart":
        rail.node = rail.new_node()
    rail.advance(FLYING_AT + 1.5)
    assert rail.sent
    assert all(np.isfinite([*said.rates, said.thrust]).all() for _, said in rail.sent)


@pytest.mark.parametrize("kind", [*STATE_LOST, *SOLVER])
def test_a_fault_that_lasts_ends_the_commands_within_the_stated_time(kind):
    fault = dc.replace(Fault.drawn(kind, 6, (FLYING_AT, FLYING_AT)), lasts=3.0)
    rail = Rail(hover(), fault).advance(FLYING_AT + 1.2)
    stopped = rail.silent_from(FLYING_AT)
    assert stopped is not None
    assert stopped <= stated_time(fault, rail.config)


@pytest.mark.parametrize("kind", ["silence", "frozen clock", "no attitude", "failing solve"])
def test_a_short_fault_is_levelled_and_flown_on_from(kind):
    fault = Fault(kind, FLYING_AT, 0.3)
    rail = Rail(hover(), fault).advance(FLYING_AT + 1.0)
    assert rail.phases == ["ready", "flying", "level", "flying"]


def test_a_fault_shorter_than_a_stale_state_changes_nothing():
    rail = Rail(hover(), Fault("silence", FLYING_AT, 0.05)).advance(FLYING_AT + 1.0)
    assert rail.phases == ["ready", "flying"]


def test_a_vehicle_off_its_reference_is_levelled_and_the_log_says_why():
    rail = Rail(hover()).advance(FLYING_AT)
    rail.x[:3] += [0.0, 0.2, 0.0]
    for _ in range(20):
        rail.advance(rail.time + 0.05)
        rail.x[:3] += [0.0, 0.2, 0.0]
    phase, reason = rail.node.events[2][1:]
    assert phase is Phase.LEVEL
    assert "distance from the reference" in reason


def test_a_tilted_vehicle_is_turned_level():
    rail = Rail(hover(), Fault("hanging solve", FLYING_AT, 9.0)).advance(FLYING_AT)
    rail.x[3:7] = [np.cos(0.2), np.sin(0.2), 0.0, 0.0]  # rolled by 0.4 rad
    rail.advance(FLYING_AT + 0.3)
    assert rail.node.phase is Phase.LEVEL
    assert rail.sent[-1][1].rates[0] < -0.5


def test_when_the_pilot_takes_over_it_is_silent_for_good():
    rail = Rail(hover()).advance(FLYING_AT)
    rail.autopilot.hold()
    rail.advance(FLYING_AT + 1.1)
    assert rail.phases == ["ready", "flying", "stopped"]
    before = len(rail.sent)
    rail.autopilot.engaged = True
    rail.autopilot.step = lambda t, x: rail.autopilot.in_force
    rail.advance(FLYING_AT + 3.0)
    assert len(rail.sent) == before


def test_when_it_leaves_the_autopilot_holds_its_place():
    rail = Rail(hover()).advance(FLYING_AT)
    rail.node.leave(rail.time)
    rail.advance(FLYING_AT + 1.5)
    assert not rail.autopilot.engaged
    assert rail.phases[-1] == "stopped"


def test_an_autopilot_that_does_not_hold_when_it_is_asked_is_left_level():
    rail = Rail(hover()).advance(FLYING_AT)
    rail.autopilot.step = lambda t, x: rail.autopilot.in_force
    rail.autopilot.hold = lambda: None
    rail.node.leave(rail.time)
    rail.advance(FLYING_AT + 4.5)
    assert rail.phases == ["ready", "flying", "level", "stopped"]
    assert "does not hold" in rail.node.phases.reason
    assert rail.silent_from(FLYING_AT) == pytest.approx(3.5, abs=0.05)


def test_other_vehicles_and_components_on_the_link_change_nothing():
    alone, rail = Rail(hover()).advance(FLYING_AT), Rail(hover()).advance(0.1)
    strangers = [Stranger(system=2), Stranger(component=154)]
    while rail.time < FLYING_AT - 1e-9:
        for stranger in strangers:
            rail.there.send(stranger.says(rail.time))
        rail.advance(rail.time + 0.05)
    assert rail.phases == alone.phases
    np.testing.assert_allclose(rail.node.flown.log.p, alone.node.flown.log.p, atol=1e-6)


class Stranger:
    """Another source of messages on the link."""

    def __init__(self, system=1, component=1):
        from np_drake.offboard.codec import AUTOPILOT, Codec

        self._codec = Codec(AUTOPILOT)
        self._codec._out.srcSystem, self._codec._out.srcComponent = system, component

    def says(self, t):
        x = np.array([50.0, 0.0, 9.0, 1.0, *np.zeros(9)])
        return self._codec.heartbeat(engaged=t % 0.1 < 0.05, autopilot=12) + self._codec.odometry(
            3000.0 + t, x
        )


@pytest.mark.parametrize("error", [TypeError, IndexError, KeyError, MemoryError, AssertionError])
def test_a_tick_that_fails_ends_in_level_thrust_and_silence(error, monkeypatch):
    rail = Rail(hover()).advance(FLYING_AT)

    def fails(*_):
        raise error("broken")

    monkeypatch.setattr(rail.node.readings, "at", fails)
    rail.advance(FLYING_AT + 1.0)
    assert rail.phases == ["ready", "flying", "level", "stopped"]
    assert "internal error" in rail.node.phases.reason


def test_a_vehicle_that_moves_is_not_made_ready():
    rail = Rail(hover())
    rail.x[7:10] = [1.0, 0.0, 0.0]
    assert rail.advance(2.0).phases == []


def test_a_hand_over_needs_no_word_of_what_is_in_force():
    quiet = Rail(hover()).advance(FLYING_AT)
    handover = quiet.autopilot.handovers[0]
    flying = next(event for event in quiet.node.events if event.phase is Phase.FLYING)
    assert flying.time >= handover - 0.02
    assert quiet.phases == ["ready", "flying"]


@pytest.mark.parametrize("rate", [20.0, 75.0])
def test_a_rate_that_is_no_multiple_of_the_controllers_is_refused(rate):
    config = hover()
    config.offboard.rate = rate
    with pytest.raises(ValueError, match="whole multiple"):
        Rail(config)


def test_its_log_begins_at_the_hand_over_and_holds_what_was_sent():
    rail = Rail(hover()).advance(FLYING_AT)
    log = rail.node.flown.log
    assert log.t[0] == pytest.approx(0.0, abs=1e-9)
    assert np.all(np.diff(log.t) > 0)
    np.testing.assert_allclose(log.commanded_rates[-1], rail.sent[-1][1].rates, atol=1e-6)
    assert all(
        np.isfinite(values).all() for values in (log.p, log.q, log.v, log.w, log.u, log.a, log.al)
    )


def test_its_report_counts_what_was_late_and_what_was_not_taken():
    fault = Fault("late solves", FLYING_AT, 0.5, size=0.03)
    rail = Rail(hover(), fault).advance(FLYING_AT + 1.0)
    assert deadlines(rail.node)["late"] > 0
    rail = Rail(hover(), Fault("position jump", FLYING_AT, 0.1, size=9.0)).advance(FLYING_AT + 0.5)
    assert deadlines(rail.node)["refused"]["absurd"] > 0


def test_it_flies_a_simulated_vehicle_along_its_reference():
    virtual = VirtualFlight(flight("np"), seed=1)
    virtual.advance(7.0)
    assert virtual.node is not None
    assert virtual.node.phase is Phase.FLYING
    assert flight_metrics(virtual.node, virtual.node.flown)["E_xy"] < 0.005
    assert not virtual.autopilot.failsafes
