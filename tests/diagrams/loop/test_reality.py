"""Laws of the real vehicle: delay, battery, and what happens to its payload in flight."""

import dataclasses as dc

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator

from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig, RealityConfig
from diagrams.loop.reality import make_real_vehicle
from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadEvent, push, release
from systems.plant import set_hover
from tests.diagrams.loop.conftest import short

CONFIG = load_experiment("hover")
PAYLOAD = CONFIG.reality.payload


def thrusts(reality, times, command=1.1):
    """Return the mean rotor thrust at `times` (n,) [s] after a step of the hover command [N]."""
    dut = make_real_vehicle(Vehicle(), reality, command_period=0.02)
    simulator = Simulator(dut)
    context = simulator.get_mutable_context()
    dut.GetInputPort("u").FixValue(context, command * Vehicle().hover_input)
    found = []
    for t in times:
        simulator.AdvanceTo(t)
        found.append(dut.GetOutputPort("rotor_thrust").Eval(context).mean())
    return np.array(found)


def bare(**fields):
    reality = RealityConfig(motor_lag=0.0, thrust_scale=1.0, rotor_drag=0.0, **fields)
    reality.payload.tether = "none"
    return reality.check()


@pytest.mark.parametrize("delay", [0.02, 0.045])
def test_a_command_acts_after_its_delay(delay):
    hover = Vehicle().mass * Vehicle().gravity / 4  # [N]
    found = thrusts(bare(command_delay=delay), [delay - 1e-4, delay + 1e-4])
    np.testing.assert_allclose(found, [hover, 1.1 * hover], rtol=1e-12)


def test_a_battery_loses_its_share_of_the_starting_thrust_each_second():
    times = np.array([0.001, 0.5, 1.0])
    share = thrusts(bare(thrust_loss=0.1), times) / thrusts(bare(), [0.001])[0]
    np.testing.assert_allclose(share, 1.0 - 0.1 * times)
    dut = RealityConfig(thrust_scale=0.9, thrust_loss=0.1)
    assert dut.thrust_at(Vehicle(), 2.0) == pytest.approx(0.9 * 0.8)


def test_a_battery_that_does_not_last_the_flight_is_refused():
    config = FlightConfig(duration=10.0, reality=RealityConfig(thrust_loss=0.015)).check()
    with pytest.raises(ValueError, match="more than the rotors can carry"):
        dc.replace(config, duration=50.0).check()  # 17 % left after 55 s


def hanging(*events, reality=CONFIG.reality):
    """(simulator, real vehicle, root context): at rest under the thrust that carries both."""
    vehicle = make_real_vehicle(CONFIG.vehicle, reality, events=events)
    simulator = Simulator(vehicle)
    ApplySimulatorConfig(CONFIG.simulator, simulator)
    root = simulator.get_mutable_context()
    thrust = CONFIG.carried_mass * CONFIG.vehicle.gravity / CONFIG.reality.thrust_scale
    vehicle.GetInputPort("u").FixValue(root, [thrust, 0.0, 0.0, 0.0])
    plant = vehicle.GetSubsystemByName("plant")
    set_hover(plant, plant.GetMyMutableContextFromRoot(root), PAYLOAD, [0.0, 0.0, 2.0])
    return simulator, vehicle, root


def read(vehicle, root, name):
    return vehicle.GetOutputPort(name).Eval(vehicle.GetMyContextFromRoot(root)).copy()


def around(simulator, vehicle, root, time, name="plant_state"):
    """The port's values just before and just after the events of `time`."""
    simulator.AdvanceTo(time)
    before = read(vehicle, root, name)
    simulator.AdvancePendingEvents()
    return before, read(vehicle, root, name)


def test_a_push_changes_the_momentum_of_the_payload_as_heavy_as_it_is():
    before, after = around(*hanging(push(0.1, [0.3, 0.0, -0.1])), 0.1)
    momentum = PAYLOAD.mass * (after - before)[23:26]
    np.testing.assert_allclose(momentum, [0.3, 0.0, -0.1], atol=1e-12)  # [N·s]
    np.testing.assert_array_equal(after[:23], before[:23])
    before, after = around(
        *hanging(PayloadEvent("attach", 0.05, 0.1), push(0.1, [0.36, 0.0, 0.0])), 0.1
    )
    assert (after - before)[23] == pytest.approx(1.0)  # [m/s]


def test_what_is_attached_brings_weight_and_no_momentum():
    simulator, vehicle, root = hanging(PayloadEvent("attach", 0.1, 0.1))
    before, after = around(simulator, vehicle, root, 0.1)
    np.testing.assert_array_equal(before, after)
    simulator.AdvanceTo(0.4)
    tension, lift = -read(vehicle, root, "tether_wrench")[2], read(vehicle, root, "acceleration")[2]
    assert tension == pytest.approx(0.36 * (9.81 + lift), abs=0.05)  # [N]; the stretch still rings


def test_a_payload_that_is_released_falls_freely_in_its_context_alone():
    simulator, vehicle, root = hanging(release(0.1))
    other = root.Clone()
    simulator.AdvanceTo(0.1)
    start = read(vehicle, root, "plant_state")
    simulator.AdvanceTo(0.5)
    fallen = read(vehicle, root, "plant_state")[11:14] - start[11:14] - 0.4 * start[23:26]
    np.testing.assert_allclose(fallen, [0.0, 0.0, -0.5 * 9.81 * 0.16], atol=1e-6)  # [m]
    np.testing.assert_array_equal(read(vehicle, root, "tether_wrench"), np.zeros(6))
    assert read(vehicle, other, "tether_wrench")[2] == pytest.approx(-0.26 * 9.81, abs=1e-6)  # [N]


@pytest.mark.parametrize(
    "events, message",
    [
        ([push(1.0, [0.1, 0.0, 0.0])], "events must have times of their own within the flight"),
        ([PayloadEvent("explode", 0.4)], "kind must be one of attach, impulse, release"),
        ([PayloadEvent("attach", 0.4, 0.0)], "mass must be positive for kind attach"),
        ([push(0.4, [0.0, 0.0, 0.0])], "impulse must be given for kind impulse alone"),
    ],
)
def test_impossible_events_are_refused_in_one_line(events, message):
    with pytest.raises(ValueError, match=message) as caught:
        short("hover", events=events).check()
    assert "\n" not in str(caught.value)


def test_the_oracle_is_told_what_hangs_after_every_event():
    config = load_experiment("hover")
    config.events = [release(3.0), push(2.0, [0.0, 0.0, 0.1]), PayloadEvent("attach", 1.0, 0.1)]
    model = config.true_model()
    assert [model.payload_at(t) is None for t in (0.0, 2.9, 3.0)] == [False, False, True]
    masses = [model.payload_at(t).mass for t in (0.0, 1.0, 2.5)]
    assert masses == pytest.approx([0.26, 0.36, 0.36])  # [kg]
