"""Laws of the diagnosis of a vehicle that nobody measured: healthy differences are calibration,
larger ones causes.
"""

import pytest

from np_drake.diagnosis.calibration import calibration_effects
from np_drake.diagnosis.options import SPREAD, Options
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.weak_rotor import WeakRotor

REAL = Options.for_sensors(True)
HEALTHY = (WeakRotor(1.0, 1 - SPREAD.rotor_gain), BladeFlapping(0.05))
SENSORS = {"noise": 1.0, "attitude_noise": 0.005, "seconds": 8.0}


def flown(seen, *effects):
    return [seen(*effects, name=n, seed=i, **SENSORS) for i, n in enumerate("abc", start=1)]


@pytest.fixture(scope="module")
def healthy(seen, inferred):
    *train, held_out = flown(seen, *HEALTHY)
    return inferred(train, [held_out], REAL)


def test_a_healthy_vehicle_has_no_cause(healthy):
    assert healthy.causes == []


def test_calibration_is_in_the_corrected_simulator(healthy):
    effects = calibration_effects(
        healthy.ranking.best, healthy.flights[0], healthy.ranking.options.tolerance
    )
    gains = {e.rotor: e.efficiency for e in effects if isinstance(e, WeakRotor)}
    assert len(gains) == 4
    assert gains[1.0] < min(gains[i] for i in (2.0, 3.0, 4.0))  # the only one that is weak
    assert not any(e.place == "measurement" or e.shifts_commands for e in effects)
