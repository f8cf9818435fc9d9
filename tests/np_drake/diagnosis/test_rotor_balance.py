"""Laws of the balance of rotors whose inputs are too slow to tell torque."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.options import Options
from np_drake.diagnosis.rotor_balance import compare_balance, flight_balance, torque_map
from np_drake.flight_log import FlightLog
from np_drake.logs.inputs import hover_exponent
from np_drake.vehicle import load_vehicle

VEHICLE = load_vehicle("x500")
REAL = Options.for_sensors(True)
SCATTER = 0.005  # of a rotor's input from flight to flight [1]


def flown(name: str, relative=(0.0, 0.0, 0.0, 0.0), seed: int = 0) -> FlightLog:
    """A flight of 30 s in which rotors are asked for e^relative more thrust than in hover."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 30.0, 0.04)
    own = np.array(relative) + SCATTER * rng.normal(size=4) + 0.05 * rng.normal(size=(len(t), 4))
    still = np.zeros((len(t), 3))
    return FlightLog(
        t=t,
        p=still,
        v=still,
        w=still,
        q=np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1)),
        u=np.full((len(t), 4), np.nan),
        balance=np.exp(own / hover_exponent(VEHICLE)),
        input="normalised",
        name=name,
    )


SOUND = [flown(f"sound {i}", seed=i) for i in range(2)]


def lost(rotor: int, share: float) -> list[FlightLog]:
    """Two flights in which one rotor has lost this share of its thrust."""
    more = -np.log(1 - share) * np.eye(4)[rotor - 1]
    return [flown(f"lost {i}", more, seed=10 + i) for i in range(2)]


@pytest.mark.parametrize("rotor", [1, 2, 3, 4])
def test_a_rotor_that_lost_thrust_is_named_with_its_loss(rotor):
    (cause,) = compare_balance(SOUND, lost(rotor, 0.2), VEHICLE, REAL).causes
    low, high = cause.parameters["efficiency"].ci95
    assert cause.changed
    assert cause.parameters["rotor"].value == rotor
    assert low < 0.8 < high


def test_losses_rise_with_what_was_lost():
    found = [
        compare_balance(SOUND, lost(2, share), VEHICLE, REAL).causes[0].parameters["efficiency"]
        for share in (0.15, 0.25, 0.4)
    ]
    assert found[0].value > found[1].value > found[2].value


@pytest.mark.parametrize("seed", range(8))
def test_sound_flights_name_nothing_and_say_what_would_show(seed):
    after = [flown(f"after {i}", seed=100 + 2 * seed + i) for i in range(2)]
    found = compare_balance(SOUND, after, VEHICLE, REAL)
    assert not found.causes
    assert 0.02 < found.visible["weak_rotor.efficiency"] < 0.3


def test_a_centre_of_mass_that_moved_is_no_rotor():
    roll = 0.1 * np.sign(torque_map(VEHICLE)[0])
    after = [flown(f"moved {i}", roll, seed=20 + i) for i in range(2)]
    assert not compare_balance(SOUND, after, VEHICLE, REAL).causes


@pytest.mark.parametrize("rotor", [1, 2, 3, 4])
def test_a_rotor_that_gives_more_than_before_makes_no_other_weak(rotor):
    assert not compare_balance(lost(rotor, 0.2), SOUND, VEHICLE, REAL).causes


def test_rows_in_which_a_rotor_stands_or_is_not_read_do_not_count():
    (log, *_) = SOUND
    worse = log.balance.copy()
    worse[100:200, 0], worse[300, 2] = -1.0, np.nan
    found = flight_balance(dc.replace(log, balance=worse), VEHICLE)
    np.testing.assert_allclose(found, flight_balance(log, VEHICLE), atol=0.02)
    assert flight_balance(dc.replace(log, balance=0.0 * worse), VEHICLE) is None


def test_flights_without_a_balance_tell_nothing():
    bare = [dc.replace(log, balance=None) for log in SOUND]
    assert flight_balance(bare[0], VEHICLE) is None
    assert not compare_balance(bare, lost(1, 0.3), VEHICLE, REAL).causes
    assert flight_balance(SOUND[0].rows(0, 50), VEHICLE) is None  # 2 s
