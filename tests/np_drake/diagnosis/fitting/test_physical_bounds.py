"""Laws of physical bounds on fitted parameters."""

import numpy as np
import pytest

from np_drake.diagnosis.fitting import at_its_bound, impossible, interval
from np_drake.effects.base import Effect
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.ground_effect import GroundEffect
from np_drake.effects.inertia_error import InertiaError
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.vehicle import Vehicle

FLAT = Vehicle(inertia=[[0.02, 0, 0], [0, 0.02, 0], [0, 0, 0.035]])  # at most twice 0.02 [kg·m²]


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


@pytest.mark.parametrize(
    "effect, deviation, possible",
    [
        (InertiaError(1.0, 1.0, 1.1), 0.01, True),
        (InertiaError(1.3, 1.2, 0.9), 0.01, True),
        (InertiaError(1.0, 1.0, 1.4), 0.01, False),  # more about z than about x and y together
        (InertiaError(1.0, 1.0, 1.4), 0.2, True),  # or not, for all that is known
        (InertiaError(0.5, 2.5, 1.0), 0.01, False),
        (InertiaError(1.0, 1.0, 1.0), 3.0, True),
        (CenterOfMassOffset(0.05, 0.0, 0.0), 0.01, True),
        (LinearDrag(0.6, 0.6, 0.6), 0.01, True),
    ],
    ids=str,
)
def test_an_inertia_that_no_rigid_body_has_stands_for_something_else(
    fit_at, effect, deviation, possible
):
    why = impossible(fit_at(WeakRotor(2, 0.9), effect, covariance=deviation), 1, FLAT, np.inf)
    assert why == ("" if possible else "no vehicle can have such figures")


@pytest.mark.parametrize(
    "radius, deviation, possible", [(0.2, 0.01, True), (0.8, 0.01, False), (0.8, 0.2, True)]
)
def test_a_ground_effect_is_no_larger_than_twice_the_vehicle(fit_at, radius, deviation, possible):
    why = impossible(fit_at(GroundEffect(radius), covariance=deviation), 0, Vehicle(), np.inf)
    assert (not why) is possible


@pytest.mark.parametrize("height, possible", [(1.5, True), (0.4, False), (np.inf, True)])
def test_a_payload_hangs_clear_of_the_ground_at_the_top_of_a_flight(fit_at, height, possible):
    payload = SuspendedPayload(mass=0.1, length=1.0, damping=0.1)
    why = impossible(fit_at(payload, covariance=1e-4), 0, Vehicle(), height)
    assert (not why) is possible


def test_a_figure_at_its_bound_stands_for_something_else(fit_at):
    assert "bound" in impossible(fit_at(BladeFlapping(-0.2), covariance=0.1), 0, FLAT, np.inf)


def test_an_interval_is_that_of_the_figure_of_its_own_term(fit_at):
    fit = fit_at(LinearDrag(0.1, 0.2, 0.3), InertiaError(1.0, 1.1, 1.2), covariance=0.1)
    assert interval(fit, 1, "scale_yy") == pytest.approx((1.1 - 0.196, 1.1 + 0.196))
    assert interval(fit_at(WeakRotor(4, 0.9), covariance=0.1), 0, "rotor") == (4.0, 4.0)
