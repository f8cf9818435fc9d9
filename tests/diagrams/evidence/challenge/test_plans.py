import numpy as np
import pytest

from diagrams.evidence.challenge.case import VEHICLES
from diagrams.evidence.challenge.plans import FASTEST, KINDS, ROTOR_SHARE, Heading, Plan, draw_plan
from np_drake import attitude
from np_drake.references.base import Hover

T = np.arange(0.0, 12.0, 0.02)


@pytest.mark.parametrize("kind", KINDS)
def test_every_vehicle_can_fly_every_kind_from_rest(kind):
    for seed, vehicle in enumerate(VEHICLES):
        dut = draw_plan(np.random.default_rng(seed), vehicle, 12.0, kind)
        p, v, a = dut.reference.sample(T)[:3]
        thrust = dut.rotor_thrust(vehicle, T) / vehicle.max_rotor_thrust
        np.testing.assert_allclose([v[0], a[0]], 0.0, atol=1e-9)
        assert ROTOR_SHARE[0] <= thrust.min() <= thrust.max() <= ROTOR_SHARE[1]
        assert np.linalg.norm(v, axis=1).max() <= FASTEST
        assert p[:, 2].min() > 0.1  # [m]


def test_targets_of_a_turning_hover_turn():
    dut = Plan("hover", Hover([0, 0, 1.0]), Heading(start=0.5, rate=0.3))
    target = dut.targets(9.81, np.array([5.0]))[0]
    np.testing.assert_allclose(target[9:12], [0, 0, 0.3], atol=1e-5)
    # [rad/s²]; a difference of differences
    np.testing.assert_allclose(target[12:15], 0.0, atol=1e-2)
    assert target[15] == pytest.approx(0.5 + 0.3 * 4.5)


def test_targets_agree_with_their_own_integral(plan, t):
    target = plan.targets(9.81, t)
    z_B_W = target[:, 6:9] + [0, 0, 9.81]
    q = attitude.quaternion_from_axes(
        z_B_W / np.linalg.norm(z_B_W, axis=1, keepdims=True), target[:, 15]
    )
    q_rate = attitude.quaternion_rate(q[1:-1], target[1:-1, 9:12])
    np.testing.assert_allclose((q[2:] - q[:-2]) / (t[2:] - t[:-2])[:, None], q_rate, atol=5e-3)
