"""Laws of limits: what a motion uses, and how large it may be."""

import numpy as np
import pytest

from np_drake.effects.explanation import Explanation
from np_drake.effects.mass_error import MassError
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.flight_design.limits import Limits, limits_for, load_of, swing_of
from np_drake.references.base import Hover
from np_drake.vehicle import Vehicle

T = 0.02 * np.arange(501)
HUNG = Explanation(("suspended_payload",), 1.0, (SuspendedPayload(0.2, 0.8, 0, 0, -0.1, 0.1),))
ROOM = {"box": (4.0, 4.0, 2.5), "speed": 3.0, "tilt": 0.5}


def swept(limits: Limits, amplitude: float) -> np.ndarray:
    """Return a sine of 0.5 Hz along x, (5, n, 3)."""
    rate, flat = np.pi, np.zeros((5, len(T), 3))
    flat[0] = limits.center
    for k in range(5):
        flat[k, :, 0] += amplitude * rate**k * np.sin(rate * T + 0.5 * k * np.pi)
    return flat


def test_hover_uses_nothing():
    limits = limits_for(Vehicle(), [], **ROOM)
    assert max(limits.usage(T, Hover(limits.center).sample(T)).values()) == pytest.approx(
        0.0, abs=1e-9
    )


def test_shares_are_those_of_a_sine(limits):
    used = limits.usage(T, swept(limits, 0.5))
    assert used["room"] == pytest.approx(0.5 / limits.half[0], rel=1e-3)
    assert used["speed"] == pytest.approx(0.5 * np.pi / 3.0, rel=1e-3)
    assert used["tilt"] == pytest.approx(np.arctan(0.5 * np.pi**2 / 9.81) / 0.5, rel=1e-3)


def test_the_payload_keeps_from_the_floor():
    limits = limits_for(Vehicle(), [HUNG], **ROOM)
    assert limits.lower[2] > 0.8 + 0.1
    assert "swing" in limits.usage(T, swept(limits, 0.3))


def test_a_pendulum_leans_against_a_steady_acceleration():
    a = np.tile([1.0, 0.0, 0.0], (len(T), 1))
    angle = swing_of(0.8, 9.81, T, a)
    assert angle[:, 0].min() == pytest.approx(-2 / 9.81, rel=0.1)  # overshoot of hardly any damping
    assert not angle[:, 1].any()


def test_the_load_is_what_hover_needs():
    assert load_of(Vehicle(), HUNG) == pytest.approx(1.1)
    assert load_of(Vehicle(), Explanation((), 1.0, (MassError(0.2),))) == pytest.approx(1.1)
    assert load_of(Vehicle(), Explanation((), 1.0, (ThrustScale(0.8),))) == pytest.approx(1.25)


def test_a_room_too_small_is_refused():
    with pytest.raises(ValueError, match="larger room"):
        limits_for(Vehicle(), [HUNG], box=(4.0, 4.0, 1.0), speed=3.0, tilt=0.5)


def test_a_load_too_large_is_refused():
    with pytest.raises(ValueError, match="thrust left"):
        limits_for(Vehicle(), [Explanation((), 1.0, (ThrustScale(0.5),))], **ROOM)


@pytest.mark.parametrize("wrong", [{"speed": -1.0}, {"tilt": 2.0}])
def test_impossible_limits_are_refused(wrong):
    with pytest.raises(ValueError, match="speed"):
        limits_for(Vehicle(), [], **{**ROOM, **wrong})


@pytest.mark.parametrize("length", [0.3, 1.2])
def test_a_payload_under_a_steady_acceleration_hangs_back_by_it_over_g(length):
    t = 0.01 * np.arange(20000)
    a = np.tile([1.0, -2.0, 0.5], (len(t), 1))
    np.testing.assert_allclose(
        swing_of(length, 9.81, t, a)[-1], [-1.0 / 9.81, 2.0 / 9.81], rtol=1e-3
    )
