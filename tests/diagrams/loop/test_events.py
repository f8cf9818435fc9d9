"""Laws of what happens to a payload in flight."""

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator

from diagrams.loop.events import attach, payloads, push, release
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight_result import fly
from diagrams.loop.real_vehicle import make_real_vehicle
from systems.initial_state import set_hover

CONFIG = load_experiment("hover")
PAYLOAD = CONFIG.reality.payload


@pytest.fixture
def hanging():
    """(simulator, real vehicle, root context): at rest under the thrust that carries both."""
    vehicle = make_real_vehicle(CONFIG.vehicle, CONFIG.reality)
    simulator = Simulator(vehicle)
    ApplySimulatorConfig(CONFIG.simulator, simulator)
    root = simulator.get_mutable_context()
    thrust = CONFIG.carried_mass * CONFIG.vehicle.gravity / CONFIG.reality.thrust_scale
    vehicle.GetInputPort("u").FixValue(root, [thrust, 0.0, 0.0, 0.0])
    plant = vehicle.GetSubsystemByName("plant")
    set_hover(plant, plant.GetMyMutableContextFromRoot(root), PAYLOAD, [0.0, 0.0, 2.0])
    return simulator, vehicle, root


def read(vehicle, root, name):
    return vehicle.GetOutputPort(name).Eval(vehicle.GetMyContextFromRoot(root))


def test_a_push_changes_the_payloads_momentum_by_the_impulse(hanging):
    _, vehicle, root = hanging
    before = read(vehicle, root, "plant_state").copy()
    push(1.0, [0.3, 0.0, -0.1]).apply(vehicle, root)
    after = read(vehicle, root, "plant_state")
    np.testing.assert_allclose(PAYLOAD.mass * (after - before)[23:26], [0.3, 0.0, -0.1], atol=1e-12)  # [N·s]
    np.testing.assert_allclose(after[:23], before[:23], atol=1e-12)


def test_what_is_attached_brings_weight_and_no_momentum(hanging):
    simulator, vehicle, root = hanging
    before = read(vehicle, root, "plant_state").copy()
    attach(1.0, PAYLOAD, 0.1).apply(vehicle, root)
    np.testing.assert_array_equal(read(vehicle, root, "plant_state"), before)
    simulator.AdvanceTo(0.3)
    tension, lift = -read(vehicle, root, "tether_wrench")[2], read(vehicle, root, "acceleration")[2]
    assert tension == pytest.approx(0.36 * (9.81 + lift), abs=0.05)  # [N]; the stretch still rings
    assert tension > 0.33 * 9.81


def test_a_payload_that_is_released_falls_freely(hanging):
    simulator, vehicle, root = hanging
    release(1.0).apply(vehicle, root)
    start = read(vehicle, root, "plant_state")[11:14].copy()
    simulator.AdvanceTo(0.4)
    fallen = read(vehicle, root, "plant_state")[11:14] - start
    np.testing.assert_allclose(fallen, [0.0, 0.0, -0.5 * 9.81 * 0.16], atol=1e-6)  # [m]
    np.testing.assert_array_equal(read(vehicle, root, "tether_wrench"), np.zeros(6))


def test_one_context_is_cut_and_another_is_not(hanging):
    _, vehicle, root = hanging
    other = root.Clone()
    release(1.0).apply(vehicle, root)
    assert read(vehicle, other, "tether_wrench")[2] == pytest.approx(-0.26 * 9.81, abs=1e-6)  # [N]
    assert read(vehicle, root, "tether_wrench")[2] == 0.0


def short_hover():
    config = load_experiment("hover")
    config.reference.ramp, config.duration, config.controller.solver = 0.4, 0.4, "sqp"
    return config


def test_an_event_changes_nothing_before_its_time_and_is_seen_at_it():
    calm = fly(short_hover(), seed=1).signals
    pushed = fly(short_hover(), seed=1, events=[push(0.4, [0.3, 0.0, 0.0])]).signals
    before = calm["t"] < 0.4 - 1e-9
    np.testing.assert_array_equal(pushed["plant_state"][before], calm["plant_state"][before])
    row = int(np.argmin(before))
    gained = (pushed["plant_state"] - calm["plant_state"])[row, 23]
    assert gained == pytest.approx(0.3 / 0.26, rel=1e-3)  # [m/s]


@pytest.mark.parametrize("times", [(0.0,), (0.8,), (0.4, 0.4)])
def test_events_outside_the_flight_or_at_once_are_refused(times):
    with pytest.raises(ValueError, match="events must have times of their own within the flight"):
        fly(short_hover(), seed=1, events=[push(t, [0.1, 0.0, 0.0]) for t in times])


def test_the_oracle_is_told_what_hangs_after_every_event():
    first = CONFIG.true_model().payload
    events = [release(3.0), push(2.0, [0.0, 0.0, 0.1]), attach(1.0, PAYLOAD, 0.1)]
    masses = [(t, None if payload is None else payload.mass) for t, payload in payloads(first, events)]
    assert masses == [(1.0, pytest.approx(0.36)), (2.0, pytest.approx(0.36)), (3.0, None)]
    model = CONFIG.true_model(events)
    assert [model.payload_at(t) is None for t in (0.0, 2.9, 3.0)] == [False, False, True]
    assert model.payload_at(1.0).mass == pytest.approx(0.36)  # [kg]
    assert payloads(None, events) == []
