"""A first signal ends a run in order, a second one at once."""

import os
import signal
import subprocess
import sys

import pytest

from np_drake.files import interruption as dut


@pytest.fixture
def in_order():
    """Signals that raise, and the handlers of before at the end."""
    before = {number: signal.getsignal(number) for number in dut.ENDING}
    for number in dut.ENDING:
        signal.signal(number, signal.SIG_DFL)
    dut.end_at_once()
    dut.end_in_order()
    yield
    dut._seen.clear()
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize(
    "number, kind", [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, dut.Ended)]
)
def test_the_first_signal_raises_and_is_remembered(in_order, number, kind):
    with pytest.raises(kind):
        os.kill(os.getpid(), number)
    assert dut.last_signal() == number


def test_the_second_signal_ends_the_process_with_a_line():
    program = """
import os, signal
from np_drake.files.interruption import end_at_once, end_in_order
end_at_once()
end_in_order()
for _ in range(2):
    try:
        os.kill(os.getpid(), signal.SIGTERM)
    except BaseException:
        pass
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (143, "np-drake: ended by SIGTERM.\n")


def test_a_signal_that_a_shell_ignores_stays_ignored(in_order):
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    dut.end_in_order()
    os.kill(os.getpid(), signal.SIGTERM)
    assert dut.last_signal() is None
