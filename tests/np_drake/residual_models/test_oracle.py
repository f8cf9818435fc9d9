"""Laws of the true wrench along a plan."""

import numpy as np
import pytest

from np_drake import attitude
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.thrust_drift import ThrustDrift
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.residual_models.oracle import TrueModel
from np_drake.vehicle import Vehicle

VEHICLE, STEP, N = Vehicle(), 0.02, 6
LEVEL = np.tile([0, 0, 1.0, 1.0, *np.zeros(9)], (N + 1, 1))
HOVER = np.full(4, VEHICLE.mass * VEHICLE.gravity / 4)
WEIGHT = VEHICLE.hover_input[0]


def along(wrench_effects, actuator_effects, thrust=HOVER, *, x=LEVEL, step=STEP, t=0.0, **more):
    """chi (N, 6) of a level vehicle under hover thrust, whose rotors turn with `thrust`."""
    model = TrueModel(VEHICLE, None, wrench_effects, actuator_effects, **more)
    u = np.tile(VEHICLE.hover_input, (len(x) - 1, 1))
    return model.wrench_along(x, u, step, rotor_thrust=thrust, swing_state=None, t=t)


def test_drag_pushes_by_wind_and_motion_and_weak_rotors_miss_their_share():
    chi = along([ConstantWind(2.0, 0, 0), LinearDrag(0.3, 0.3, 0.3)], [])
    np.testing.assert_allclose(chi, np.tile([0.6, 0, 0, 0, 0, 0], (N, 1)), atol=1e-12)
    moving = LEVEL.copy()
    moving[:, 7] = 1.0
    weak = [MotorLag(0.03), ThrustScale(0.9)]
    chi = along([LinearDrag(0.2, 0.2, 0.2)], weak, 0.9 * HOVER, x=moving, step=0.04)
    expected = [-0.2 * np.sqrt(0.9), 0, -0.1 * WEIGHT, 0, 0, 0]
    np.testing.assert_allclose(chi, np.tile(expected, (N, 1)), atol=1e-9)


def test_the_lag_of_a_thrust_step_fades_along_the_plan():
    model = TrueModel(VEHICLE, None, [], [MotorLag(0.03)])
    u, x = np.tile([24.0, 0, 0, 0], (10, 1)), np.tile(LEVEL[:1], (11, 1))
    chi = model.wrench_along(x, u, 0.04, rotor_thrust=np.full(4, 5.0), swing_state=None)
    assert chi[0, 2] < -1.0
    assert chi[-1, 2] == pytest.approx(0.0, abs=0.01)  # [N]


def test_a_drift_goes_on_along_the_plan():
    chi = along([], [ThrustDrift(1.0, -0.05)], 0.9 * HOVER, t=2.0)
    middle = 2.0 + STEP * (np.arange(N) + 0.375)  # four substeps, each by its start
    np.testing.assert_allclose(chi[:, 2], -0.05 * middle * WEIGHT, atol=1e-9)


def test_a_heavier_vehicle_lacks_its_share_of_the_thrust_from_its_onset_on():
    """With a = (u + f) / m' - g the believed vehicle needs m a + m g - u = (m / m' - 1) u at
    rest.
    """
    heavy = MassError(0.5)
    before, after = (
        along([], [], onsets={heavy: 3.0}, mass_effects=[heavy], t=t) for t in (2.0, 3.5)
    )
    np.testing.assert_allclose(before, 0.0, atol=1e-12)
    expected = (VEHICLE.mass / (VEHICLE.mass + 0.5) - 1.0) * WEIGHT
    np.testing.assert_allclose(after, np.tile([0, 0, expected, 0, 0, 0], (N, 1)), atol=1e-12)


def test_thrust_off_the_centre_of_mass_turns_and_swings_the_vehicle():
    """At rest al = -J^-1 (c x u z), a = u / m - g - al x c: the believed vehicle sees J al and -m
    (al x c).
    """
    c = np.array([0.02, -0.01, 0.03])
    chi = along([], [], mass_effects=[CenterOfMassOffset(*c)])
    torque = -np.cross(c, [0, 0, WEIGHT])
    al = np.linalg.solve(VEHICLE.J, torque)
    np.testing.assert_allclose(chi[0], [*(-VEHICLE.mass * np.cross(al, c)), *torque], atol=1e-12)


def test_a_turned_vehicle_feels_the_same_in_its_own_axes():
    turned = LEVEL.copy()
    turned[:, 3:7] = q = np.array([np.cos(0.4), 0.0, np.sin(0.4), 0.0])
    effects = [CenterOfMassOffset(0.02, 0.0, 0.0), MassError(0.2)]
    level, tilted = (along([], [], x=x, mass_effects=effects)[0] for x in (LEVEL, turned))
    np.testing.assert_allclose(attitude.rotate_back(q, tilted[:3]), level[:3], atol=1e-12)
    np.testing.assert_allclose(tilted[3:], level[3:], atol=1e-12)
