"""Laws of the paced replay: instants, lateness, misses."""

import gc

import numpy as np
import pytest

from diagrams.performance import deadlines


class FakeLoop:
    """Loop whose periods take given times on a clock of its own."""

    def __init__(self, spent):
        self.now, self.spent, self.periods, self.collected = 0.0, spent, len(spent), []

    def clock(self):
        self.now += 1e-6
        return self.now

    def sleep(self, seconds):
        self.now += seconds

    def predict(self, k):
        return None

    def solve(self, k, forecast):
        self.now += self.spent[k]
        self.collected.append(gc.isenabled())
        return 0.0


class Flight:
    class config:
        class controller:
            period = 0.01


def run(monkeypatch, spent, collector=deadlines.COLLECTORS[0]):
    loop = FakeLoop(np.concatenate([np.full(deadlines.WARM_UP, 1e-3), spent]))
    monkeypatch.setattr(deadlines, "ControlLoop", lambda flight: loop)
    return deadlines.paced(Flight, collector, clock=loop.clock, sleep=loop.sleep), loop


def test_the_response_is_the_time_that_a_period_takes(monkeypatch):
    times, _ = run(monkeypatch, np.full(20, 4e-3))
    assert times.missed == 0
    np.testing.assert_allclose(times.response, 4e-3, atol=2e-5)  # [s] ticks of the clock
    assert times.late.max() < 2e-5


def test_a_slow_period_is_missed_and_delays_the_next_until_time_is_made_up(monkeypatch):
    spent = np.full(20, 4e-3)
    spent[5] = 25e-3
    times, _ = run(monkeypatch, spent)
    # Ends at 25 ms: the two next instants have passed, and each makes up 6 ms.
    np.testing.assert_allclose(times.response[5:10] * 1e3, [25.0, 19.0, 13.0, 7.0, 4.0], atol=0.05)
    assert times.missed == 3


@pytest.mark.parametrize("collector", deadlines.COLLECTORS)
def test_the_collector_is_kept_out_of_the_periods_only_where_asked(monkeypatch, collector):
    _, loop = run(monkeypatch, np.full(5, 1e-3), collector)
    assert set(loop.collected) == {collector == deadlines.COLLECTORS[0]}
    assert gc.isenabled()


def test_an_unknown_collector_is_refused(monkeypatch):
    with pytest.raises(ValueError, match="collector"):
        run(monkeypatch, np.full(5, 1e-3), "sometimes")


def test_a_line_counts_every_period_once():
    times = deadlines.Paced(0.01, np.zeros(100), np.linspace(1e-3, 12e-3, 100))
    line = deadlines.deadline_line(100.0, deadlines.COLLECTORS[0], times)
    assert sum(line["histogram"]) == line["periods"] == 100
    assert line["missed"] == np.sum(times.response > 0.01)
    assert (
        line["response"]
        <= line["response_p99"]
        <= line["response_p99_9"]
        <= line["response_max"]
        == 12.0
    )
