import numpy as np
import pytest

from np_drake import attitude
from np_drake.diagnosis.answer import Cause, Estimate
from np_drake.diagnosis.gusts import SlowForce, as_gusts, slow_force
from np_drake.diagnosis.hidden_swing import attitude_on_grid
from np_drake.diagnosis.rig import LABORATORY, Tolerance
from np_drake.diagnosis.signature import Term, signature
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag

DRAG = LinearDrag(0.3, 0.3, 0.3)


def left_of(flights):
    return {e.name: e.y - signature(e, [Term(DRAG)]) for e in flights}


def flown(seen, *effects, seconds=30.0, **how):
    return [seen(*effects, name=str(i), seed=i, noise=1.0, seconds=seconds, **how) for i in (1, 2)]


@pytest.mark.parametrize("time", [0.5, 1.5])
def test_a_gauss_markov_force_is_recovered(seen, time):
    flights = flown(seen, DRAG, GustyWind(0.0, 0.0, 0.0, 1.5, time, seed=4))
    dut = slow_force(flights, left_of(flights), LABORATORY)
    assert dut.probability(LABORATORY) > 0.95
    assert dut.deviation[0] == pytest.approx(0.3 * 1.5, rel=0.3)  # 60 s of two axes, thrust above hover [N]
    assert time / 2 < dut.correlation_time[0] < 2 * time


def test_the_half_widths_shrink_with_the_time_flown(seen):
    gusts = GustyWind(0.0, 0.0, 0.0, 1.5, 1.0, seed=4)
    short, long = (flown(seen, DRAG, gusts, seconds=s) for s in (8.0, 32.0))
    widths = [slow_force(f, left_of(f), LABORATORY) for f in (short, long)]
    shares = [w.deviation[1] / w.deviation[0] for w in widths]
    assert shares[1] < 0.8 * shares[0]


@pytest.mark.parametrize("accelerations", [True, False])
@pytest.mark.parametrize("attitude_noise", [0.0, 0.01], ids=["laboratory", "rig"])
def test_noise_alone_is_no_gust(seen, attitude_noise, accelerations):
    flights = flown(seen, DRAG, seconds=12.0, attitude_noise=attitude_noise, accelerations=accelerations)
    tolerance = Tolerance() if attitude_noise else LABORATORY
    assert slow_force(flights, left_of(flights), tolerance).probability(tolerance) < 0.05


def test_a_steady_force_is_no_gust(seen):
    flights = flown(seen, DRAG, seconds=12.0)
    left = left_of(flights)
    still = slow_force(flights, left, LABORATORY)
    for e in flights:
        pushed = np.tile([3.0, -2.0, 1.0], (len(e.t), 1))
        left[e.name][:, :3] += attitude.rotate_back(attitude_on_grid(e), pushed)
    assert slow_force(flights, left, LABORATORY).force == pytest.approx(still.force, rel=0.05)


def cause(effect, **parameters) -> Cause:
    values = parameters or effect.values
    estimates = {n: Estimate(v, "", (v - 0.1, v + 0.1)) for n, v in values.items()}
    return Cause(effect.identifier, 1.0, estimates, {"1": None, "2": 4.0}, effect=effect, share=0.5)


SLOW = SlowForce(0.5, 0.1, (0.6, 0.06), (1.2, 0.3))


def test_in_a_laboratory_a_drag_makes_gusts_likelier_and_on_a_rig_it_does_not():
    small = SlowForce(0.16, 0.1, (0.1, 0.01), (1.0, 0.3))
    assert small.probability(LABORATORY) < 0.2
    assert small.probability(LABORATORY, felt=True) > 0.8
    assert small.probability(Tolerance(), felt=True) == small.probability(Tolerance())


def test_through_a_drag_a_slow_force_is_a_wind():
    causes = as_gusts(SLOW, [cause(DRAG)], 0.9)
    gusts = next(c for c in causes if c.identifier == "gusty_wind")
    assert [c.identifier for c in causes] == ["linear_drag", "gusty_wind"]
    assert gusts.parameters["deviation"].value == pytest.approx(0.6 / 0.3)
    assert gusts.parameters["deviation"].ci95 == pytest.approx((1.8, 2.2))
    assert gusts.parameters["correlation_time"].value == 1.2
    assert gusts.probability == 0.9
    assert isinstance(gusts.effect, GustyWind)
    assert gusts.effect.deviation == pytest.approx(2.0)
    assert gusts.onset == {"1": None, "2": 4.0}


def test_a_steady_wind_is_the_mean_of_the_gusts():
    causes = as_gusts(SLOW, [cause(DRAG), cause(ConstantWind(2.0, -1.0, 0.5))], 0.9)
    assert [c.identifier for c in causes] == ["linear_drag", "gusty_wind"]
    assert [causes[1].parameters[f"mean_{a}"].value for a in "xyz"] == [2.0, -1.0, 0.5]


def test_without_a_drag_a_slow_force_stays_unnamed():
    causes = [cause(ConstantWind())]
    assert as_gusts(SLOW, causes, 0.9) == causes
    assert as_gusts(SLOW, [], 0.9) == []
