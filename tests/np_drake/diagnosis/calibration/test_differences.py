"""Laws of what the calibration says of a vehicle and its flights."""

import dataclasses as dc

import pytest

from np_drake.diagnosis.calibration import calibration_effects, differences
from np_drake.diagnosis.options import Options
from np_drake.effects.attitude_bias import AttitudeBias
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.combine import mass_properties, split_effects
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.estimation.priors import HEALTHY

REAL = Options.for_sensors(True)
TILT = 0.03  # of the attitude in one of the flights [rad]
SENSORS = {"noise": 1.0, "attitude_noise": 0.005, "seconds": 8.0}


@pytest.fixture(scope="module")
def found(seen, inferred):
    rotor = WeakRotor(2.0, 0.94)
    train = [
        seen(rotor, name="a", seed=1, **SENSORS),
        seen(rotor, AttitudeBias(TILT), name="b", seed=2, **SENSORS),
    ]
    return inferred(train, [seen(rotor, name="c", seed=3, **SENSORS)], REAL)


@pytest.fixture(scope="module")
def dut(found):
    return differences(
        found.ranking.best, found.ranking.problem.flights, found.ranking.options.tolerance
    )


def test_the_largest_in_deviations_of_healthy_vehicles_comes_first(dut):
    sizes = [d.in_deviations for d in dut]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[0] > 1.0


def test_a_tilt_of_one_flight_names_that_flight(dut):
    (tilt,) = (d for d in dut if d.name == "attitude_bias.roll")
    assert tilt.text.endswith(
        f"° of roll in {max(tilt.by_flight, key=lambda name: abs(tilt.by_flight[name]))}"
    )
    # two sigma [rad]
    assert tilt.by_flight["b"] - tilt.by_flight["a"] == pytest.approx(TILT, abs=0.01)


HEALTHY = (WeakRotor(1.0, 1 - HEALTHY.rotor_gain), BladeFlapping(0.05))


def flown(seen, *effects):
    return [seen(*effects, name=n, seed=i, **SENSORS) for i, n in enumerate("abc", start=1)]


@pytest.fixture(scope="module")
def healthy(seen, inferred):
    *train, held_out = flown(seen, *HEALTHY)
    return inferred(train, [held_out], REAL)


def test_a_healthy_vehicle_has_no_cause(healthy):
    assert healthy.causes == []


def test_calibration_is_in_the_corrected_simulator(healthy):
    effects = calibration_effects(
        healthy.ranking.best, healthy.ranking.problem.flights[0], healthy.ranking.options.tolerance
    )
    gains = {e.rotor: e.efficiency for e in effects if isinstance(e, WeakRotor)}
    assert len(gains) == 4
    assert gains[1.0] < min(gains[i] for i in (2.0, 3.0, 4.0))  # the only one that is weak
    assert not any(e.place == "measurement" or e.shifts_commands for e in effects)


@pytest.mark.parametrize("share", [(0.5, 0.6, 1.0), (1.0, 1.0, 0.05)], ids=str)
def test_the_simulator_shows_the_share_of_torque_that_the_flights_show(healthy, share):
    def moments(of):
        e = dc.replace(healthy.ranking.problem.flights[0], torque_gain=of)
        effects = calibration_effects(healthy.ranking.best, e, healthy.ranking.options.tolerance)
        return mass_properties(e.vehicle, split_effects(effects).mass).J.diagonal()

    dut = moments(share)
    assert 2 * dut.max() < dut.sum()
    shown = moments((1.0, 1.0, 1.0)) / dut
    assert shown[:2] == pytest.approx(share[:2])
    assert shown[2] == pytest.approx(share[2]) or shown[2] > share[2]  # as a rigid body has it
