"""What stands against any answer from a flight: laws that fail, and a large share of the weight."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake import attitude
from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.doctor.examine import examine
from np_drake.diagnosis.doctor.flight_facts import doubts, law_doubts
from np_drake.diagnosis.report.answer import warnings
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.vehicle import Vehicle

GRAVITY = np.array([0.0, 0.0, 9.81])


@pytest.fixture(scope="module")
def log(fly):
    return fly(seed=1, noise=1.0)


def heading_alone(log):
    """Return the log with the roll and pitch of a planar odometry, which are none."""
    w, x, y, z = log.q.T
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    o = np.zeros(len(log))
    return dc.replace(log, q=np.stack([np.cos(0.5 * yaw), o, o, np.sin(0.5 * yaw)], axis=1))


def test_a_flight_of_its_vehicle_has_no_doubts(log):
    assert doubts(make_flight_residuals(log, Vehicle())) == []


def test_conventions_that_contradict_each_other_fail(log):
    for wrong in (
        dc.replace(log, v=log.v * [1.0, -1.0, 1.0]),
        dc.replace(log, q=log.q * [1.0, -1.0, -1.0, -1.0]),
    ):
        (dut,) = (doubt for doubt in law_doubts(wrong) if "contradict" in doubt.what)
        assert dut.fails
    assert not examine([wrong], Vehicle()).usable


def test_a_planar_pose_is_named_and_makes_the_flight_useless(log):
    (dut,) = law_doubts(heading_alone(log))
    assert dut.fails
    assert "the attitude never tilts (0 mrad) where the vehicle accelerates sideways" in dut.what
    report = examine([heading_alone(log)])
    assert not report.usable
    assert report.problems[0] == f"{log.name}: {dut.what}"


def test_a_gyro_that_drifts_about_one_axis_is_said_and_stays_askable(log):
    drift = np.outer(
        np.sin(2.1 * log.t), [0.0, 0.0, 0.9]
    )  # as large as the turns about that axis [rad/s]
    drifting = dc.replace(log, w=log.w + drift)
    (dut,) = law_doubts(drifting)
    assert not dut.fails
    assert "attitude z" in dut.what
    report = examine([drifting], Vehicle())
    assert f"{log.name}: {dut.what}" in report.problems
    assert report.usable
    assert report.of("gyro_bias")


def test_a_pose_on_another_clock_is_said_with_its_remedy(log):
    late = dc.replace(log.rows(0, len(log) - 6), t=log.t[6:], w=log.w[6:], u=log.u[6:])
    late.a = attitude.rotate(late.q, attitude.rotate_back(log.q, log.a + GRAVITY)[6:]) - GRAVITY
    report = examine([late], Vehicle())
    (line,) = (line for line in report.problems if "clocks" in line)
    assert line.startswith(f"{log.name}: attitude +60 ms after body rates, velocity +")
    assert line.endswith("np-drake import takes that out")
    assert report.usable


@pytest.mark.parametrize("factor, axis", [(1.45, "z"), (0.6, "z")])
def test_a_residual_above_a_quarter_of_the_weight_is_the_first_line(log, factor, axis):
    heavy = dc.replace(Vehicle(), mass=factor * Vehicle().mass)
    dut = examine([log], heavy)
    assert f"% of the weight along body {axis}: check mass" in dut.problems[0]
    assert "misses" in dut.problems[0]


def test_torque_that_does_not_turn_the_vehicle_makes_it_useless(log):
    against = dc.replace(log, u=log.u * [1.0, 1.0, -1.0, 1.0])
    dut = examine([against], Vehicle())
    assert not dut.usable
    assert any(
        "torque about body y goes against J dw/dt (correlation -" in line for line in dut.problems
    )
    large = dc.replace(Vehicle(), inertia=(5 * Vehicle().J).tolist())
    dut = examine([log], large)
    assert not dut.usable
    assert any("torque about body x is not what turns the vehicle" in line for line in dut.problems)


def test_a_diagnosis_says_the_doubts_of_its_flights_before_the_answer(fly, log):
    heavy, other = (
        dc.replace(Vehicle(), mass=1.45 * Vehicle().mass),
        dc.replace(fly(seed=2, noise=1.0), name="other"),
    )
    dut = diagnose(heavy, [dc.replace(log, bridged=np.arange(len(log)) % 100 == 50)], [other])
    assert "in gaps of up to 0.1 s of 1 of 2 flights were filled in" in warnings(dut)[-1]
    (line,) = (line for line in dut.doubts if "of the weight along body z" in line)
    assert line.startswith(f"{log.name}: ") or line.startswith(f"{log.name}, other: ")
    assert dut.as_json()["doubts"] == list(dut.doubts)
