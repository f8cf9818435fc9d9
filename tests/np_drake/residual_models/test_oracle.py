import numpy as np

from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.linear_drag import LinearDrag
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
