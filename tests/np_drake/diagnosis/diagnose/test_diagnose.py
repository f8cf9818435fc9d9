"""Laws of the whole diagnosis on simulated flights."""

import dataclasses as dc
from functools import cache

import numpy as np
import pytest

from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.options import Options, Tolerance
from np_drake.diagnosis.result import Diagnosis
from np_drake.effects.downwash import Downwash
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.flight_log import FlightLog, Neighbour
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
        return diagnose(train, [fly(*effects, name="c", seed=3, **own)], VEHICLE)

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
            diagnose(train, held_out, VEHICLE)
        assert "\n" not in str(error.value)
        assert str(error.value).startswith("diagnose: ")


REAL = Options.for_sensors(True)


def test_tolerance_and_options_together_are_refused():
    with pytest.raises(ValueError, match="either tolerance or options"):
        diagnose([], [], Vehicle(), tolerance=Tolerance(), options=REAL)


def test_a_material_force_is_in_proportion_to_a_material_position_error():
    dut = REAL.with_material(0.1).materiality
    assert (dut.position, dut.remaining_force) == (
        0.1,
        pytest.approx(2 * REAL.materiality.remaining_force),
    )
    with pytest.raises(ValueError, match="material position error must be positive"):
        REAL.with_material(0.0)


STRENGTH = 0.6
FLIGHTS = (("a", 1), ("b", 2), ("c", 3))
VIGOUR = (0.5, 0.5, 0.5, 1.0)  # stays below the neighbour


def hovering(t, height):
    """The log of a neighbour that hovers, on a recording that began 50 s earlier."""
    p, q = np.tile([0.1, 0.0, height], (len(t), 1)), np.tile([1.0, 0, 0, 0], (len(t), 1))
    still = np.zeros_like(p)
    return FlightLog(
        t=t + 50.0,
        p=p,
        q=q,
        v=still,
        w=still,
        u=np.zeros((len(t), 4)),
        name="neighbour",
        start=-50.0,
    )


@pytest.fixture(scope="module")
def beside(fly, quick_searches):
    """Diagnoses of the same flights with and without the log of the neighbour that hovered
    above.
    """
    t = np.linspace(-1.0, 20.0, 211)
    above = hovering(t, 2.6)
    effect = Downwash(STRENGTH, (Neighbour(t, above.p),))
    logs = [
        fly(effect, name=name, seed=seed, noise=1.0, seconds=10.0, vigour=VIGOUR)
        for name, seed in FLIGHTS
    ]
    neighbours = {name: [above] for name, _ in FLIGHTS}
    return diagnose(logs[:2], logs[2:], VEHICLE, neighbours=neighbours)


def test_the_strength_of_a_downwash_lies_in_its_interval(beside):
    dut = beside
    assert dut.verdict == ("downwash",)
    (strength,) = dut.causes[0].parameters.values()
    assert strength.ci95[0] < STRENGTH < strength.ci95[1]
    assert strength.ci95[1] - strength.ci95[0] < 0.2
    assert dut.gap_reduction.fraction > 0.9
    assert any("beside neighbour" in line for line in dut.warnings)
