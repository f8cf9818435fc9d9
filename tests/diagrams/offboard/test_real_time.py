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
from diagrams.offboard.node import Node
from diagrams.offboard.solver_thread import SolverThread
from diagrams.offboard.study import flight
from np_drake.offboard.config import OffboardConfig
from np_drake.offboard.link import Channel
from tests.diagrams.offboard.rail import hover


def test_it_flies_a_vehicle_of_another_process():
    patient = OffboardConfig(stale_after=1.0, level=5.0, late_solves=100, settle=0.3)  # the machine may be busy
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
