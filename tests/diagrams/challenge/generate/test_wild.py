"""Laws of the sensor quality `wild`: three times the range of `real`, any input that tells the
effects drawn.
"""

import dataclasses as dc
import json
from functools import partial

import numpy as np
import pytest

from diagrams.challenge.generate.case import FILES, CaseDraw, draw_case
from diagrams.challenge.generate.composition import TWO_AT_ONCE, compose
from diagrams.challenge.generate.flight_pair import FlightPair
from diagrams.challenge.generate.ground_truth import GroundTruth
from diagrams.challenge.generate.logged_input import (
    COMMAND_TIME,
    FINER,
    SEMANTICS,
    TIMING,
    LoggedInput,
    as_logged,
    draw_logged_input,
    with_input,
)
from diagrams.challenge.generate.make import fly_case, make
from diagrams.challenge.generate.sensor_quality import (
    LONGEST_DROP,
    OFF,
    RANGES,
    RATES,
    ROTOR,
    SensorQuality,
    draw_sensor_quality,
    kept_rows,
)
from diagrams.challenge.score.identification import WIDEST
from diagrams.challenge.simulators.drake import simulator
from np_drake.diagnosis.regressors import tolerance_of
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.library import LIBRARY, unobservable
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.flight_log import FlightLog
from np_drake.logs.case_folder import open_case
from np_drake.logs.columns import LONGEST_GAP as LONGEST
from np_drake.logs.formats.log_file import write_log
from np_drake.logs.import_sheet import SUFFIX, read_sheet, write_sheet
from np_drake.logs.opening import open_flights
from np_drake.vehicle.text import vehicle_text
from np_drake.vehicle.vehicle import INPUTS

# The laws hold from any start; a settled one only takes longer.
fly = partial(simulator.fly, warm_up=0.5)  # [s]

SPIN = 700.0  # [rad/s]


@pytest.fixture(scope="module")
def drawn():
    return [draw_sensor_quality("wild", np.random.default_rng(seed), SPIN) for seed in range(400)]


def spans(values, low, high):
    """Whether all values lie within the bounds, and come near both."""
    values = np.log(np.array(values))
    edge = 0.03 * (np.log(high) - np.log(low))  # 400 draws leave no twentieth of a range empty
    return (
        np.log(low) - 1e-9 <= values.min() <= np.log(low) + edge
        and np.log(high) - edge <= values.max() <= np.log(high) + 1e-9
    )


@pytest.mark.parametrize("name", RANGES)
def test_every_figure_has_three_times_the_range_of_real(drawn, name):
    low, high = RANGES[name]
    assert spans([getattr(sensors, name) for sensors in drawn], low / 3, 3 * high)
    real = [
        getattr(draw_sensor_quality("real", np.random.default_rng(k), SPIN), name)
        for k in range(50)
    ]
    assert low <= min(real) <= max(real) <= high


def test_the_vehicle_file_is_three_times_as_far_off_and_noise_is_misstated(drawn):
    for name in ("mass_off", "thrust_off"):
        off = np.array([getattr(sensors, name) for sensors in drawn])
        assert 2.9 * OFF < np.abs(off).max() <= 3 * OFF
        assert np.mean(off > 0) == pytest.approx(0.5, abs=0.1)
        known = SensorQuality("wild").stated_uncertainty()[name.replace("off", "uncertainty")]
        assert off.std() == pytest.approx(known, rel=0.05)
    stated = SensorQuality("wild").stated_noise()
    assert stated == SensorQuality("real").stated_noise()
    for name in ("position", "velocity", "rate", "acceleration"):
        value = getattr(stated, name)
        assert spans([getattr(sensors.white, name) for sensors in drawn], value / 3, 3 * value)
    rotor = [sensors.rotor for sensors in drawn]
    assert spans(np.abs(rotor), ROTOR * SPIN / 3, 3 * ROTOR * SPIN)
    assert np.mean(np.array(rotor) < 0) == pytest.approx(0.5, abs=0.1)


def test_rates_are_log_uniform_between_their_bounds(drawn):
    rates = [sensors.rate for sensors in drawn]
    assert RATES == (50.0, 500.0)
    assert spans(rates, *RATES)
    assert np.median(np.log10(rates)) == pytest.approx(np.log10(RATES).mean(), abs=0.1)
    for sensors in drawn[:5]:
        t = sensors.instants(np.random.default_rng(0), 10.0)
        assert 1 / np.mean(np.diff(t)) == pytest.approx(sensors.rate, rel=0.01)
        assert np.diff(t).min() > 0


def test_rows_are_lost_in_succession_and_no_reader_refuses_the_gaps():
    sensors = dc.replace(
        draw_sensor_quality("wild", np.random.default_rng(0), SPIN),
        rate=RATES[0],
        drops=0.03,
        jitter=0.15,
    )
    rng = np.random.default_rng(1)
    t, rows = sensors.instants(rng, 60.0), kept_rows(rng, sensors, 3000)
    assert len(rows) == 3000 - 90
    assert rows[0] == 0
    assert rows[-1] == 2999
    assert set(np.diff(rows)) == set(range(1, LONGEST_DROP + 2))
    assert np.diff(t[rows]).max() < LONGEST


def test_every_input_and_every_meaning_of_a_command_occurs():
    dut = [draw_logged_input(np.random.default_rng(seed), ("linear_drag",)) for seed in range(200)]
    assert {logged.kind for logged in dut} == set(INPUTS)
    assert {logged.semantics for logged in dut} == set(SEMANTICS)
    assert {logged.late for logged in dut} == set(range(FINER))
    assert {logged.finer for logged in dut} == {1, FINER}


@pytest.mark.parametrize("name", LIBRARY)
def test_the_input_tells_the_effects_that_are_drawn(name):
    for seed in range(30):
        dut = draw_logged_input(np.random.default_rng(seed), (name, "gyro_bias"))
        assert name not in unobservable(dut.kind)
        if name in COMMAND_TIME:
            assert dut.semantics == "held_after"


def test_a_vehicle_file_says_held_where_commands_are_held_and_only_there():
    dut = [draw_case(CaseDraw(k, "clean"), quality="wild", seed=4, seconds=5.0) for k in range(30)]
    for case in dut:
        held = case.input.semantics == "held_after" and case.input.kind != "rotor_speed"
        assert (case.vehicle.command_timing == "held") is held
    assert {case.vehicle.command_timing for case in dut} == {"held", "unknown"}
    assert all(case.quality.rotor > 0 for case in dut if case.input.kind == "rotor_speed")
    real = draw_case(CaseDraw(0, "clean"), quality="real", seed=4, seconds=5.0)
    assert real.vehicle.command_timing == "held"
    assert real.input == LoggedInput()


def test_only_the_vehicle_file_of_wild_states_how_well_it_is_known():
    for quality, stated in [("clean", None), ("real", None), ("wild", 0.0173)]:
        case = draw_case(CaseDraw(0, "clean"), quality=quality, seed=4, seconds=5.0)
        text = vehicle_text(case.vehicle)
        assert ("uncertainty" in text) == (stated is not None)
        assert (case.vehicle.mass_uncertainty, case.vehicle.thrust_uncertainty) == (stated, stated)


@pytest.mark.parametrize("kind", INPUTS)
@pytest.mark.parametrize("semantics", SEMANTICS)
def test_a_log_states_when_its_commands_act_where_they_are_not_held(kind, semantics, tmp_path):
    dut = LoggedInput(kind, semantics).sheet(0.02)
    assert (dut is None) == (semantics == "held_after" or kind == "rotor_speed")
    if dut is not None:
        write_sheet(dut, tmp_path / "flight.csv")
        assert read_sheet(tmp_path / "flight.csv").timing == pytest.approx(
            TIMING[semantics] * 0.02, abs=1e-6
        )
        assert (semantics in (tmp_path / "flight.import.yaml").read_text()) == (
            semantics != "held_before"
        )
    assert LoggedInput().sheet(0.02) is None  # of clean and real


def in_tolerance(effect, logged):
    """A wild case at 100 Hz with this effect and input: whether it is within what its files may be
    off by.
    """
    case = draw_case(
        CaseDraw(0, "single", (effect.identifier,)), quality="wild", seed=3, seconds=5.0
    )
    quality = dc.replace(case.quality, rate=100.0, rotor=abs(case.quality.rotor))
    case = dc.replace(case, quality=quality, input=logged, effects=(effect,))
    truth = GroundTruth.of(case, *fly_case(case, "drake"))
    (flag,), classes = truth.within_tolerance(), truth.collinear_class()
    assert classes[0][0] == effect.identifier
    return flag, classes[0]


@pytest.mark.parametrize(
    "effect, logged, expected",
    [
        (ThrustScale(0.96), LoggedInput(), True),  # 2.3 standard deviations of the file
        (ThrustScale(0.88), LoggedInput(), False),
        (
            ThrustScale(0.88),
            LoggedInput("normalised"),
            True,
        ),  # a throttle's scale is known to a fifth
        (CommandDelay(0.002), LoggedInput("command", "sampled"), True),  # the interval is 10 ms
        (CommandDelay(0.002), LoggedInput(), False),
        (LinearDrag(0.6, 0.6, 0.6), LoggedInput("command", "sampled"), False),
    ],
)
def test_what_the_files_may_be_off_by_must_not_be_named(effect, logged, expected):
    flag, names = in_tolerance(effect, logged)
    assert flag is expected
    assert (len(names) > WIDEST) is expected  # it is the same as anything


def test_the_truth_tolerates_what_a_diagnosis_of_the_files_does():
    case = draw_case(CaseDraw(0, "clean"), quality="wild", seed=3, seconds=5.0)
    for logged in (LoggedInput("normalised", "sampled"), LoggedInput("command", "averaged")):
        quality = dc.replace(case.quality, rate=100.0)
        one = dc.replace(case, quality=quality, input=logged)
        truth = GroundTruth.of(one, *fly_case(one, "drake"))
        flights = [pair.measured for pair in truth.flights.values()]
        dut = truth.stated_tolerance()
        assert (dut.mass, dut.thrust >= 0.0173) == (0.0173, True)
        assert dut.timing == pytest.approx(0.01 / np.sqrt(12), rel=0.05)
        assert (dut.thrust, dut.throttle_curve > 0) == (
            (0.5, True) if logged.kind == "normalised" else (0.0173, False)
        )
        real = dc.replace(truth, case=dc.replace(one, quality=SensorQuality("real")))
        assert real.stated_tolerance() == tolerance_of(flights)


def test_a_third_of_the_out_of_library_cases_have_two_at_once():
    dut, before = compose(200, 30, 0, two=TWO_AT_ONCE), compose(200, 30, 0)
    foreign = [draw.names for draw in dut if draw.kind == "foreign"]
    assert len(foreign) == 30
    assert sum(len(set(names)) == 2 for names in foreign) == 10
    assert all(len(draw.names) == 1 for draw in before if draw.kind == "foreign")
    assert [draw.kind for draw in dut].count("single") == 100


def test_a_late_sample_is_the_second_command_of_its_row():
    t = np.arange(0.0, 3.0, 0.02)
    dut = LoggedInput(semantics="sampled", late=1)
    fine = dut.instants(t)
    np.testing.assert_allclose(fine[::FINER], t)
    np.testing.assert_allclose(np.diff(fine), 0.01)
    log = counted(fine)
    assert np.array_equal(
        as_logged(log, dut.semantics, dut.finer, dut.late).u[:, 0], fine[1::FINER]
    )


def counted(t):
    """A log at rest whose commands are their own times."""
    three, four = np.zeros((len(t), 3)), np.tile(t[:, None], (1, 4))
    return FlightLog(t, three, four, three, three, four)


@pytest.mark.parametrize("kind", INPUTS)
def test_a_file_is_read_with_the_input_that_was_drawn(kind, vehicle, plan, t, tmp_path):
    log = with_input(fly(vehicle, plan, t=t), vehicle, kind)
    write_log(log, tmp_path / "flight.csv")
    assert open_flights(tmp_path / "flight.csv", vehicle=vehicle)[0][0].input == kind


def flown(logged):
    """A clean wild case at 100 Hz with that input: its noisy log, noise floor and visibility in one
    flight.
    """
    case = draw_case(CaseDraw(0, "clean"), quality="wild", seed=3, seconds=5.0)
    quality = dc.replace(case.quality, rate=100.0, rotor=abs(case.quality.rotor))
    case = dc.replace(case, quality=quality, input=logged)
    exact, noisy = (logs[FILES[0]] for logs in fly_case(case, "drake"))
    flight = FlightPair.of(case, FILES[0], exact, noisy)
    return noisy, flight.noise, GroundTruth(case, {FILES[0]: flight}).visibility(FILES[0])


@pytest.mark.parametrize(
    "kind, semantics", [("thrust_only", "sampled"), ("rotor_speed", "averaged")]
)
def test_what_a_file_does_not_tell_is_no_gap(kind, semantics):
    noisy, noise, visibility = flown(LoggedInput(kind, semantics))
    assert noisy.input == kind
    assert visibility == pytest.approx(1.0, abs=0.05)  # nothing acts: no gap but noise
    assert (noise[3:6] == 0).all() == (kind == "thrust_only")


def test_the_truth_knows_when_commands_act():
    (held, floor, _), (late, same, _) = (flown(LoggedInput("command", s)) for s in SEMANTICS[:2])
    assert np.array_equal(held.u[:-1][np.diff(held.t) < 0.015], late.u[1:][np.diff(held.t) < 0.015])
    np.testing.assert_allclose(same, floor, rtol=1e-12)


def test_the_same_seed_writes_the_same_files_and_they_can_be_read(tmp_path):
    options = {"quality": "wild", "cases": 1, "clean": 1, "seconds": 5.0, "seed": 3}
    for name in ("one", "other"):
        make(tmp_path / name / "cases", tmp_path / name / "truth", **options)
    files = sorted(path for path in (tmp_path / "one").rglob("*.*") if path.is_file())
    sheets = [path for path in files if path.name.endswith(SUFFIX)]
    assert len(files) - len(sheets) == 2 * (len(FILES) + 2)
    for path in files:
        assert (
            path.read_bytes()
            == (tmp_path / "other" / path.relative_to(tmp_path / "one")).read_bytes()
        )
    for folder in (tmp_path / "one" / "cases").iterdir():
        _, train, held_out = open_case(folder)
        truth = json.loads((tmp_path / "one" / "truth" / folder.name / "truth.json").read_text())
        assert {log.input for log in [*train, *held_out]} == {truth["sensors"]["input"]}
        assert truth["quality"] == "wild"
        assert len(truth["within_tolerance"]) == len(truth["effects"])
        stated = {log.timing for log in [*train, *held_out]}
        held = (
            truth["sensors"]["semantics"] == "held_after"
            or truth["sensors"]["input"] == "rotor_speed"
        )
        assert (stated == {0.0}) == held
        assert max(stated) <= 0.5 / truth["sensors"]["rate"] + 1e-4
        assert RATES[0] <= truth["sensors"]["rate"] <= RATES[1]
