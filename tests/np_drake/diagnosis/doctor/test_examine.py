"""Laws of the examination: what a log can and cannot tell, with and without a vehicle, and on real
flights.
"""

import dataclasses as dc
import math
from types import SimpleNamespace

import numpy as np
import pytest

from np_drake.diagnosis.doctor.examine import examine
from np_drake.diagnosis.doctor.smallest_sizes import _drag
from np_drake.effects.library import LIBRARY, effects_for, unobservable
from np_drake.rotor_input import rotor_speed, with_rotor_input
from np_drake.vehicle import Vehicle


@pytest.fixture(scope="module")
def log(fly):
    return fly(seed=1, noise=1.0)


@pytest.fixture(scope="module")
def report(log):
    return examine([log], Vehicle())


def test_every_effect_of_the_library_has_an_answer(report):
    assert {a.identifier for a in report.answers} == set(LIBRARY)
    assert all(a.todo for a in report.answers if a.verdict != "yes")
    assert all(a.reason for a in report.answers if a.verdict != "yes")
    assert all(
        (a.verdict == "yes") == (a.smallest <= a.typical)
        for a in report.answers
        if a.verdict != "never"
    )
    assert all(a.alone <= a.smallest * (1 + 1e-6) for a in report.answers)  # rounding


def test_a_hovering_flight_is_not_usable_and_says_so(fly):
    dut = examine([fly(vigour=0.0, noise=1.0)], Vehicle())
    assert not dut.usable
    assert "nothing moves (speed 0.0" in dut.problems[0]
    assert {a.verdict for a in dut.answers if a.identifier == "linear_drag"} == {"no"}


@pytest.mark.parametrize("kind", ["rotor_speed", "thrust_only"])
def test_what_the_input_hides_is_never_told_and_the_reason_is_given(log, kind):
    vehicle = Vehicle()
    if kind == "rotor_speed":
        given = with_rotor_input(dc.replace(log, rotor=rotor_speed(vehicle, log.u)), vehicle)
    else:
        given = dc.replace(
            log, input=kind, u=np.column_stack([log.u[:, 0], np.full((len(log), 3), np.nan)])
        )
    given = dc.replace(given, a=None)
    hidden = unobservable(kind, accelerations=False, torque=kind == "rotor_speed")
    dut = examine([given], vehicle)
    assert {a.identifier: a.reason for a in dut.answers if a.verdict == "never"} == hidden
    assert all(a.smallest == math.inf and a.todo for a in dut.answers if a.verdict == "never")
    assert {a.identifier for a in dut.answers} == set(effects_for(kind))


def test_without_a_vehicle_only_facts_are_given_and_it_is_said(log):
    dut = examine([log])
    assert dut.answers == ()
    assert dut.usable
    assert "no vehicle file" in dut.problems[-1]
    assert dut.flights[0].signals


def test_a_drag_is_the_mean_of_its_axes_by_their_precision():
    trace = SimpleNamespace(identifier="linear_drag", typical=[0.5], columns={})
    found = _drag(np.array([1.0, 3.0, 9.0]), np.array([0.1, 0.2, 1.0]), [], [trace])
    assert found == pytest.approx(0.5 * (100 * 1.0 + 25 * 3.0) / 125)
