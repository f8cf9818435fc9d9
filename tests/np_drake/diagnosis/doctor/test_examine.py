"""Laws of the examination: what a log can and cannot tell, with and without a vehicle, and on real
flights.
"""

import dataclasses as dc
import math
from types import SimpleNamespace

import numpy as np
import pytest

from np_drake.diagnosis.doctor.examine import (
    Information,
    _drag,
    examine,
    smallest_gust,
    smallest_sizes,
    traces,
)
from np_drake.diagnosis.options import Options
from np_drake.effects.library import LIBRARY, REQUIREMENTS, effects_for, unobservable
from np_drake.estimation.noise import NoiseModel
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
    assert "nothing moves (speed 0.0" in str(dut.problems[0])
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
    lacking = unobservable(kind, accelerations=False, torque=kind == "rotor_speed")
    hidden = {name: REQUIREMENTS[what] for name, what in lacking.items()}
    dut = examine([given], vehicle)
    assert {a.identifier: a.reason for a in dut.answers if a.verdict == "never"} == hidden
    assert all(a.smallest == math.inf and a.todo for a in dut.answers if a.verdict == "never")
    assert {a.identifier for a in dut.answers} == set(effects_for(kind))


def test_without_a_vehicle_only_facts_are_given_and_it_is_said(log):
    dut = examine([log])
    assert dut.answers == ()
    assert dut.usable
    assert "no vehicle file" in str(dut.problems[-1])
    assert dut.flights[0].signals


@pytest.mark.parametrize("vehicle", [None, Vehicle()])
def test_motion_is_that_of_all_flights(log, fly, vehicle):
    lower = fly(name="b", seed=2, noise=1.0, vigour=1.5, height=0.8, seconds=6.0)
    dut = examine([log, lower], vehicle).excitation
    v = np.concatenate([log.v, lower.v])
    assert (
        dut["fastest [m/s]"]
        == np.linalg.norm(v, axis=1).max()
        > np.linalg.norm(log.v, axis=1).max()
    )
    assert dut["lowest [m]"] == lower.p[:, 2].min() < log.p[:, 2].min()
    rms = np.sqrt(np.mean(np.sum(v**2, axis=1)))
    assert dut["speed [m/s]"] == pytest.approx(rms, rel=0.02)  # means of intervals with a vehicle


def test_a_drag_is_the_mean_of_its_axes_by_their_precision():
    found = _drag(SimpleNamespace(typical=[0.5]), np.array([1.0, 3.0]), np.array([0.1, 0.2]) ** 2)
    assert found == pytest.approx(0.5 * (100 * 1.0 + 25 * 3.0) / 125)


OPTIONS = Options.for_sensors(False)
LINEAR = ("linear_drag", "inertia_error", "weak_rotor", "center_of_mass_offset")


@pytest.fixture(scope="module")
def flight(seen):
    return seen(name="a", seed=1, noise=1.0)


@pytest.fixture(scope="module")
def found(flight):
    return [t for t in traces([flight], OPTIONS.priors) if t.identifier in LINEAR]


def sizes(flights, noise, found):
    return {s.identifier: s for s in smallest_sizes(Information(flights, noise, [], found))}


def test_half_the_noise_is_half_the_size(flight, noise, found):
    quiet = dc.replace(noise, mixing=2 * noise.mixing)
    loud, dut = sizes([flight], noise, found), sizes([flight], quiet, found)
    for name in LINEAR:
        np.testing.assert_allclose(dut[name].alone, 0.5 * loud[name].alone, rtol=1e-6)  # rounding


def test_an_effect_is_not_told_from_its_twin_and_the_twin_is_named(flight, noise, found):
    drag = next(t for t in found if t.identifier == "linear_drag")
    twin = dc.replace(drag, identifier="twin")
    dut = sizes([flight], noise, [drag, twin])["linear_drag"]
    assert dut.resembles == ("twin",)
    # no better than the prior of the twin allows
    assert np.all(dut.adjacent > 3 * np.array(drag.typical))
    assert np.all(dut.alone < 0.5 * np.array(drag.typical))


def test_a_trace_of_nothing_is_never_told(flight, noise, found):
    drag = next(t for t in found if t.identifier == "linear_drag")
    still = dc.replace(drag, columns={n: 0 * X for n, X in drag.columns.items()})
    assert np.all(sizes([flight], noise, [still])["linear_drag"].alone > 1e3)  # N·s/m


def test_gusts_are_told_from_less_in_less_noise_and_in_longer_flights():
    def of(deviation: float) -> NoiseModel:
        unit = np.full(15, deviation)
        return NoiseModel(np.zeros((15, 1)), np.diag(1 / unit), unit, unit**2, 0.02)

    dut = smallest_gust(of(0.1), 100.0)
    assert smallest_gust(of(0.05), 100.0) == pytest.approx(0.5 * dut)
    longer = smallest_gust(of(0.1), 1600.0)
    # the power as one over root T; the lowest frequencies
    assert longer == pytest.approx(0.5 * dut, rel=0.02)
    assert 0.0 < dut < 0.1
