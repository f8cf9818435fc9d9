"""Laws of the examination: what a log can and cannot tell, with and without a vehicle, and on real
flights.
"""

import dataclasses as dc
import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from np_drake.diagnosis.doctor.examine import examine
from np_drake.diagnosis.doctor.smallest_sizes import _drag
from np_drake.effects.library import LIBRARY, effects_for, unobservable
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.flight_log import FlightLog
from np_drake.logs.opening import open_flights
from np_drake.rotor_input import rotor_speed, with_rotor_input
from np_drake.vehicle import Vehicle

ARM = 0.0325  # of a Crazyflie 2.1 brushless along x and y [m]


def crazyflie(mass: float) -> Vehicle:
    """Return the vehicle of the real flights; mass [kg]."""
    return Vehicle(
        name="crazyflie",
        mass=mass,
        inertia=np.diag([1.9e-5, 1.9e-5, 3.2e-5]).tolist(),
        rotor_positions=[[ARM, -ARM, 0], [-ARM, -ARM, 0], [-ARM, ARM, 0], [ARM, ARM, 0]],
        rotor_directions=[-1.0, 1.0, -1.0, 1.0],
        thrust_coefficient=3.704e-8,
        torque_coefficient=0.006 * 3.704e-8,
        rotor_radius=0.025,
        max_rotor_thrust=0.25,
        input="rotor_speed",
    ).check()


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


def test_a_moving_flight_tells_drag_and_mass_beside_nothing_that_swings(report):
    assert report.usable
    assert report.problems == ()
    assert not report.something_swings
    assert {a.verdict for a in report.of("linear_drag")} == {"yes"}
    assert {a.verdict for a in report.of("inertia_error")} == {"yes"}


def test_a_hovering_flight_is_not_usable_and_says_so(fly):
    dut = examine([fly(vigour=0.0, noise=1.0)], Vehicle())
    assert not dut.usable
    assert "nothing moves (speed 0.0" in dut.problems[0]
    assert {a.verdict for a in dut.of("linear_drag")} == {"no"}


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
    assert dut.swings == ()
    assert dut.usable
    assert "no vehicle file" in dut.problems[-1]
    assert dut.flights[0].signals


def test_contradicting_conventions_are_not_judged(log):
    dut = examine([dc.replace(log, v=log.v * [1.0, -1.0, 1.0])], Vehicle())
    assert not dut.usable
    assert "contradict" in dut.problems[0]
    assert dut.answers == ()


def test_more_flights_tell_no_less(fly, log, report):
    both = examine([log, fly(seed=2, noise=1.0, name="b")], Vehicle())
    for name in ("linear_drag", "inertia_error", "rotor_gyroscopic"):
        for one, two in zip(report.of(name), both.of(name), strict=True):
            assert two.alone < one.alone


def test_the_report_is_plain_json(report):
    content = json.loads(json.dumps(report.as_json()))
    assert content["something_swings"] is False
    assert len(content["answers"]) == len(report.answers)


def test_flights_of_one_name_or_of_two_kinds_are_refused(log):
    with pytest.raises(ValueError, match="different names"):
        examine([log, log])
    with pytest.raises(ValueError, match="same input"):
        examine([log, dc.replace(log, name="b", input="thrust_only")])
    with pytest.raises(ValueError, match="at least one flight"):
        examine([])


def test_a_payload_in_a_simulated_flight_swings(fly):
    dut = examine([fly(SuspendedPayload(0.15, 0.8), seed=1, noise=1.0)], Vehicle())
    assert dut.something_swings
    assert dut.of("suspended_payload")[0].smallest < 0.15  # kg


@pytest.mark.parametrize("flight", ["bare/eckart00", "bare/eckart13", "bare/eckart26"])
def test_a_real_flight_without_payload_does_not_swing(real_flights, flight):
    assert not real(real_flights / "imrc" / flight, 0.037).something_swings


@pytest.mark.parametrize(
    "flight", ["payload/eckart06", "payload/eckart18", "payload/eckart46", "payload/eckart71"]
)
def test_a_real_flight_with_a_payload_swings(real_flights, flight):
    dut = real(real_flights / "imrc" / flight, 0.0397)
    assert dut.something_swings
    assert (
        0.43 <= dut.swings[0].length <= 0.57
    )  # m; the string is 0.517 m, and lengths are 9 % apart
    assert dut.swings[0].mass == pytest.approx(0.0047, rel=0.3)  # kg
    assert dut.of("suspended_payload")[0].verdict == "yes"


def test_a_real_flight_in_wind_does_not_swing(real_flights):
    vehicle = dc.replace(Vehicle(), mass=2.53, max_rotor_thrust=15.0, input="normalised").check()
    flights, sheet = open_flights(
        real_flights / "neural_fly" / "custom_figure8_baseline_100wind.csv.gz", vehicle
    )
    dut = examine(flights, vehicle, sheets={flights[0].name: sheet.content})
    assert not dut.something_swings
    assert dut.of("mass_error")[0].verdict == "never"
    assert dut.of("constant_wind")[0].verdict in ("yes", "no")


def real(path, mass):
    vehicle = crazyflie(mass)
    flights, sheet = open_flights(path, vehicle)
    return examine(flights, vehicle, sheets={log.name: sheet.content for log in flights})


def test_a_drag_is_the_mean_of_its_axes_by_their_precision():
    trace = SimpleNamespace(identifier="linear_drag", typical=[0.5], columns={})
    found = _drag(np.array([1.0, 3.0, 9.0]), np.array([0.1, 0.2, 1.0]), [], [trace])
    assert found == pytest.approx(0.5 * (100 * 1.0 + 25 * 3.0) / 125)


def test_a_flight_that_stands_still_is_said_not_to_move_and_what_to_fly():
    t = 0.01 * np.arange(1000)
    rest, u = (
        np.zeros((len(t), 3)),
        np.tile([Vehicle().mass * Vehicle().gravity, 0, 0, 0], (len(t), 1)),
    )
    q, p = np.tile([1.0, 0, 0, 0], (len(t), 1)), np.tile([0.0, 0, 1.0], (len(t), 1))
    log = FlightLog(t, p, q, rest, rest, u, a=rest)
    for dut in (
        examine([log], Vehicle()),
        examine([dc.replace(log, a=None)], Vehicle()),
        examine([log]),
    ):
        assert not dut.usable
        assert any(
            "nothing moves (speed 0 m/s, rates 0 rad/s): fly sprints" in line
            for line in dut.problems
        )
