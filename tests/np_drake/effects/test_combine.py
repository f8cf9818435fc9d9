import pytest

from np_drake.effects.combine import split_effects
from np_drake.effects.library import LIBRARY
from np_drake.effects.sensor_noise import SensorNoise
from np_drake.effects.suspended_payload import SuspendedPayload


def test_every_effect_has_its_place():
    effects = [effect() for effect in LIBRARY.values()]
    found = split_effects([*effects, SensorNoise()])
    assert found.payload == SuspendedPayload()
    assert [e for e in effects if e.place == "mass"] == found.mass
    assert [e for e in effects if e.place == "actuator"] == found.actuator
    assert [e for e in effects if e.place == "wrench" and e != found.payload] == found.wrench
    assert [*(e for e in effects if e.place == "measurement"), SensorNoise()] == found.measurement


def test_two_payloads_and_strangers_are_refused():
    with pytest.raises(ValueError, match="got two"):
        split_effects([SuspendedPayload(), SuspendedPayload(0.5)])
    with pytest.raises(ValueError, match="split_effects"):
        split_effects([object()])
