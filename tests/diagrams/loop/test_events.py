"""Laws of what happens to a payload in flight."""

import dataclasses as dc

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator

from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight_result import fly
from diagrams.loop.real_vehicle import make_real_vehicle
from np_drake.effects.effect_entry import EffectEntry
from systems.payload_config import PayloadEvent, push, release
from systems.plant import set_hover

CONFIG = load_experiment("hover")
PAYLOAD = CONFIG.reality.payload


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


def test_a_push_changes_the_payloads_momentum_by_the_impulse():
    before, after = around(*hanging(push(0.1, [0.3, 0.0, -0.1])), 0.1)
    np.testing.assert_allclose(
        PAYLOAD.mass * (after - before)[23:26], [0.3, 0.0, -0.1], atol=1e-12
    )  # [N·s]
    np.testing.assert_array_equal(after[:23], before[:23])


def test_a_push_after_an_attachment_moves_the_heavier_payload():
    events = PayloadEvent("attach", 0.05, mass=0.1), push(0.1, [0.36, 0.0, 0.0])
    before, after = around(*hanging(*events), 0.1)
    assert (after - before)[23] == pytest.approx(1.0)  # [m/s]


def test_what_is_attached_brings_weight_and_no_momentum():
    simulator, vehicle, root = hanging(PayloadEvent("attach", 0.1, mass=0.1))
    before, after = around(simulator, vehicle, root, 0.1)
    np.testing.assert_array_equal(before, after)
    simulator.AdvanceTo(0.4)
    tension, lift = -read(vehicle, root, "tether_wrench")[2], read(vehicle, root, "acceleration")[2]
    assert tension == pytest.approx(0.36 * (9.81 + lift), abs=0.05)  # [N]; the stretch still rings
    assert tension > 0.33 * 9.81


def test_a_payload_that_is_released_falls_freely():
    simulator, vehicle, root = hanging(release(0.1))
    simulator.AdvanceTo(0.1)
    start = read(vehicle, root, "plant_state")
    simulator.AdvanceTo(0.5)
    fallen = read(vehicle, root, "plant_state")[11:14] - start[11:14] - 0.4 * start[23:26]
    np.testing.assert_allclose(fallen, [0.0, 0.0, -0.5 * 9.81 * 0.16], atol=1e-6)  # [m]
    np.testing.assert_array_equal(read(vehicle, root, "tether_wrench"), np.zeros(6))


def test_one_context_is_cut_and_another_is_not():
    simulator, vehicle, root = hanging(release(0.1))
    other = root.Clone()
    around(simulator, vehicle, root, 0.1)
    assert read(vehicle, other, "tether_wrench")[2] == pytest.approx(-0.26 * 9.81, abs=1e-6)  # [N]
    assert read(vehicle, root, "tether_wrench")[2] == 0.0


def test_a_payload_that_is_hung_on_moves_with_the_hook():
    late = EffectEntry("suspended_payload", {"mass": 0.2, "length": 0.6}, onset=0.1)
    none = dc.replace(PAYLOAD, tether="none")
    reality = dc.replace(CONFIG.reality, payload=none, effects=[late])
    before, after = around(*hanging(reality=reality), 0.1)
    hook = after[4:7] + reality.hung.hook  # level
    np.testing.assert_allclose(after[11:14], hook - [0.0, 0.0, 0.6], atol=1e-12)  # [m]
    np.testing.assert_allclose(after[23:26], after[17:20], atol=1e-12)  # [m/s]
    np.testing.assert_array_equal(after[:7], before[:7])


def short_hover(*events):
    config = load_experiment("hover")
    config.reference.ramp, config.duration, config.controller.solver = 0.4, 0.4, "sqp"
    return dc.replace(config, events=[*events])


def test_an_event_changes_nothing_before_its_time_and_is_seen_at_it():
    calm = fly(short_hover(), seed=1).signals
    pushed = fly(short_hover(push(0.4, [0.3, 0.0, 0.0])), seed=1).signals
    before = calm["t"] < 0.4 - 1e-9
    np.testing.assert_array_equal(pushed["plant_state"][before], calm["plant_state"][before])
    row = int(np.argmin(before))
    gained = (pushed["plant_state"] - calm["plant_state"])[row, 23]
    assert gained == pytest.approx(0.3 / 0.26, rel=1e-3)  # [m/s]


@pytest.mark.parametrize("times", [(0.8,), (0.4, 0.4)])
def test_events_outside_the_flight_or_at_once_are_refused(times):
    with pytest.raises(ValueError, match="events must have times of their own within the flight"):
        short_hover(*(push(t, [0.1, 0.0, 0.0]) for t in times)).check()


@pytest.mark.parametrize(
    "event, message",
    [
        (
            PayloadEvent("explode", 0.4),
            "kind must be one of attach, impulse, release; got 'explode'",
        ),
        (release(0.0), "time must be positive"),
        (PayloadEvent("attach", 0.4, mass=0.0), "mass must be positive for kind attach"),
        (PayloadEvent("release", 0.4, mass=0.1), "0 for another"),
        (push(0.4, [0.0, 0.0, 0.0]), "impulse must be given for kind impulse alone"),
        (push(0.4, [np.nan, 0.0, 0.0]), "three finite values"),
    ],
)
def test_an_impossible_event_is_refused_in_one_line(event, message):
    with pytest.raises(ValueError, match=message) as caught:
        short_hover(event).check()
    assert "\n" not in str(caught.value)


def test_events_without_a_cable_are_refused():
    config = short_hover(release(0.4))
    config.reality.payload.tether = "none"
    with pytest.raises(ValueError, match="events need a payload on a cable; got none"):
        config.check()


def test_the_oracle_is_told_what_hangs_after_every_event():
    config = load_experiment("hover")
    config.events = [
        release(3.0),
        push(2.0, [0.0, 0.0, 0.1]),
        PayloadEvent("attach", 1.0, mass=0.1),
    ]
    model = config.true_model()
    assert [model.payload_at(t) is None for t in (0.0, 2.9, 3.0)] == [False, False, True]
    assert [model.payload_at(t).mass for t in (0.0, 1.0, 2.5)] == [
        0.26,
        *[pytest.approx(0.36)] * 2,
    ]  # [kg]
