"""Laws of the closed loop as a Diagram: built and run by a plain Simulator, it is the
experiment.
"""

import dataclasses as dc

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator

from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight_diagram import make_flight_diagram, recorded, set_initial_state
from diagrams.loop.flight_result import fly
from np_drake.effects.calibration import effects_of
from np_drake.effects.effect_entry import EffectEntry
from np_drake.vehicle.vehicle import Calibration


def short(name):
    """The experiment with its events half a second after the start."""
    config = load_experiment(name)
    config.controller.solver, config.controller.kind = "sqp", "hold"
    config.reference.ramp, config.duration = 0.5, 0.6
    config.events = [dc.replace(event, time=0.5) for event in config.events]
    return config.check()


@pytest.mark.parametrize("name", ["attach", "hover_swing", "circle"])
def test_a_plain_simulator_flies_the_experiment(name):
    config = short(name)
    diagram = make_flight_diagram(config)
    simulator = Simulator(diagram)
    ApplySimulatorConfig(config.simulator, simulator)
    set_initial_state(diagram, simulator.get_mutable_context(), config, seed=4)
    simulator.AdvanceTo(config.end + 0.01)
    plain, flown = recorded(diagram, simulator.get_context()), fly(config, seed=4).signals
    for signal in flown.keys() - {"solve_time"}:
        np.testing.assert_allclose(plain[signal], flown[signal], atol=1e-9, rtol=0, err_msg=signal)
    assert diagram.get_name() == name


def test_the_experiments_with_an_event_depart_from_the_hover_at_its_time():
    calm = fly(dc.replace(short("attach"), events=[]), seed=4).signals
    flown = fly(short("attach"), seed=4).signals
    apart = np.abs(flown["acceleration_true"] - calm["acceleration_true"]).max(axis=1)
    assert apart[calm["t"] < 0.499].max() == 0.0
    assert apart[calm["t"] > 0.55].max() > 0.1  # [m/s²]


def test_the_calibration_of_the_vehicle_flies_as_its_effects_do():
    known = Calibration(
        [0.005, -0.003, 0.0], [0.97, 1.01, 1.03, 0.99], command_delay=0.004, rotor_inertia=1e-5
    )
    config = short("circle")
    config.reality.command_delay = 0.0
    entries = [EffectEntry.of(effect) for effect in effects_of(known, config.vehicle)]
    named = dc.replace(config, reality=dc.replace(config.reality, effects=entries))
    calibrated = dc.replace(config, vehicle=dc.replace(config.vehicle, calibration=known))
    plain, one, other = (fly(c, seed=4).signals["x"] for c in (config, calibrated, named))
    np.testing.assert_allclose(one, other, atol=1e-6)  # [m, m/s, rad/s]: effects in another order
    assert np.abs(one - plain).max() > 1e-3


def test_the_diagram_is_complete():
    diagram = make_flight_diagram(load_experiment("circle"))
    for name in (
        "tethered_quadrotor",
        "sensor_model",
        "reference",
        "wrench_estimator",
        "np_mpc",
        "recorder",
    ):
        assert diagram.HasSubsystemNamed(name)
