"""Laws of coverage: what held-out flights put to the test."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.report.answer import coverage, reach, trace_ratio
from np_drake.diagnosis.result import Cause
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.ground_effect import GroundEffect
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.suspended_payload import SuspendedPayload

DRAG = LinearDrag(0.3, 0.3, 0.3)


def cause(effect, onset=None):
    return Cause(effect.identifier, 0.97, {}, onset or {}, effect=effect)


@pytest.fixture(scope="module")
def train(seen):
    return [seen(name="train", seed=1)]


@pytest.fixture(scope="module")
def hover(seen):
    return [seen(name="hover", seed=2, vigour=0.02)]


def test_a_flight_like_training_tests_every_cause(seen, train):
    causes = [cause(DRAG), cause(MassError(0.1)), cause(SuspendedPayload(0.1, 0.8))]
    (said,) = coverage(causes, train, [seen(name="alike", seed=3)])
    assert said.startswith("The held-out flight tests every cause: the weakest, ")
    assert said.endswith(" of its training trace.")
    (nothing,) = coverage([], train, [seen(name="alike", seed=3)])
    assert nothing == "The held-out flight moves like training: what acts there would show."


def test_a_hovering_flight_does_not_test_drag(train, hover):
    (speed,) = [s for s in coverage([cause(DRAG)], train, hover) if "linear drag" in s.lower()]
    assert speed.startswith("The held-out flight reaches ")
    assert "m/s, training " in speed
    assert speed.endswith(": linear drag was not tested.")


def test_a_hovering_flight_tests_a_mass(train, hover):
    assert not any("mass" in s for s in coverage([cause(MassError(0.1))], train, hover))
    assert trace_ratio("mass_error", [cause(MassError(0.1))], train, hover) == pytest.approx(
        1.0, abs=0.05
    )


def test_without_a_cause_a_hovering_flight_still_says_what_it_leaves_out(train, hover):
    said = coverage([], train, hover)
    assert any(s.endswith("what grows with speed was not tested.") for s in said)


def test_a_cause_that_does_not_act_in_the_held_out_flight_is_not_tested(seen, train):
    other = [seen(name="other", seed=3)]
    (said,) = coverage([cause(DRAG, {"train": None, "other": np.inf})], train, other)
    assert said == "Linear drag does not act in the held-out flight: it was not tested."


def test_wind_acts_through_the_drag_beside_it(seen, train):
    other = [seen(name="other", seed=3)]
    causes = [cause(DRAG), cause(ConstantWind(3.0, 0.0, 0.0))]
    assert trace_ratio("constant_wind", causes, train, other) == pytest.approx(1.0, abs=0.1)
    assert (
        trace_ratio("constant_wind", causes[1:], train, other) == np.inf
    )  # nothing to act through


def test_a_faint_cause_without_a_quantity_of_its_own_says_how_faint(seen, train):
    (e,) = train
    low = [dc.replace(e, mids=_near_ground(e.mids), rows=_near_ground(e.rows))]
    (said,) = coverage([cause(GroundEffect(0.3))], low, train)
    assert said.startswith("Ground effect has ")
    assert said.endswith("of its training trace in the held-out flight: it was not tested.")


def _near_ground(instants):
    x = instants.x.copy()
    x[:, 2] = 0.15
    return dc.replace(instants, x=x)


def test_rows_that_joined_the_fit_test_nothing(seen, train, hover):
    lively = seen(name="half", seed=3)
    still = np.linalg.norm(lively.mids.x[:, 7:10], axis=1)
    assert reach([lively])["speed"][0] <= still.max()
    joined = dc.replace(lively, joined=lively.t <= lively.t[len(lively.t) // 2])
    assert reach([joined])["duration"][0] == pytest.approx(
        0.5 * reach([lively])["duration"][0], rel=0.01
    )


def test_a_torque_that_the_log_does_not_tell_is_not_compared(train, hover):
    silent = [dc.replace(e, knows_torque=False) for e in hover]
    assert reach(train)["torque"][0] > 3 * reach(hover)["torque"][0] > 0
    assert reach(silent)["torque"] == (0.0, "N·m")


def test_several_flights_are_spoken_of_as_several(train, hover):
    two = [*hover, dc.replace(hover[0])]
    assert any(
        s.startswith("The held-out flights reach") for s in coverage([cause(DRAG)], train, two)
    )
