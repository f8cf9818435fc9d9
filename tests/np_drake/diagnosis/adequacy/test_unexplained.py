import dataclasses as dc
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from np_drake.diagnosis.adequacy import residual_tests
from np_drake.diagnosis.adequacy import unexplained as remains_module
from np_drake.diagnosis.adequacy.generic_structure import repeats_on_held_out
from np_drake.diagnosis.adequacy.residual_statistics import strongest_line
from np_drake.diagnosis.adequacy.unexplained import find_unexplained
from np_drake.diagnosis.forward_model.term import Term
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.result import CHANNELS
from np_drake.effects.base import WrenchEffect
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.inertia_error import InertiaError
from np_drake.effects.mass_error import MassError
from np_drake.effects.motor_lag import MotorLag
from np_drake.rigid_body import W

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)

CLEAR = 10.0  # prominence of a line in these short flights that noise does not have [1]
SENSITIVE = dc.replace(REAL, thresholds=dc.replace(REAL.thresholds, line=CLEAR))


@dc.dataclass(frozen=True)
class Damper(WrenchEffect):
    """A torque against the body rate, which the library does not have."""

    identifier: ClassVar[str] = "damper"

    def wrench(self, vehicle, motion):
        return np.concatenate([np.zeros_like(motion.x[..., W]), -0.02 * motion.x[..., W]], axis=-1)


@pytest.fixture(scope="module")
def of(ranked):
    def answer(*effects):
        case = ranked(*effects)
        return find_unexplained(case.ranking, case.fit, case.flights, case.held_out)

    return answer


def test_of_a_nominal_flight_nothing_remains(of):
    dut = of()
    assert not dut.unknown
    assert dut.probability < 0.2
    assert dut.slow_probability < 0.2
    assert dut.findings == ()
    assert not dut.novel_on_held_out


def test_a_torque_that_no_effect_explains_remains_and_says_where_it_lives(of):
    dut = of(Damper())
    assert dut.unknown
    assert dut.probability > 0.9
    assert dut.findings[0].name == "rates"
    assert dut.findings[0].figures["torque"] == pytest.approx(
        0.02 * 0.9, rel=0.4
    )  # times the rates' RMS [N·m]


@pytest.mark.parametrize(
    "effect",
    [InertiaError(1.3, 0.8, 1.2), MotorLag(0.04), CommandDelay(0.02)],
    ids=lambda e: e.identifier,
)
def test_beside_an_effect_that_explains_a_torque_no_generic_torque_is_unknown(ranked, effect):
    case = ranked(effect)
    assert effect.identifier in [t.effect.identifier for t in case.ranking.named.terms]
    assert not find_unexplained(case.ranking, case.fit, case.flights, case.held_out).unknown


@pytest.mark.parametrize("channel, size", [(0, 2.0), (4, 0.1)], ids=["force [N]", "torque [N·m]"])
def test_what_unseen_flights_alone_show_is_unknown(ranked, channel, size):
    case = ranked()
    held_out = [dc.replace(e, y=e.y.copy()) for e in case.held_out]
    for e in held_out:
        e.y[:, channel] += size * np.sin(2 * np.pi * 0.5 * e.t) * np.sin(2 * np.pi * 0.13 * e.t)
    dut = find_unexplained(case.ranking, case.fit, case.flights, held_out)
    assert dut.unknown
    assert {f.name for f in dut.findings} - {"burst"} == {"unseen flights"}
    assert dut.novel_on_held_out


@pytest.mark.parametrize("where", ["a flight of the fit", "the unseen one"])
@pytest.mark.parametrize("size, unknown", [(0.03, False), (2.0, True)], ids=["as noise", "large"])
def test_a_force_now_and_then_is_unknown_wherever_it_is(ranked, where, size, unknown):
    case = ranked()
    flights, held_out = list(case.flights), list(case.held_out)
    struck = flights if where == "a flight of the fit" else held_out
    struck[0] = dc.replace(struck[0], y=struck[0].y.copy())
    struck[0].y[:, 2] -= size * np.exp(-(((struck[0].t - 3.0) / 0.3) ** 2))
    dut = find_unexplained(case.ranking, case.fit, flights, held_out)
    assert dut.unknown is unknown
    bursts = [f for f in dut.findings if f.name == "burst"]
    assert len(bursts) == unknown
    for found in bursts:
        assert struck[0].name in found.text
        assert found.figures["time"] == pytest.approx(3.0, abs=0.1)


@pytest.mark.parametrize("share, unknown", [(0.001, False), (0.01, True)])
def test_a_flight_that_weighs_otherwise_than_the_others_is_unknown(ranked, share, unknown):
    case = ranked()
    (held_out,) = case.held_out
    held_out = dc.replace(held_out, y=held_out.y.copy())
    held_out.y[:, 2] += share * held_out.vehicle.mass * held_out.vehicle.gravity
    dut = find_unexplained(case.ranking, case.fit, case.flights, [held_out])
    assert dut.unknown is unknown
    assert [f.name for f in dut.findings] == ["lift"] * unknown


@pytest.mark.parametrize("channel", [0, 4], ids=["force", "torque"])
@pytest.mark.parametrize("times", [0.7, 2.0], ids=["too small to matter", "large"])
def test_a_line_is_unknown_where_it_is_large_enough_to_matter_however_clear_it_is(ranked, channel, times):
    case = ranked()
    ranking = dc.replace(case.ranking, options=SENSITIVE)
    least = residual_tests.least_lines(case.flights, SENSITIVE.materiality)[channel]
    wave = [dc.replace(e, y=e.y.copy()) for e in (*case.flights, *case.held_out)]
    for e in wave:
        e.y[:, channel] += times * least * np.sqrt(2) * np.sin(2 * np.pi * 2.3 * e.t)
    *flights, held_out = wave
    line = strongest_line(flights, {e.name: case.fit.residual(e) for e in flights})
    assert line.prominence > CLEAR
    assert line.channel == channel
    assert line.rms == pytest.approx(times * least, rel=0.1)
    dut = find_unexplained(ranking, case.fit, flights, [held_out])
    assert dut.unknown is (times > 1)
    assert ("line" in {f.name for f in dut.findings}) is (times > 1)


def test_a_line_that_does_not_matter_hides_none_that_does(ranked):
    case = ranked()
    ranking = dc.replace(case.ranking, options=SENSITIVE)
    least = residual_tests.least_lines(case.flights, SENSITIVE.materiality)
    both = [dc.replace(e, y=e.y.copy()) for e in (*case.flights, *case.held_out)]
    for e in both:
        for channel, times, f in ((0, 0.8, 2.3), (4, 1.3, 5.3)):
            e.y[:, channel] += times * least[channel] * np.sqrt(2) * np.sin(2 * np.pi * f * e.t)
    *flights, held_out = both
    dut = find_unexplained(ranking, case.fit, flights, [held_out])
    (line,) = (f for f in dut.findings if f.name == "line")
    assert f"a line in {CHANNELS[4]} " in line.text
    assert dut.unknown


def test_the_unseen_flight_is_explained_too(of):
    dut = of()
    assert dut.held.residual.keys() == dut.held.terms.keys() == {"c"}
    assert dut.held.rows["c"].all()


def repeats(part: np.ndarray, flight, noise) -> list[bool]:
    """Of a structure with this trace (m, 15), fitted beside a mass error."""
    fit = SimpleNamespace(everything=[Term(MassError(0.2))], generic=[SimpleNamespace(part=lambda e: part)])
    ranking = SimpleNamespace(noise=noise, problem=SimpleNamespace(temperature=2.0), options=REAL)
    held = SimpleNamespace(rows={flight.name: np.ones(len(flight.t), bool)})
    return repeats_on_held_out(ranking, fit, [flight], held)  # type: ignore[arg-type]


def test_structure_repeats_where_it_helps_beside_the_effects_that_it_was_fitted_with(seen, noise):
    flight = seen(MassError(0.2), name="c", seed=3, noise=1.0)
    part = np.zeros_like(flight.y)
    part[:, 0] = 0.3 * np.sin(5.0 * flight.t)
    with_it = dc.replace(flight, y=flight.y + part)
    assert repeats(part, with_it, noise) == [True]
    assert repeats(-part, with_it, noise) == [False]
    assert repeats(part, flight, noise) == [False]


def test_in_gusts_which_come_and_go_no_burst_is_asked_for(ranked, monkeypatch):
    case = ranked()
    (held_out,) = case.held_out
    held_out = dc.replace(held_out, y=held_out.y.copy())
    held_out.y[:, 2] -= 2.0 * np.exp(-(((held_out.t - 3.0) / 0.3) ** 2))
    for slowly, found in ((0.0, True), (1.0, False)):
        monkeypatch.setattr(remains_module, "gust_probability", lambda *_, slowly=slowly: slowly)
        dut = find_unexplained(case.ranking, case.fit, case.flights, [held_out])
        assert ("burst" in {f.name for f in dut.findings}) is found
