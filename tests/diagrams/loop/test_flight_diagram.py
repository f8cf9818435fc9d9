"""Laws of the closed loop as a Diagram: a plain Simulator flies the experiment."""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.loop.flight_diagram import make_flight_diagram, make_simulator, recorded
from diagrams.loop.flight_result import fly
from np_drake.effects.calibration import effects_of
from np_drake.effects.effect_entry import EffectEntry
from np_drake.vehicle.vehicle import Calibration
from tests.diagrams.loop.conftest import short


def early(name):
    """The experiment with its events half a second after the start."""
    config = short(name, "hold", duration=0.6)
    config.events = [dc.replace(event, time=0.5) for event in config.events]
    return config.check()


@pytest.mark.parametrize("name", ["attach", "circle"])
def test_a_plain_simulator_flies_the_experiment(name):
    config = early(name)
    diagram = make_flight_diagram(config)
    simulator = make_simulator(diagram, config, seed=4)
    simulator.AdvanceTo(config.end + 0.01)
    plain, flown = recorded(diagram, simulator.get_context()), fly(config, seed=4).signals
    for signal in flown.keys() - {"solve_time"}:
        np.testing.assert_allclose(plain[signal], flown[signal], atol=1e-9, rtol=0, err_msg=signal)
    assert diagram.get_name() == name
    calm = fly(dc.replace(config, events=[]), seed=4).signals
    apart = np.abs(flown["acceleration_true"] - calm["acceleration_true"]).max(axis=1)
    assert apart[calm["t"] < 0.499].max() == 0.0
    assert (apart[calm["t"] > 0.55].max() > 0.1) == bool(config.events)  # [m/s²]


def test_the_calibration_of_the_vehicle_flies_as_its_effects_do(flown):
    known = Calibration(
        [0.005, -0.003, 0.0], [0.97, 1.01, 1.03, 0.99], command_delay=0.004, rotor_inertia=1e-5
    )
    config = short("circle", "hold")
    entries = [EffectEntry.of(effect) for effect in effects_of(known, config.vehicle)]
    named = dc.replace(config, reality=dc.replace(config.reality, effects=entries))
    calibrated = dc.replace(config, vehicle=dc.replace(config.vehicle, calibration=known))
    one, other = (fly(c, seed=2).signals["x"] for c in (calibrated, named))
    np.testing.assert_allclose(one, other, atol=1e-6)  # [m, m/s, rad/s]: effects in another order
    assert np.abs(one - flown("circle", "hold").signals["x"]).max() > 1e-3
