"""Laws of the timing table."""

import numpy as np
import pytest

from diagrams.loop.experiments import load_experiment
from diagrams.performance import timing
from diagrams.tracking import tracking

ROWS = {row.name: row for row in timing.ROWS}


@pytest.fixture
def short(monkeypatch):
    """Every flight with a short ramp."""

    def load(name, vehicle=None, reality=None):
        config = load_experiment(name, vehicle, reality)
        config.reference.ramp = 1.0
        return config

    monkeypatch.setattr(tracking, "load_experiment", load)


def test_load_is_the_share_of_a_period():
    spent = timing.Spent(np.full(10, 1.0), np.full(10, 4.0), np.full(5, 0.5), 0)
    line = timing.timing_line("np", "sqp", spent)
    assert line["load_50"] == pytest.approx(0.25)  # 5 of 20 ms
    assert line["load_100"] == pytest.approx(0.5)
    assert (line["predict_ratio"], line["solve_ratio"]) == pytest.approx((2.0, 8.0))


def test_every_controller_pays_its_own_weights():
    damped = timing.timing_config(
        ROWS["np + active damping"], periods=5, solver="sqp"
    ).controller.mpc
    plain = timing.timing_config(ROWS["np"], periods=5, solver="sqp").controller.mpc
    assert damped.weight_swing > 0 == plain.weight_swing
    assert max(damped.weight_rate) > max(plain.weight_rate)


@pytest.mark.parametrize("name", ["nominal", "np"])
def test_the_replay_solves_every_period_once(short, name):
    flight = timing.record(ROWS[name], periods=30, model="", seed=1)
    spent = timing.replay(flight, "sqp")
    assert len(spent.predict) == len(spent.solve) == np.sum(flight.scored)
    assert spent.failures == 0
    assert len(spent.reference) > 0
    assert spent.solve.min() > 0.1  # [ms]: far below any solve, far above nothing
    assert (np.median(spent.predict) > 0.02) == (name == "np")  # [ms]
