"""Laws of the vehicle that is flown open loop."""

import numpy as np
import pytest

from diagrams.gap import rollout
from diagrams.gap.rollout import Commands, Rollout, Swing
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
TIMES = np.array([0.0, 0.25, 0.5, 1.0])


def flown(payload):
    """Of a vehicle that is pushed hard from hover, its payload aslant."""
    t = 0.01 * np.arange(101)
    u = np.zeros((len(t), 4))
    u[:, 0] = VEHICLE.mass * VEHICLE.gravity * (1.1 + 0.3 * np.sin(9 * t))
    x = np.zeros(13)
    x[2], x[3] = 2.0, 1.0
    aslant = payload.length * np.array([0.6, 0.0, -0.8])
    swing = Swing(aslant, np.zeros(3), np.zeros(3))
    return Rollout(VEHICLE, [payload]).fly(x, Commands(t, u), TIMES, swing)[:, :13]


@pytest.mark.parametrize("mass", [0.01, 0.1])
def test_the_softer_cable_of_a_light_payload_is_not_seen(mass, monkeypatch):
    payload = SuspendedPayload(mass=mass, length=0.3)
    soft = flown(payload)
    monkeypatch.setattr(rollout, "as_light", lambda config: config)
    stiff = flown(payload)
    bare = flown(SuspendedPayload(mass=1e-4, length=0.3))
    assert np.all(np.isfinite(soft))
    pulled = np.abs(stiff - bare).max()
    assert np.abs(soft - stiff).max() < 0.01 * pulled


def test_a_light_payload_needs_no_smaller_steps_than_the_usual_one(monkeypatch):
    steps = []
    integrator = rollout._integrator
    monkeypatch.setattr(
        rollout, "_integrator", lambda *args: steps.append(integrator(*args)) or steps[-1]
    )
    for mass in (0.26, 0.1, 0.005):
        Rollout(VEHICLE, [SuspendedPayload(mass=mass, length=0.3)])
    assert min(s.max_step_size for s in steps) == steps[0].max_step_size
