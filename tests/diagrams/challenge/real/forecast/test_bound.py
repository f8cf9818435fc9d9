"""Laws of the bound's check on flights."""

import numpy as np
import pytest

from diagrams.challenge.real.forecast import bound as checks
from diagrams.challenge.real.forecast.bound import bound_lines, check_bound
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.payload_filter.training import train_payload_filter
from np_drake.residual_models.hold import Hold


@pytest.fixture(scope="module")
def checked(cones):
    flight = cones[0]
    opened = (flight.log, flight.vehicle)
    model = PayloadFilter(train_payload_filter([opened], step=0.02))
    return model, opened


def test_the_bound_holds_for_every_forecast_of_a_flight(checked):
    model, opened = checked
    found = check_bound(model, opened, [1, 10, 40], first=10)
    assert len(found.bound) > 50
    assert found.held.all()
    lines = bound_lines([found], [1, 10, 40], 0.02)
    assert [line["held"] for line in lines] == [len(found.bound)] * 3
    assert all(1.0 < line["median"] <= line["quantile"] for line in lines)


def test_changes_that_are_understated_are_found_out(checked, monkeypatch):
    model, opened = checked
    monkeypatch.setattr(checks, "_largest_changes", lambda values, steps: np.zeros(steps + 1))
    assert not check_bound(model, opened, [1, 10, 40], first=10).held.all()


def test_models_of_fixed_matrices_have_a_bound_of_their_own(checked):
    assert check_bound(Hold(step=0.02), checked[1], [1], first=0) is None
