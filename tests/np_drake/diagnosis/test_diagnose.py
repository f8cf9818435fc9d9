"""Laws of the whole diagnosis on simulated flights."""

import dataclasses as dc
import importlib
from functools import cache
from typing import ClassVar

import numpy as np
import pytest

from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.doctor.examine import examine
from np_drake.diagnosis.options import Tolerance
from np_drake.diagnosis.residuals.make_flight_residuals import require_flights, with_same_readings
from np_drake.diagnosis.result import Diagnosis
from np_drake.effects.base import Parameter, WrenchEffect
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.library import register
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.logs.inputs import USUAL, with_throttle_input
from np_drake.rigid_body import W
from np_drake.rotor_input import rotor_speed, with_rotor_input
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


def test_one_effect_is_found_with_its_size(diagnosed):
    dut = diagnosed(LinearDrag(0.6, 0.6, 0.6))
    assert dut.verdict == ("linear_drag",)
    for estimate in dut.causes[0].parameters.values():
        assert estimate.ci95[0] < 0.6 < estimate.ci95[1]
        assert estimate.ci95[1] - estimate.ci95[0] < 0.2
    assert dut.gap_reduction.fraction > 0.95
    assert dut.vehicle == "paper"
    assert dut.train == ("a", "b")
    assert dut.held_out == ("c",)


def test_what_a_rigs_file_may_be_off_by_is_a_cause_in_a_laboratory(diagnosed, fly):
    lighter = MassError(-0.012 * VEHICLE.mass)
    assert diagnosed(lighter).judged_as == "laboratory"
    assert diagnosed(lighter).verdict == ("mass_error",)
    train, judge = ([fly(lighter, name=n, seed=i, **SHORT)] for n, i in (("a", 1), ("c", 3)))
    dut = diagnose(VEHICLE, train, judge, tolerance=Tolerance())
    assert (dut.judged_as, dut.verdict) == ("rig", ())


def test_a_dead_time_is_found_without_a_clock_of_the_other_sign(diagnosed):
    dut = diagnosed(CommandDelay(0.03))
    assert dut.verdict == ("command_delay",)
    assert dut.causes[0].parameters["delay"].value == pytest.approx(0.03, abs=0.002)
    assert "clock_offset" not in dut.causes[0].indistinguishable_from


def test_two_effects_are_found_each_with_its_onset(diagnosed):
    dut = diagnosed(MassError(0.3), LinearDrag(0.6, 0.6, 0.6), onset=(("mass_error", 5.0),))
    assert sorted(dut.verdict) == ["linear_drag", "mass_error"]
    cause = {c.identifier: c for c in dut.causes}
    assert cause["linear_drag"].onset == {"a": None, "b": None, "c": None}
    for name in "abc":
        assert cause["mass_error"].onset[name] == pytest.approx(5.0, abs=0.2)
    assert cause["mass_error"].parameters["delta_mass"].value == pytest.approx(0.3, rel=0.05)


def test_without_accelerations_the_cause_is_the_same(diagnosed):
    dut = diagnosed(LinearDrag(0.6, 0.6, 0.6), accelerations=False)
    assert dut.verdict == ("linear_drag",)
    assert any("no acceleration" in w for w in dut.warnings)


def test_flights_that_hover_cannot_tell(diagnosed):
    dut = diagnosed(MassError(0.3), vigour=0.0)
    assert dut.cannot_tell
    assert dut.verdict == ()
    assert not dut.identifiability.usable
    assert dut.identifiability.not_identifiable
    assert dut.gap_reduction.before > 1.0


def test_a_hover_without_noise_is_judged_without_a_warning(fly):
    logs = [fly(MassError(0.3), name=n, noise=0.0, vigour=0.0, seconds=5.0) for n in "ab"]
    dut = diagnose(VEHICLE, logs[:1], logs[1:])
    assert dut.cannot_tell
    assert np.isfinite(dut.gap_reduction.before)


@pytest.fixture(scope="module")
def watched(fly):
    """Return short flights, their diagnosis, and the progress that was told meanwhile."""
    told = []
    logs = [
        fly(LinearDrag(0.6, 0.6, 0.6), name=n, seed=i, noise=1.0, seconds=5.0)
        for i, n in enumerate("ab")
    ]
    dut = diagnose(
        VEHICLE, logs[:1], logs[1:], on_progress=lambda share, text: told.append((share, text))
    )
    return logs, dut, told


def test_the_same_logs_give_the_same_answer(watched):
    logs, dut, _ = watched
    assert dut.verdict == ("linear_drag",)
    again = diagnose(VEHICLE, logs[:1], logs[1:])
    first, second = (dc.replace(d, wall=0.0).as_json() for d in (dut, again))
    assert first == second


def test_a_diagnosis_leaves_the_logs_as_they_were(fly):
    logs = [fly(name=n, seed=i, noise=1.0, vigour=0.0, seconds=4.0) for i, n in enumerate("ab")]
    before = [log.x.copy() for log in logs]
    diagnose(VEHICLE, logs[:1], logs[1:])
    for log, x in zip(logs, before, strict=True):
        np.testing.assert_array_equal(log.x, x)


@dc.dataclass(frozen=True)
class Brake(WrenchEffect):
    """Rotational damping tau_B = -brake w."""

    brake: float = 0.02  # [N·m·s]

    identifier: ClassVar[str] = "test_brake"
    feels_rotor_rate: ClassVar[bool] = False
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("brake", "N·m·s", 0.0, -1.0, 1.0, 0.02),
    )

    def wrench(self, vehicle, motion):
        return np.concatenate(
            [np.zeros_like(motion.x[..., W]), -self.brake * motion.x[..., W]], axis=-1
        )


def test_a_users_own_effect_is_found_once_it_is_registered(fly, library):
    dut = Brake(0.02)
    train = [fly(dut, name=n, seed=i, **SHORT) for i, n in enumerate(("a", "b"), start=1)]
    held_out = [fly(dut, name="c", seed=3, **SHORT)]
    assert "test_brake" not in library
    register(Brake)
    found = diagnose(VEHICLE, train, held_out)
    assert found.verdict == ("test_brake",)
    assert found.causes[0].parameters["brake"].value == pytest.approx(0.02, rel=0.05)
    assert found.causes[0].effect == Brake(found.causes[0].parameters["brake"].value)


def test_progress_is_told_and_grows(watched):
    *_, told = watched
    shares = [share for share, _ in told]
    assert shares == sorted(shares)
    assert shares[0] == 0.0
    assert shares[-1] <= 1.0
    assert all(text for _, text in told)


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


def test_accelerations_that_some_flights_lack_are_used_of_none(fly):
    a, b, c = (fly(name=name, seed=i, seconds=5.0) for i, name in enumerate("abc"))
    mixed, (said,) = with_same_readings([a, dc.replace(b, a=None), c])
    assert all(log.a is None for log in mixed)
    assert said.startswith("accelerations are used of no flight: b has none.")
    assert with_same_readings([a, c]) == ([a, c], ())


def test_flights_of_different_inputs_are_named_with_a_remedy(fly):
    a, b = (
        fly(name="a", seconds=5.0),
        dc.replace(fly(name="b", seed=1, seconds=5.0), input="thrust_only"),
    )
    with pytest.raises(
        ValueError, match=r"got command \(a\) and thrust_only \(b\)\. Diagnose each kind by itself"
    ):
        require_flights([a], [b])


def test_flights_that_share_a_beginning_or_stand_still_may_judge(fly):
    a, b = fly(name="a", seconds=5.0), fly(name="b", seed=1, seconds=5.0)
    shared = np.arange(len(a))[:, None] < 0.4 * len(a)
    begun = dc.replace(b, **{f: np.where(shared, getattr(a, f), getattr(b, f)) for f in "pvw"})
    still = dc.replace(a, **{f: np.zeros_like(getattr(a, f)) for f in "pvw"})
    require_flights([a], [begun])
    require_flights([still], [dc.replace(still, name="b")])


def test_all_flights_of_a_diagnosis_have_one_map_of_their_throttle(fly, monkeypatch):
    def with_throttle(log, exponent):
        share = np.maximum(log.u[:, :1], 0.0) / (VEHICLE.mass * VEHICLE.gravity)
        return with_throttle_input(dc.replace(log, throttle=0.4 * share ** (1 / exponent)), VEHICLE)

    class Seen(Exception):
        pass

    def infer(fitted, judging, options):
        raise Seen(fitted, judging)

    monkeypatch.setattr(importlib.import_module("np_drake.diagnosis.diagnose"), "infer", infer)
    logs = [with_throttle(fly(name=str(i), seed=i, **SHORT), 1.5 + 0.1 * i) for i in range(3)]
    with pytest.raises(Seen) as seen:
        diagnose(VEHICLE, logs[:2], logs[2:])
    slopes = [
        np.polyfit(np.log(e.log.throttle[:, 0]), np.log(e.log.u[:, 0]), 1)[0]
        for es in seen.value.args
        for e in es
    ]
    assert len(slopes) == 3
    np.testing.assert_allclose(slopes, slopes[0], rtol=1e-9)
    assert slopes[0] == pytest.approx(USUAL)  # where the fit begins


def test_a_coefficient_that_is_a_guess_gives_way_in_a_diagnosis_as_well(fly, monkeypatch):
    k, c = 0.7 * VEHICLE.thrust_coefficient, 0.7 * VEHICLE.torque_coefficient
    file = dc.replace(VEHICLE, thrust_coefficient=k, torque_coefficient=c, thrust_uncertainty=0.2)

    def driven(log):
        return with_rotor_input(dc.replace(log, rotor=rotor_speed(VEHICLE, log.u)), file)

    class Seen(Exception):
        pass

    class Simulator:
        vehicle = file

        def of_vehicle(self, vehicle):
            raise Seen(vehicle)

    def infer(fitted, judging, options):
        raise Seen(fitted, judging)

    monkeypatch.setattr(importlib.import_module("np_drake.diagnosis.diagnose"), "infer", infer)
    train, held_out = ([driven(fly(name=str(i), seed=i, **SHORT))] for i in range(2))
    with pytest.raises(Seen) as seen:
        diagnose(file, train, held_out, Simulator())
    assert seen.value.args[0].thrust_coefficient == pytest.approx(
        VEHICLE.thrust_coefficient, rel=0.01
    )
    with pytest.raises(Seen) as seen:
        diagnose(file, train, held_out)
    for flights in seen.value.args:
        assert np.sqrt(np.mean(flights[0].y[:, 2] ** 2)) < 0.05 * VEHICLE.mass * VEHICLE.gravity
    assert examine(train, file).problems[0].startswith("0: thrust coefficient ")
