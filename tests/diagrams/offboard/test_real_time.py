"""Laws of a node in real time, on a vehicle in another process."""

import dataclasses as dc
import os
import signal
import threading
import time

import numpy as np
import pytest

from diagrams.offboard import real_time
from diagrams.offboard.beside import flown_beside
from diagrams.offboard.linked_flight import RealTime
from diagrams.offboard.node import Node
from diagrams.offboard.solver_thread import SolverThread
from diagrams.offboard.study import flight
from np_drake.offboard.autopilot import SimulatedAutopilot
from np_drake.offboard.codec import PX4
from np_drake.offboard.config import OffboardConfig
from np_drake.offboard.link import Channel, Link
from np_drake.references.config import ReferenceConfig
from tests.diagrams.offboard.rail import PLACE, TICK, hover


def test_it_flies_a_vehicle_of_another_process():
    patient = OffboardConfig(
        stale_after=1.0, level=5.0, late_solves=100, settle=0.3
    )  # the machine may be busy
    config = dc.replace(flight("hold"), duration=0.5, offboard=patient)
    found = flown_beside(config, seed=2, monitor=lambda t: None)
    assert found["node"]["flown"] > 1.0
    assert np.isfinite(found["ratio"])
    assert found["deadlines"]["ticks"] > 100


def test_a_silent_link_ends_the_wait_without_a_flight():
    link, _ = Channel.pair(lambda: 0.0, lambda t: np.inf)
    node = Node(hover(), link, SolverThread())
    begin = time.monotonic()
    real_time.fly(node, wait=0.3)
    assert 0.3 <= time.monotonic() - begin < 3.0
    assert node.flown is None


class SlowVehicle(Link):
    """Vehicle on a rail whose clock runs at a rate of ours."""

    def __init__(self, config, rate):
        self.autopilot, self.rate = SimulatedAutopilot(config.vehicle), rate
        self.x, self.time, self.begin = np.array([*PLACE, 1.0, *np.zeros(9)]), 0.0, time.monotonic()

    def send(self, data):
        self.autopilot.take(data, self.time)

    def receive(self):
        found = []
        while self.time + TICK <= self.rate * (time.monotonic() - self.begin):
            self.time += TICK
            self.autopilot.step(self.time, self.x)
            found.append(self.autopilot.messages(self.time, self.x, np.zeros(6)))
        return found

    def close(self):
        pass


@pytest.mark.parametrize("rate", [0.3, 1.0])
def test_a_simulated_vehicle_is_flown_by_its_own_clock_however_slow(rate):
    config = hover(duration=0.2, reference=ReferenceConfig(track="hover", ramp=0.2))
    config.offboard.late_solves = 100  # the machine may be busy
    vehicle, worker = SlowVehicle(config, rate), SolverThread()
    dut = Node(config, vehicle, worker)
    vehicle.begin = time.monotonic()
    real_time.fly(dut, wait=20.0)
    worker.close()
    assert [event.phase.value for event in dut.events] == ["ready", "flying", "stopped"]
    assert dut.flown.log.t[-1] == pytest.approx(config.end, abs=0.1)
    assert dut.events[-1].time <= vehicle.time + 0.1  # by the vehicle's clock
    assert max(dut.readings.ages) < config.offboard.stale_after


def test_a_slow_clock_of_any_other_vehicle_is_known_within_two_seconds():
    config, worker = hover(), SolverThread()
    dut = Node(config, vehicle := SlowVehicle(config, 0.3), worker)
    codec = vehicle.autopilot.codec
    codec.heartbeat = lambda **_: codec._pack(
        codec._out.heartbeat_encode(2, PX4, 128, 0, 4)
    )  # of no simulation
    vehicle.begin = time.monotonic()
    real_time.fly(dut, wait=1.9)
    worker.close()
    assert dut.lacks == "the state is older than 100 ms"
    assert dut.clock.rate == pytest.approx(0.3, abs=0.05)
    assert dut.flown is None


def test_the_pace_of_a_simulation_is_measured(monkeypatch):
    dut, now = RealTime(), iter([10.0, 12.0, 13.0])
    monkeypatch.setattr(time, "monotonic", lambda: next(now))
    dut.begin(None, FixedClock())
    assert dut.factor(0.5) == pytest.approx(0.25)
    assert dut.factor(1.5) == pytest.approx(1.0)
    assert dut.mean == pytest.approx(0.5)


class FixedClock:
    """Context at the beginning of a flight."""

    def get_time(self):
        return 0.0


def test_an_interrupt_asks_for_the_end_and_raises_nothing():
    before = signal.getsignal(signal.SIGINT)
    with real_time.Ended() as dut:
        assert not dut.asked
        threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGINT)).start()
        time.sleep(0.3)
        assert dut.asked
    assert signal.getsignal(signal.SIGINT) is before


def test_a_solve_that_hangs_stops_nothing_else():
    released, begun = threading.Event(), []
    dut = SolverThread()
    try:
        dut.submit(lambda: released.wait(10.0), 0.0)
        begin = time.monotonic()
        assert dut.answer(0.0, 0.01) is None
        assert time.monotonic() - begin < 1.0
        dut.submit(lambda: begun.append(1), 0.0)
        released.set()
        assert dut.answer(0.0, 5.0) is True
        assert dut.answer(0.0, 0.1) is None
        assert begun == []
    finally:
        released.set()
        dut.close()


def test_what_a_step_raises_is_raised_once():
    dut = SolverThread()

    def fails():
        raise RuntimeError("no answer")

    dut.submit(fails, 0.0)
    with pytest.raises(RuntimeError, match="no answer"):
        dut.answer(0.0, 1.0)
    assert dut.answer(0.0, 0.0) is None
    dut.submit(lambda: 7, 0.0)
    assert dut.answer(0.0, 1.0) == 7
    dut.close()
