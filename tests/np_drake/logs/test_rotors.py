"""Order and directions of the rotors, by what turns the vehicle."""

import dataclasses as dc
import itertools
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from np_drake.finding import Kind
from np_drake.flight_log import FlightLog
from np_drake.logs.errors import LogError
from np_drake.logs.rotors import in_vehicle_order, tell_directions, torque_agreement
from np_drake.vehicle.rotor_layout import directions_of
from np_drake.vehicle.vehicle import Vehicle, load_vehicle, preset_names

STEP, SECONDS = 0.01, 8.0


def turning(vehicle: Vehicle, noise: float = 0.5, seed: int = 1, spin: float = 0.0) -> FlightLog:
    """Return a hovering flight that rocks about every axis, with rotor speed; noise: of torque over
    what turns it; spin: about z, with precession [rad/s].
    """
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, SECONDS, STEP)
    waves = [(f, *rng.uniform(0, 2 * np.pi, 3)) for f in (0.9, 1.7, 2.6, 4.1)]
    w = sum(0.3 * np.sin(2 * np.pi * f * t[:, None] + np.array(phase)) for f, *phase in waves)
    w = w + spin * np.column_stack([0.2 * np.cos(6 * t), 0.2 * np.sin(6 * t), np.ones(len(t))])
    torque = np.gradient(w, STEP, axis=0) @ vehicle.J.T + np.cross(w, w @ vehicle.J.T)
    torque += noise * torque.std(axis=0) * rng.normal(size=torque.shape)
    u = np.column_stack([np.full(len(t), vehicle.mass * vehicle.gravity), torque])
    rotor = np.sqrt(np.maximum(u @ vehicle.unmixer.T, 0.0) / vehicle.thrust_coefficient)
    q = np.column_stack([np.ones(len(t)), np.zeros((len(t), 3))])
    still = np.zeros((len(t), 3))
    return FlightLog(
        t,
        still,
        q,
        still,
        w,
        np.full((len(t), 4), np.nan),
        rotor=rotor,
        name="made",
        input="rotor_speed",
    )


@pytest.mark.parametrize("name", preset_names())
def test_columns_of_every_order_are_put_into_that_of_the_file(name):
    vehicle = load_vehicle(name)
    log = turning(vehicle)
    assert in_vehicle_order([log], vehicle)[0].notes == []
    for order in [*itertools.permutations(range(4))][::5]:
        (dut,) = in_vehicle_order([dc.replace(log, rotor=log.rotor[:, order])], vehicle)
        np.testing.assert_array_equal(dut.rotor, log.rotor)
        assert [f.kind for f in dut.findings] == [Kind.ROTOR_ORDER] * (order != (0, 1, 2, 3))


def test_rotors_that_turn_otherwise_than_in_the_file_are_refused():
    log = turning(load_vehicle("crazyflie"))
    wrong = dc.replace(load_vehicle("crazyflie"), rotor_directions=[1.0, -1.0, 1.0, -1.0])
    with pytest.raises(
        LogError, match=r"^made: rotor_positions and rotor_directions of vehicle 'crazyflie'"
    ) as error:
        in_vehicle_order([log], wrong)
    assert "front right (ccw), rear right (cw), rear left (ccw), front left (cw)" in str(
        error.value
    )
    assert "\n" not in str(error.value)


def test_what_is_flown_after_a_motor_failed_tells_no_order():
    vehicle = Vehicle()
    sound, failed = turning(vehicle), turning(vehicle, spin=25.0)
    failed = dc.replace(failed, rotor=failed.rotor[:, [1, 0, 3, 2]])  # as no order of the flight
    both = {
        name: np.concatenate([getattr(sound, name), getattr(failed, name)])
        for name in ("p", "q", "v", "w", "u", "rotor")
    }
    log = dc.replace(sound, t=np.arange(2 * len(sound)) * STEP, **both)
    (dut,) = in_vehicle_order([log], vehicle)
    assert dut.notes == []


def on_a_turned_board(log: FlightLog, angle: float) -> FlightLog:
    """Return the log of a board whose axes are turned to the left of the body's [deg]."""
    R = Rotation.from_euler("z", angle, degrees=True)
    q = Rotation.from_quat(np.roll(log.q, -1, axis=1)) * R
    return dc.replace(log, w=R.inv().apply(log.w), q=np.roll(q.as_quat(), 1, axis=1))


@pytest.mark.parametrize("name", ["paper", "crazyflie", "x500", "neurobem"])
@pytest.mark.parametrize("angle", [90, -90])
def test_a_board_turned_by_a_right_angle_is_found_and_turned_back(name, angle):
    vehicle = load_vehicle(name)
    log = turning(vehicle)
    (dut,) = in_vehicle_order([on_a_turned_board(log, angle)], vehicle)
    np.testing.assert_array_equal(dut.rotor, log.rotor)
    np.testing.assert_allclose(dut.w, log.w, atol=1e-12)
    np.testing.assert_allclose(dut.q, log.q, atol=1e-12)
    assert f"board_turn: {angle} in a map" in dut.notes[0]


def test_a_board_turned_round_is_an_order_of_its_columns_and_said():
    vehicle = load_vehicle("crazyflie")
    log = turning(vehicle)
    (dut,) = in_vehicle_order([on_a_turned_board(log, 180)], vehicle)
    np.testing.assert_array_equal(dut.rotor, log.rotor[:, [2, 3, 0, 1]])
    assert "or the board is turned: board_turn: 180 in a map" in dut.notes[0]


@pytest.mark.parametrize("flown, filed", itertools.product(("in", "out"), repeat=2))
def test_propellers_that_turn_the_other_way_are_named_with_what_mends_it(flown, filed):
    vehicle = load_vehicle("x500")
    own, file = (
        dc.replace(vehicle, rotor_directions=directions_of(vehicle.rotor_positions, props))
        for props in (flown, filed)
    )
    if flown == filed:
        assert in_vehicle_order([turning(own)], file)[0].notes == []
        return
    written = re.escape(str([int(d) for d in own.rotor_directions]))
    with pytest.raises(LogError, match=f"turn the other way.*{written}.*--props"):
        in_vehicle_order([turning(own)], file)


def test_flights_that_hardly_yaw_do_not_tell_the_way_that_propellers_turn():
    vehicle = load_vehicle("crazyflie")
    log = turning(vehicle)
    assert tell_directions([log], vehicle)
    assert tell_directions([dc.replace(log, rotor=None)], vehicle)  # nothing to turn
    u = vehicle.thrust_coefficient * log.rotor**2 @ vehicle.mixer.T
    u[:, 3] = u[:, 3].std() * np.random.default_rng(3).normal(size=len(u))
    rotor = np.sqrt(np.maximum(u @ vehicle.unmixer.T, 0.0) / vehicle.thrust_coefficient)
    assert not tell_directions([dc.replace(log, rotor=rotor)], vehicle)


def test_a_throttle_of_each_rotor_tells_its_order_behind_the_motors_lag():
    own = load_vehicle("crazyflie")
    log = turning(own, noise=0.2)
    late = np.roll(log.rotor, -4, axis=0) / 3000.0  # commanded 40 ms before it acts
    turned = dc.replace(log, rotor=None, throttle=late[:, [1, 2, 3, 0]], input="normalised")
    (dut,) = in_vehicle_order([turned], own)
    np.testing.assert_array_equal(dut.throttle, late)


TURNED = [3, 0, 1, 2]


def gentle(vehicle: Vehicle) -> FlightLog:
    """Return a flight that does not tell the order of its rotors by itself."""
    return dc.replace(turning(vehicle, noise=10.0, seed=2).rows(0, 400), name="gentle")


def turned(log: FlightLog, order: list[int]) -> FlightLog:
    return dc.replace(log, rotor=log.rotor[:, order])


def test_a_gentle_part_of_a_log_takes_the_order_of_its_lively_part():
    own = load_vehicle("crazyflie")
    parts = [turning(own), gentle(own)]
    assert in_vehicle_order([turned(parts[1], TURNED)], own)[0].notes == []
    dut = in_vehicle_order([turned(log, TURNED) for log in parts], own)
    for log, part in zip(dut, parts, strict=True):
        np.testing.assert_array_equal(log.rotor, part.rotor)
        assert log.findings[0].kind is Kind.ROTOR_ORDER


def test_torque_of_another_size_keeps_its_correlation_and_tells_the_factor():
    own = load_vehicle("crazyflie")
    log = turning(own, noise=0.0)
    u = (own.thrust_coefficient * log.rotor**2) @ own.mixer.T
    correlation, ratio = torque_agreement(dc.replace(log, u=0.25 * u), own)
    np.testing.assert_allclose(correlation, 1.0, atol=0.01)  # filters and differences
    np.testing.assert_allclose(ratio, 4.0, rtol=0.02)


@pytest.mark.parametrize("moves", [False, True])
def test_a_controller_that_answers_noise_tells_nothing_where_nothing_moves(moves):
    own = load_vehicle("crazyflie")
    log = turning(own)
    w = log.w * moves
    torque = np.gradient(w, STEP, axis=0) @ own.J.T + np.cross(w, w @ own.J.T)
    noise = 0.01 * np.random.default_rng(2).normal(size=w.shape)  # [rad/s]
    answer = (
        -4.0 * np.roll(noise, 4, axis=0) @ own.J.T
    )  # 40 ms late: in phase with the derivative at 6 Hz
    read = dc.replace(log, w=w + noise, u=np.column_stack([np.ones(len(log)), torque + answer]))
    correlation, ratio = torque_agreement(read, own)
    np.testing.assert_allclose(
        correlation, 1.0 if moves else np.nan, atol=0.02
    )  # filters, differences
    assert moves or np.all(ratio > 3.0)
