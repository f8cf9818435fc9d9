"""Laws of a vehicle file with a calibration: what it says is part of the nominal model, as well
known as it says.
"""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.calibration import of_vehicle, subtract_file_calibration
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.options import Tolerance
from np_drake.diagnosis.residuals import WRENCH, make_flight_residuals
from np_drake.effects.calibration import effects_of
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.estimation.priors import HEALTHY
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import Calibration

PLAIN = Vehicle()
KNOWN = Calibration(
    center_of_mass=[0.01, -0.008, 0.0],
    rotor_gains=[0.95, 1.02, 1.04, 0.99],
    command_delay=0.01,
    rotor_inertia=5e-5,
    imu_tilt=[0.01, -0.02, 0.0],
)
FILE = dc.replace(PLAIN, calibration=KNOWN).check()
UNMEASURED = dc.replace(Tolerance(), unmeasured=True)


def rms(y):
    return np.sqrt(np.mean(y[:, WRENCH] ** 2, axis=0))


@pytest.fixture(scope="module")
def flown(fly):
    """Return a function that gives the residuals of a flight of the calibrated vehicle with further
    effects.
    """

    def residuals(*effects, vehicle=FILE):
        log = fly(*effects_of(KNOWN, PLAIN), *effects, vehicle=PLAIN, name="a", seed=1, seconds=6.0)
        return subtract_file_calibration(make_flight_residuals(log, vehicle))

    return residuals


@pytest.mark.parametrize(
    "effect", [MassError(0.2), ThrustScale(0.9), WeakRotor(2.0, 0.9), LinearDrag()], ids=str
)
def test_an_effect_acts_with_the_calibration(flown, effect):
    e = flown(effect)
    left = e.y - predicted_residual(e, [Term(effect)])
    assert np.linalg.norm(rms(left) / rms(flown(vehicle=PLAIN).y)) < 0.2
    assert predicted_residual(e, []) == pytest.approx(np.zeros_like(e.y))


def test_a_stated_interval_is_the_spread_of_its_number(seen):
    told = {"calibration.rotor_gains": [[0.9, 1.0], [1.0, 1.04], [1.03, 1.05], [0.98, 1.0]]}
    told |= {
        "calibration.center_of_mass[0]": [[0.008, 0.012]],
        "rotor_time_constant": [[0.0, 0.001]],
    }
    dut = of_vehicle(
        seen(vehicle=dc.replace(FILE, intervals=told).check(), seed=1, seconds=4.0), UNMEASURED
    )
    assert [d.sigma["efficiency"] for d in dut if d.effect is WeakRotor] == pytest.approx(
        [0.05 / 1.96, 0.02 / 1.96, 0.01 / 1.96, 0.01 / 1.96]
    )
    (center,) = (d.sigma for d in dut if d.effect is CenterOfMassOffset)
    assert center["x"] == pytest.approx(0.002 / 1.96)
    assert center["y"] == pytest.approx(HEALTHY.center_of_mass * np.hypot(0.127, 0.127))
    assert not any(d.effect is MotorLag for d in dut)
