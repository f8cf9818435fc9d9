import dataclasses as dc

import numpy as np
import pytest

from np_drake.identification.model import FlightModel
from np_drake.identification.signals import signals
from np_drake.identification.validation import ERRORS, predict, vehicle_values
from tests.np_drake.identification import analytic


@pytest.fixture(scope="module")
def level():
    """The vehicle whose sensors stand straight."""
    return dc.replace(
        analytic.TRUE, calibration=dc.replace(analytic.TRUE.calibration, imu_tilt=[0.0] * 3)
    )


@pytest.fixture(scope="module")
def case(level, found):
    """A flight without noise, its model and the true parameters."""
    log = analytic.flight(level, 5, seconds=5.0, noisy=False)
    layout, frame = found.estimate.layout, found.basis.frame
    named = layout.values(np.zeros(layout.size))
    v = vehicle_values(level, frame, "rotor_speed", level.mass, named) | {"drag": 0.1, "climb": 0.1}
    return FlightModel(signals(log, analytic.KNOWN.unmixer), frame), log, v


def test_a_flight_in_closed_form_is_predicted(case):
    model, log, v = case
    _, dut = predict(model, log, v, seconds=0.5)
    assert dut[0].max() < 1e-7  # at the start it is the log
    errors = dict(zip(ERRORS, dut[-1].max(axis=0), strict=True))
    assert errors["position"] < 0.002  # m, of up to 5
    assert errors["velocity"] < 0.01  # m/s
    assert errors["attitude"] < 0.005  # rad
    assert errors["rates"] < 0.03  # rad/s


def test_predictions_do_not_cross_a_gap(case):
    model, log, v = case
    good = model.flight.good.copy()
    good[200] = False
    gap = FlightModel(dc.replace(model.flight, good=good), model.frame)
    dut, _ = predict(gap, log, v, seconds=0.2)
    assert not np.any((dut <= 200) & (dut + 20 > 200))
