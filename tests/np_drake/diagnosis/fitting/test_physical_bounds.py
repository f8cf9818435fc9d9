"""Laws of physical bounds on fitted parameters."""

import numpy as np
import pytest

from np_drake.diagnosis.fitting import at_its_bound, impossible, interval
from np_drake.effects.base import Effect
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.inertia_error import InertiaError
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.vehicle import Vehicle


@pytest.mark.parametrize(
    "effect, at_end",
    [
        (ConstantWind(1.0, -15.0, 0.0), True),
        (BladeFlapping(-0.2), True),
        (ConstantWind(1.0, -14.0, 0.0), False),
        (MotorLag(0.0), False),  # neutral
        (LinearDrag(0.3, 0.0, 0.3), False),
        (WeakRotor(4, 0.9), False),  # a choice
    ],
    ids=str,
)
def test_a_figure_at_its_bound_is_none_unless_it_is_neutral(effect: Effect, at_end):
    assert at_its_bound(effect) is at_end


@pytest.mark.parametrize("height, possible", [(1.5, True), (0.4, False), (np.inf, True)])
def test_a_payload_hangs_clear_of_the_ground_at_the_top_of_a_flight(fit_at, height, possible):
    payload = SuspendedPayload(mass=0.1, length=1.0, damping=0.1)
    why = impossible(fit_at(payload, covariance=1e-4), 0, Vehicle(), height)
    assert (not why) is possible


def test_an_interval_is_that_of_the_figure_of_its_own_term(fit_at):
    fit = fit_at(LinearDrag(0.1, 0.2, 0.3), InertiaError(1.0, 1.1, 1.2), covariance=0.1)
    assert interval(fit, 1, "scale_yy") == pytest.approx((1.1 - 0.196, 1.1 + 0.196))
    assert interval(fit_at(WeakRotor(4, 0.9), covariance=0.1), 0, "rotor") == (4.0, 4.0)
