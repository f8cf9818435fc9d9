"""Laws of the whole diagnosis on simulated flights."""

import dataclasses as dc
from functools import cache

import pytest

from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.result import Diagnosis
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
SHORT = {"noise": 1.0, "seconds": 8.0}


@pytest.fixture(scope="module")
def diagnosed(fly, quick_searches):
    """Return a function that diagnoses two training flights and a held-out one under some effects;
    cached.
    """

    @cache
    def answer(*effects, onset=None, **how) -> Diagnosis:
        own = {**SHORT, "onset": dict(onset or ()), **how}
        train = [fly(*effects, name=n, seed=i, **own) for i, n in enumerate(("a", "b"), start=1)]
        return diagnose(VEHICLE, train, [fly(*effects, name="c", seed=3, **own)])

    return answer


def test_a_flight_as_nominal_has_nothing_missing(diagnosed):
    dut = diagnosed()
    assert dut.verdict == ()
    assert dut.causes == ()
    assert not dut.cannot_tell
    assert dut.unknown_probability < 0.5
    assert dut.gap_reduction.before == pytest.approx(1.0, abs=0.1)


def test_two_effects_are_found_each_with_its_onset(diagnosed):
    dut = diagnosed(MassError(0.3), LinearDrag(0.6, 0.6, 0.6), onset=(("mass_error", 5.0),))
    assert sorted(dut.verdict) == ["linear_drag", "mass_error"]
    cause = {c.identifier: c for c in dut.causes}
    assert cause["linear_drag"].onset == {"a": None, "b": None, "c": None}
    for name in "abc":
        assert cause["mass_error"].onset[name] == pytest.approx(5.0, abs=0.2)
    assert cause["mass_error"].parameters["delta_mass"].value == pytest.approx(0.3, rel=0.05)


def test_flights_that_hover_cannot_tell(diagnosed):
    dut = diagnosed(MassError(0.3), vigour=0.0)
    assert dut.cannot_tell
    assert dut.verdict == ()
    assert not dut.identifiability.usable
    assert dut.identifiability.not_identifiable
    assert dut.gap_reduction.before > 1.0


def bad_inputs(fly):
    """Return what is wrong, and the flights."""
    a, b = fly(name="a", seconds=5.0), fly(name="b", seconds=5.0)
    yield "train must hold at least one flight", [], [b]
    yield "held_out must hold at least one flight", [a], []
    yield "'a' twice", [a], [dc.replace(b, name="a")]
    yield "'a' twice", [a, dc.replace(b, name="a")], [b]
    yield "same input", [a], [dc.replace(b, input="rotor_speed")]
    yield "at least 3 s", [a], [fly(name="b", seed=1, seconds=2.0)]
    for copy in (a, a.rows(0, len(a) - 7), a.rows(33, len(a)), a.rows(0, len(a) // 4)):
        yield "b is the same flight as a", [a], [dc.replace(copy, name="b")]


def test_bad_inputs_are_refused_in_one_line_that_says_what_is_wrong(fly):
    for message, train, held_out in bad_inputs(fly):
        with pytest.raises(ValueError, match=message) as error:
            diagnose(VEHICLE, train, held_out)
        assert "\n" not in str(error.value)
        assert str(error.value).startswith("diagnose: ")
