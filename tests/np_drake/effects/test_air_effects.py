import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake import attitude
from np_drake.effects.base import Motion
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.combine import total_wrench
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.ground_effect import GroundEffect
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.quadratic_drag import QuadraticDrag
from np_drake.effects.rotor_inflow import AIR_DENSITY, RotorInflow, induced_velocity
from np_drake.effects.translational_lift import TranslationalLift
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
HOVER = np.full(4, 2.0 * 9.81 / 4)
SEEDS = st.integers(0, 2**31)


def level(v=(0.0, 0.0, 0.0), height=1.0):
    return Motion(0.0, np.array([0, 0, height, 1.0, 0, 0, 0, *v, 0, 0, 0]), HOVER)


def any_motion(seed):
    rng = np.random.default_rng(seed)
    x = rng.normal(scale=3.0, size=13)
    x[3:7] /= np.linalg.norm(x[3:7])
    return Motion(0.0, x, rng.uniform(0, 12, 4), wind=rng.normal(scale=3.0, size=3))


def test_linear_drag_opposes_each_body_axis_with_its_coefficient():
    dut = LinearDrag(0.2, 0.3, 0.4)
    chi = dut.wrench(VEHICLE, level((1.0, -2.0, 3.0)))
    np.testing.assert_allclose(chi, [-0.2, 0.6, -1.2, 0, 0, 0], atol=1e-12)
    turned = level((1.0, 0.0, 0.0))
    turned.x[3:7] = [np.sqrt(0.5), 0, 0, np.sqrt(0.5)]  # yaw by 90 degrees: world x is body -y
    chi = dut.wrench(VEHICLE, turned)
    np.testing.assert_allclose(chi, [-0.3, 0, 0, 0, 0, 0], atol=1e-12)


def test_quadratic_drag_grows_with_the_square_and_opposes_each_axis():
    chi = QuadraticDrag(0.1, 0.2, 0.3).wrench(VEHICLE, level((2.0, -3.0, 1.0)))
    np.testing.assert_allclose(chi, [-0.4, 1.8, -0.3, 0, 0, 0], atol=1e-12)


@settings(max_examples=50, deadline=None)
@given(SEEDS)
def test_a_drag_only_takes_power_from_the_motion_through_the_air(seed):
    motion = any_motion(seed)
    for dut in (QuadraticDrag(0.1, 0.2, 0.3), LinearDrag(0.1, 0.2, 0.3)):
        assert dut.wrench(VEHICLE, motion)[:3] @ (motion.x[7:10] - motion.wind) <= 1e-12


@settings(max_examples=50, deadline=None)
@given(
    SEEDS,
    st.sampled_from([QuadraticDrag, LinearDrag, BladeFlapping, TranslationalLift, RotorInflow]),
)
def test_only_the_velocity_through_the_air_matters(seed, effect):
    motion = any_motion(seed)
    boost = np.array([1.0, -2.0, 0.5])
    x = motion.x.copy()
    x[7:10] += boost
    moved = dc.replace(motion, x=x, wind=motion.wind + boost)
    np.testing.assert_allclose(
        effect().wrench(VEHICLE, moved), effect().wrench(VEHICLE, motion), rtol=1e-7, atol=1e-9
    )


def test_flapping_rotors_raise_the_nose_in_forward_flight():
    chi = BladeFlapping(0.02).wrench(VEHICLE, level((5.0, 0, 0)))
    np.testing.assert_allclose(chi, [0, 0, 0, 0, -0.1, 0], atol=1e-12)
    x = np.array(
        [0, 0, 1.0, *attitude.multiply([1.0, 0, 0, 0], [1.0, 0, chi[4] * 0.01, 0]), *np.zeros(6)]
    )
    nose_W = attitude.rotate(x[3:7] / np.linalg.norm(x[3:7]), np.array([1.0, 0, 0]))
    assert nose_W[2] > 0
    chi = BladeFlapping(0.02).wrench(VEHICLE, level((0, 5.0, 0)))
    np.testing.assert_allclose(chi[3:], [0.1, 0, 0], atol=1e-12)


def test_lateral_speed_lifts_and_vertical_speed_does_not():
    chi = TranslationalLift(0.05).wrench(VEHICLE, level((3.0, 4.0, -7.0)))
    np.testing.assert_allclose(chi, [0, 0, 1.25, 0, 0, 0], atol=1e-12)


def test_a_drag_feels_every_wind_of_the_model():
    effects = [ConstantWind(3.0, 0, 0), LinearDrag(0.2, 0.2, 0.2), ConstantWind(1.0, 2.0, 0)]
    chi = total_wrench(VEHICLE, effects, level())
    np.testing.assert_allclose(chi, [0.8, 0.4, 0, 0, 0, 0], atol=1e-12)


def test_ground_effect_follows_the_method_of_images_and_fades():
    dut = GroundEffect(0.4)
    lift = [dut.wrench(VEHICLE, level(height=h))[2] for h in (0.2, 0.4, 100.0)]
    np.testing.assert_allclose(lift, np.array([1 / 3, 1 / 15, 1e-6]) * 2.0 * 9.81, rtol=1e-5)


@pytest.mark.parametrize("height", [-1.0, 0.0, 0.05])
def test_ground_effect_gives_half_the_thrust_again_at_most(height):
    chi = GroundEffect(0.4).wrench(VEHICLE, level(height=height))
    np.testing.assert_allclose(chi, [0, 0, 0.5 * 2.0 * 9.81, 0, 0, 0], atol=1e-12)


def test_gusts_have_the_mean_deviation_and_memory_asked():
    # Averages over a long time and many seeds: of 60 lines an axis each wind alone repeats itself
    # roughly.
    t, T = np.arange(0.0, 400.0, 0.1), 0.8
    winds = np.stack([GustyWind(1.0, -2.0, 0.5, 1.5, T, seed).air_velocity(t) for seed in range(5)])
    np.testing.assert_allclose(winds.mean(axis=(0, 1)), [1.0, -2.0, 0.5], atol=0.05)
    gust = winds - [1.0, -2.0, 0.5]
    assert gust.std() == pytest.approx(1.5, rel=0.02)
    for lag in (2, 8, 16):
        memory = np.mean(gust[:, lag:] * gust[:, :-lag]) / 1.5**2
        assert memory == pytest.approx(np.exp(-0.1 * lag / T), abs=0.03)
    cross = np.einsum("sti,stj->ij", gust, gust) / gust[..., 0].size / 1.5**2
    np.testing.assert_allclose(cross, np.eye(3), atol=0.06)  # the axes blow independently


F = VEHICLE.mass * VEHICLE.gravity / 4
V_HOVER = np.sqrt(F / (2 * AIR_DENSITY * np.pi * VEHICLE.rotor_radius**2))
GAIN = 0.6 * AIR_DENSITY * np.pi * VEHICLE.rotor_radius**3 / 4  # [N·s²/(m·rad)]
SPEED = np.sqrt(F / VEHICLE.thrust_coefficient)


def test_nothing_changes_in_hover():
    np.testing.assert_allclose(RotorInflow().wrench(VEHICLE, level()), np.zeros(6), atol=1e-12)


@given(st.floats(-0.9, 3.0))
def test_the_induced_velocity_in_axial_flow_is_the_root_of_a_quadratic(ratio):
    climb = ratio * V_HOVER
    closed = -climb / 2 + np.sqrt(climb**2 / 4 + V_HOVER**2)
    assert induced_velocity(np.array(V_HOVER), np.array(0.0), np.array(climb)) == pytest.approx(
        closed, rel=1e-9
    )


@given(st.floats(0.0, 15.0), st.floats(-4.0, 10.0), st.floats(0.5, 8.0))
def test_the_induced_velocity_solves_glauerts_equation(lateral, axial, at_rest):
    v = induced_velocity(np.array(at_rest), np.array(lateral), np.array(max(axial, -at_rest)))
    assert v * np.hypot(lateral, v + max(axial, -at_rest)) == pytest.approx(at_rest**2, rel=1e-6)


def test_a_slow_climb_loses_half_of_what_a_fixed_inflow_would():
    climb = 1e-4
    force = RotorInflow().wrench(VEHICLE, level((0, 0, climb)))[2]
    assert force == pytest.approx(-4 * GAIN * SPEED * climb / 2, rel=1e-3)
