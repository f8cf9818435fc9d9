"""Laws of the next motion: limits kept, arms by name, blind where nothing is told."""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.challenge.active.next_motion import ARMS, BLIND, InChallenge, Room, next_motion
from np_drake.diagnosis.numerics import NoiseModel, Readings
from np_drake.diagnosis.tolerance import Tolerance
from np_drake.flight_design.design import DESIGNED

ROOM = Room(seconds=5.0, evaluations=8)
RMS = np.repeat([0.5, 0.05, 0.05, 0.2, 0.05], 3)
READINGS = Readings(NoiseModel(np.zeros((15, 1)), np.diag(1 / RMS), RMS, RMS**2, 0.02), Tolerance())


@pytest.fixture(scope="module")
def answer(answered):
    found = answered(0.5, 0.5)
    return dc.replace(found, diagnosis=dc.replace(found.diagnosis, readings=READINGS))


@pytest.fixture(scope="module")
def designed(answer):
    return next_motion(DESIGNED, answer, ROOM, 1)


@pytest.mark.parametrize("arm", [arm for arm in ARMS if arm != DESIGNED])
def test_a_naive_motion_keeps_the_limits_as_planned(answer, arm):
    dut, t = next_motion(arm, answer, ROOM, 1), np.linspace(0.0, ROOM.seconds, 251)
    assert dut.name == arm
    assert max(dut.limits.usage(t, dut.reference.sample(t)).values()) <= 0.85


def test_the_design_keeps_its_limits_in_the_simulator_under_every_explanation(designed):
    assert designed.name == DESIGNED
    assert 0.3 < designed.simulated <= 1.0
    assert 0.0 < designed.design < 30.0
    assert designed.entropy < np.log(2)


def test_a_motion_that_is_too_fast_is_made_smaller_or_refused(answer, designed, monkeypatch):
    flown = InChallenge.__call__

    def thrice(self, candidate, explanation):
        found = flown(self, candidate, explanation)
        return dc.replace(found, usage={name: 100 * used for name, used in found.usage.items()})

    monkeypatch.setattr(InChallenge, "__call__", thrice)
    with pytest.raises(ValueError, match="no motion keeps them with controller cascade"):
        next_motion(DESIGNED, answer, ROOM, 1)


def test_without_explanations_the_flight_is_blind(answered):
    assert next_motion(DESIGNED, answered(0.0, 0.0), ROOM, 1).name == BLIND


@pytest.mark.parametrize("wrong", [{"box": (0.5, 4.0, 2.5)}, {"speed": 0.0}, {"tilt": 2.0}])
def test_an_impossible_room_is_refused(wrong):
    with pytest.raises(ValueError, match=r"limits: (box|speed)"):
        Room(**wrong).check()
    assert Room().check() == Room()
