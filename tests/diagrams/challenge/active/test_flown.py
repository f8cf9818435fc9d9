"""Laws of a flight of the real vehicle."""

import numpy as np
import pytest

from diagrams.challenge.active.flown import FURTHER, fly_real
from diagrams.challenge.simulators.flight_plan import Plan
from np_drake.flight_design.limits import limits_for
from np_drake.references.base import Hover


@pytest.fixture(scope="module")
def hover(dragged):
    return fly_real(dragged, Plan("hover", Hover(np.array([0.0, 0.0, 1.25]))), FURTHER, 5.0)


def test_a_hover_uses_no_room(hover, dragged):
    limits = limits_for(dragged.vehicle, (), box=(4.0, 4.0, 2.5), speed=3.0, tilt=0.5)
    assert max(hover.usage(limits).values()) < 0.2


def test_the_log_is_that_of_the_sensors(hover):
    off = hover.log.p - np.stack([np.interp(hover.log.t, hover.true.t, x) for x in hover.true.p.T], axis=1)
    assert 1e-4 < off.std() < 0.02  # m, white noise of the position
    assert hover.log.al is None  # real sensors do not read it


def test_residuals_without_noise_stand_beside_those_measured(hover):
    assert hover.pair.measured.y.shape == hover.pair.true.y.shape
    assert hover.pair.errors.std() > 0
