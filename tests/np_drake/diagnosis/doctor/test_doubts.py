"""What stands against any answer from a flight: laws that fail, and a large share of the weight."""

import dataclasses as dc
import re

import numpy as np
import pytest

from np_drake.diagnosis.doctor.examine import examine
from np_drake.diagnosis.doctor.flight_facts import flight_facts, law_findings
from np_drake.finding import Kind
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle


@pytest.fixture(scope="module")
def log(fly):
    return fly(seed=1, noise=1.0)


def test_conventions_that_contradict_each_other_fail(log):
    for wrong in (
        dc.replace(log, v=log.v * [1.0, -1.0, 1.0]),
        dc.replace(log, q=log.q * [1.0, -1.0, -1.0, -1.0]),
    ):
        (dut,) = (doubt for doubt in law_findings(wrong) if "contradict" in doubt.text)
        assert dut.kind is Kind.CONTRADICTION
    assert not examine([wrong], Vehicle()).usable


@pytest.mark.parametrize("factor", [1.45, 0.6])
def test_a_residual_above_a_quarter_of_the_weight_is_the_first_line(log, factor):
    dut = examine([log], dc.replace(Vehicle(), mass=factor * Vehicle().mass))
    assert re.search("misses .*% of the weight along body z: check mass", str(dut.problems[0]))


def test_white_noise_is_that_of_the_sensors(log):
    white, usual = {s.name: s.white for s in flight_facts(log).signals}, MeasurementNoise()
    known = {"position": usual.position, "velocity": usual.velocity, "body rates": usual.rate}
    known["acceleration"] = usual.acceleration
    # 30 %: the motion itself has second differences
    assert {name: white[name] for name in known} == pytest.approx(known, rel=0.3)


def test_rotors_at_their_limit_are_counted_with_a_vehicle_alone(fly):
    log = fly()
    weak = dc.replace(Vehicle(), max_rotor_thrust=4.95)
    assert flight_facts(log).saturated is None
    assert flight_facts(log, Vehicle()).saturated == 0.0
    assert flight_facts(log, weak).saturated > 0.2


def test_a_gap_is_counted(log):
    keep = np.r_[0:300, 308 : len(log)]
    names = ("t", "p", "q", "v", "w", "u", "a")
    cut = dc.replace(log, **{name: getattr(log, name)[keep] for name in names})
    assert flight_facts(cut).gaps == 1
    assert flight_facts(log).gaps == 0
