"""A signal ends a run though its exception may be lost on the way."""

import ctypes
import os
import signal
import sys
import time

import pytest

from np_drake.files import interruption as dut


@pytest.fixture
def in_order(monkeypatch):
    """Signals that raise, and the handlers of before at the end."""
    before = {number: signal.getsignal(number) for number in dut.ENDING}
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    for number in dut.ENDING:
        signal.signal(number, signal.SIG_DFL)
    dut.end_in_order()
    yield
    dut._seen.clear()
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize(
    "number, kind", [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, dut.Ended)]
)
def test_a_signal_whose_exception_is_lost_is_raised_again(in_order, number, kind):
    dut.raise_again()
    with pytest.raises(kind):
        os.kill(os.getpid(), number)
    assert dut.last_signal() == number
    with pytest.raises(kind):
        dut.raise_again()


def test_a_signal_inside_a_callback_is_raised_after_it_without_a_word(in_order, capfd):
    @ctypes.CFUNCTYPE(None)
    def callback():
        os.kill(os.getpid(), signal.SIGTERM)

    def work():
        callback()
        time.sleep(5.0)

    with pytest.raises(dut.Ended):
        work()
    assert capfd.readouterr().err == ""
    assert dut._seen == [signal.SIGTERM]


def test_any_other_exception_inside_a_callback_is_reported(in_order, capfd):
    @ctypes.CFUNCTYPE(None)
    def callback():
        raise ArithmeticError("of its own")

    callback()
    assert "of its own" in capfd.readouterr().err


def test_a_signal_that_a_shell_ignores_stays_ignored(in_order):
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    dut.end_in_order()
    os.kill(os.getpid(), signal.SIGTERM)
    assert dut.last_signal() is None
