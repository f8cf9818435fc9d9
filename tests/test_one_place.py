"""Laws of flight stand in one place: identification and diagnosis follow the same effects."""

import numpy as np
import pytest

from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.rotor_gyroscopic import RotorGyroscopic
from np_drake.effects.translational_lift import TranslationalLift
from np_drake.effects.uneven_lag import UnevenLag
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.identification.estimation import parameters
from np_drake.identification.model import FlightModel, Frame
from np_drake.identification.signals import signals
from np_drake.vehicle.vehicle import ThrottleMap
from tests.np_drake.identification import analytic

LAWS = [
    (LinearDrag, "body_wrench", LinearDrag()),
    (TranslationalLift, "body_wrench", TranslationalLift()),
    (BladeFlapping, "body_wrench", BladeFlapping()),
    (RotorGyroscopic, "body_wrench", RotorGyroscopic()),
    (MotorLag, "follow", MotorLag(0.05)),
    (MotorLag, "follow", UnevenLag(0.03, 0.05)),
    (WeakRotor, "thrust_gain", WeakRotor()),
]


@pytest.fixture(scope="module")
def left():
    """Return what a flight leaves beside the identified model, all of whose laws act, and what an
    effect leaves in its diagnosis.
    """
    true = analytic.TRUE
    logs = {d: analytic.flight(seconds=6.0, drive=d, noisy=False) for d in ("command", "throttle")}
    places = np.array(true.rotor_positions), np.array(true.rotor_directions)
    values = {p.name: p.value(0.5) for p in parameters(600.0, 0.01)}

    def residuals(effect=None):
        drive = "command" if effect else "throttle"
        frame = Frame(*places, true.rotor_radius, 3.0 if effect else 0.4, None, 0.4)
        model = FlightModel(signals(logs[drive], true.unmixer, drive), frame)
        seen = make_flight_residuals(logs["command"], analytic.KNOWN, since=0.0)
        found = predicted_residual(seen, [Term(effect)] if effect else [])
        return model.residual(values), found

    return residuals


def changed(monkeypatch, law, name):
    """Let a law give a tenth more."""
    original = getattr(law, name)
    monkeypatch.setattr(law, name, lambda *given, **named: 1.1 * original(*given, **named))


@pytest.mark.parametrize(("law", "name", "effect"), LAWS)
def test_identification_and_diagnosis_follow_one_law(monkeypatch, left, law, name, effect):
    before = left(effect)
    changed(monkeypatch, law, name)
    for old, new in zip(before, left(effect), strict=True):
        assert np.abs(new - old).max() > 1e-6 * np.abs(old).max()


def test_identification_follows_the_throttle_curve_of_the_vehicle_file(monkeypatch, left):
    before, _ = left()
    original = ThrottleMap.thrust
    monkeypatch.setattr(ThrottleMap, "thrust", lambda *given: original(*given) ** 1.1)
    assert np.abs(left()[0] - before).max() > 1e-3 * np.abs(before).max()
