"""Laws of what is practically none."""

import dataclasses as dc

import pytest

from np_drake.diagnosis.options import Options, Size

REAL, IDEAL = Options.for_sensors(True).materiality, Options.for_sensors(False).materiality
PLAIN = {"calibration": False, "sensor": False}


@pytest.mark.parametrize(
    "size, matters",
    [
        (Size(1.01 * REAL.force, 0.0, 0.0, 0.0), True),
        (Size(0.0, 1.01 * REAL.torque, 0.0, 0.0), True),
        (Size(0.99 * REAL.force, 0.99 * REAL.torque, 0.9, 9.0), False),
    ],
    ids=["force", "torque", "none"],
)
def test_an_effect_matters_by_force_or_torque(size, matters):
    assert size.material(REAL, **PLAIN) is matters


def test_calibration_matters_by_force_alone_and_a_sensor_by_its_tolerance():
    wide = Size(0.0, 1.0, 1.0, 1.0)
    assert not wide.material(REAL, calibration=True, sensor=False)
    assert dc.replace(wide, force=0.03).material(REAL, calibration=True, sensor=False)
    assert not wide.material(REAL, calibration=False, sensor=True)
    assert dc.replace(wide, sensor=2.0).material(REAL, calibration=False, sensor=True)
