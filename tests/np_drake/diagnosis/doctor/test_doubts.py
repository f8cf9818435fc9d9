"""What stands against any answer from a flight: laws that fail, and a large share of the weight."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.doctor.examine import examine
from np_drake.diagnosis.doctor.flight_facts import flight_facts, law_doubts
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle


@pytest.fixture(scope="module")
def log(fly):
    return fly(seed=1, noise=1.0)


def test_conventions_that_contradict_each_other_fail(log):
    for wrong in (
        dc.replace(log, v=log.v * [1.0, -1.0, 1.0]),
        dc.replace(log, q=log.q * [1.0, -1.0, -1.0, -1.0]),
    ):
        (dut,) = (doubt for doubt in law_doubts(wrong) if "contradict" in doubt.what)
        assert dut.fails
    assert not examine([wrong], Vehicle()).usable


@pytest.mark.parametrize("factor, axis", [(1.45, "z"), (0.6, "z")])
def test_a_residual_above_a_quarter_of_the_weight_is_the_first_line(log, factor, axis):
    heavy = dc.replace(Vehicle(), mass=factor * Vehicle().mass)
    dut = examine([log], heavy)
    assert f"% of the weight along body {axis}: check mass" in dut.problems[0]
    assert "misses" in dut.problems[0]


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


def test_a_gap_is_counted(log):
    keep = np.r_[0:300, 308 : len(log)]
    names = ("t", "p", "q", "v", "w", "u", "a")
    cut = dc.replace(log, **{name: getattr(log, name)[keep] for name in names})
    assert flight_facts(cut).gaps == 1
    assert flight_facts(log).gaps == 0
