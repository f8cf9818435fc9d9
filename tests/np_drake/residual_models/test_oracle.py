import numpy as np

from np_drake import attitude
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.thrust_drift import ThrustDrift
from np_drake.residual_models.oracle import TrueModel
from np_drake.vehicle import Vehicle

VEHICLE, STEP, N = Vehicle(), 0.02, 6
LEVEL = np.tile([0, 0, 1.0, 1.0, *np.zeros(9)], (N + 1, 1))
HOVER = np.full(4, VEHICLE.mass * VEHICLE.gravity / 4)


def along(wrench_effects, actuator_effects, thrust, **more):
    model = TrueModel(VEHICLE, None, wrench_effects, actuator_effects)
    return model.wrench_along(LEVEL, thrust @ VEHICLE.mixer.T, STEP, swing_state=None, **more)


def test_over_a_hovering_plan_the_wind_pushes():
    effects = [ConstantWind(2.0, 0, 0), LinearDrag(0.3, 0.3, 0.3)]
    chi = along(effects, [], np.tile(HOVER, (N, 1)), rotor_thrust=HOVER)
    np.testing.assert_allclose(chi, np.tile([0.6, 0, 0, 0, 0, 0], (N, 1)), atol=1e-12)


def test_a_drift_goes_on_along_the_plan():
    drift = ThrustDrift(1.0, -0.05)
    chi = along([], [drift], np.tile(HOVER, (N, 1)), rotor_thrust=0.9 * HOVER, t=2.0)
    middle = 2.0 + STEP * (np.arange(N) + 0.375)  # four substeps, each by its start
    np.testing.assert_allclose(chi[:, 2], -0.05 * middle * VEHICLE.hover_input[0], atol=1e-9)


def test_a_heavier_vehicle_lacks_its_share_of_the_thrust():
    """With a = (u + f) / m' - g the believed vehicle needs m a + m g - u = (m / m' - 1) u at
    rest.
    """
    model = TrueModel(VEHICLE, None, [], [], mass_effects=[MassError(0.5)])
    chi = model.wrench_along(
        LEVEL, np.tile(VEHICLE.hover_input, (N, 1)), STEP, rotor_thrust=HOVER, swing_state=None
    )
    u = VEHICLE.hover_input[0]
    expected = (VEHICLE.mass / (VEHICLE.mass + 0.5) - 1.0) * u
    np.testing.assert_allclose(chi, np.tile([0, 0, expected, 0, 0, 0], (N, 1)), atol=1e-12)


def test_a_mass_that_changes_later_is_not_felt_before():
    heavy = MassError(0.5)
    model = TrueModel(VEHICLE, None, [], [], onsets={heavy: 3.0}, mass_effects=[heavy])
    hover = np.tile(VEHICLE.hover_input, (N, 1))
    before, after = (
        model.wrench_along(LEVEL, hover, STEP, t=t, rotor_thrust=HOVER, swing_state=None)
        for t in (2.0, 3.5)
    )
    np.testing.assert_allclose(before, 0.0, atol=1e-12)
    assert after[0, 2] < -1.0


def test_thrust_off_the_centre_of_mass_turns_and_swings_the_vehicle():
    """At rest al = -J^-1 (c x u z), a = u / m - g - al x c: the believed vehicle sees J al and -m
    (al x c).
    """
    c = np.array([0.02, -0.01, 0.03])
    model = TrueModel(VEHICLE, None, [], [], mass_effects=[CenterOfMassOffset(*c)])
    hover = np.tile(VEHICLE.hover_input, (N, 1))
    chi = model.wrench_along(LEVEL, hover, STEP, rotor_thrust=HOVER, swing_state=None)
    torque = -np.cross(c, [0, 0, VEHICLE.hover_input[0]])
    al = np.linalg.solve(VEHICLE.J, torque)
    np.testing.assert_allclose(chi[0], [*(-VEHICLE.mass * np.cross(al, c)), *torque], atol=1e-12)


def test_a_turned_vehicle_feels_the_same_in_its_own_axes():
    turned = LEVEL.copy()
    turned[:, 3:7] = q = np.array([np.cos(0.4), 0.0, np.sin(0.4), 0.0])
    model = TrueModel(
        VEHICLE, None, [], [], mass_effects=[CenterOfMassOffset(0.02, 0.0, 0.0), MassError(0.2)]
    )
    hover = np.tile(VEHICLE.hover_input, (N, 1))
    level, tilted = (
        model.wrench_along(x, hover, STEP, rotor_thrust=HOVER, swing_state=None)[0]
        for x in (LEVEL, turned)
    )
    np.testing.assert_allclose(attitude.rotate_back(q, tilted[:3]), level[:3], atol=1e-12)
    np.testing.assert_allclose(tilted[3:], level[3:], atol=1e-12)
