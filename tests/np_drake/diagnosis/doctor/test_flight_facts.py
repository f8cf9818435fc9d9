"""Laws of the facts of a flight: noise and limits are those put in."""

import dataclasses as dc

import pytest

from np_drake.diagnosis.doctor.flight_facts import flight_facts
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle


def signal(facts, name):
    return next(s for s in facts.signals if s.name == name)


def test_white_noise_is_that_of_the_sensors(fly):
    dut = flight_facts(fly(noise=1.0))
    usual = MeasurementNoise()
    # 30 %: the motion itself has second differences
    assert signal(dut, "position").white == pytest.approx(usual.position, rel=0.3)
    assert signal(dut, "velocity").white == pytest.approx(usual.velocity, rel=0.3)
    assert signal(dut, "body rates").white == pytest.approx(usual.rate, rel=0.3)
    assert signal(dut, "acceleration").white == pytest.approx(usual.acceleration, rel=0.3)


def test_rotors_at_their_limit_are_counted_with_a_vehicle_alone(fly):
    log = fly()
    weak = dc.replace(Vehicle(), max_rotor_thrust=4.95)
    assert flight_facts(log).saturated is None
    assert flight_facts(log, Vehicle()).saturated == 0.0
    assert flight_facts(log, weak).saturated > 0.2
