"""The project's own loop flies rotorpy's vehicle as it flies Drake's."""

import dataclasses as dc

import numpy as np
import pytest

pytest.importorskip("rotorpy", reason="rotorpy is not installed: pip install 'np_drake[challenge]'")

from diagrams.challenge.generate.magnitudes import draw_effect
from diagrams.challenge.simulators.rotorpy.rotorpy_vehicle import ForeignVehicle, foreign_effects
from diagrams.challenge.transfer.reality import WITHHELD
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight_diagram import make_flight_diagram
from diagrams.loop.flight_result import fly
from diagrams.loop.reality import RealityConfig
from np_drake.effects.disturbance import DisturbanceConfig
from np_drake.effects.effect_entry import EffectEntry
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle
from systems.payload_config import PayloadConfig, release

VEHICLE, FOREIGN = Vehicle(), ForeignVehicle()
SILENT = MeasurementNoise(0, 0, 0, 0, 0, 0)
# Largest difference of the state in the whole flight [m, 1, m/s, rad/s]. Both integrate by
# runge_kutta3 at 4 ms; seen are 6e-7. A payload hangs on an inextensible tether in one world and on
# a stiff cable in the other, which stretches by
# 0.1 mm and rings at 300 rad/s: seen are 3e-4 [rad/s].
SAME, SAME_ON_A_CABLE = 5e-6, 1e-3


def reality_of(*entries, noise=SILENT, **changes):
    return dc.replace(RealityConfig().nominal(), noise=noise, effects=list(entries), **changes)


def drawn(name):
    effects = draw_effect(name, np.random.default_rng(1), VEHICLE, 20.0)
    return reality_of(*(EffectEntry.of(effect) for effect in effects))


def short(reality, kind="hold", duration=1.5):
    config = load_experiment("circle", VEHICLE)
    config.controller.solver, config.controller.kind, config.reference.ramp = "sqp", kind, 1.0
    return dc.replace(config, reality=reality, duration=duration).check_and_step()


@pytest.fixture(scope="module")
def clean():
    return fly(short(reality_of()), seed=0).signals["x_true"]


@pytest.mark.parametrize("name", WITHHELD)
def test_a_closed_loop_flight_with_an_effect_is_that_of_the_other_world(name, clean):
    config = short(drawn(name))
    ours, theirs = fly(config, seed=0), fly(config, seed=0, real=FOREIGN)
    tolerance = SAME_ON_A_CABLE if name == "suspended_payload" else SAME
    for signal in ("x_true", "x"):
        np.testing.assert_allclose(
            theirs.signals[signal], ours.signals[signal], rtol=0, atol=tolerance
        )
    assert np.abs(ours.signals["x_true"] - clean).max() > 10 * tolerance  # the effect is felt


def test_a_nominal_flight_has_the_same_signals_in_both_worlds(clean):
    config = short(reality_of(), kind="nominal")
    ours, theirs = fly(config, seed=0).signals, fly(config, seed=0, real=FOREIGN).signals
    assert ours.keys() == theirs.keys()
    for signal in ours.keys() - {"solve_time"}:
        np.testing.assert_allclose(theirs[signal], ours[signal], rtol=0, atol=1e-5, err_msg=signal)


def test_the_sensors_have_the_noise_of_the_scenario():
    config = short(reality_of(noise=MeasurementNoise(position=0.01)), duration=0.5)
    found = fly(config, seed=0, real=FOREIGN).signals
    assert np.std((found["x"] - found["x_true"])[:, :3]) == pytest.approx(0.01, rel=0.2)


def test_the_payload_is_where_it_is_in_the_other_world():
    config = short(drawn("suspended_payload"), duration=0.5)
    ours, theirs = fly(config, seed=0), fly(config, seed=0, real=FOREIGN)
    np.testing.assert_allclose(
        theirs.payload_position, ours.payload_position, atol=1e-3
    )  # [m]; the stretch


def test_the_oracle_knows_the_foreign_vehicle_with_payload_and_lag():
    lag = EffectEntry("motor_lag", {"time_constant": 0.03})
    reality = dc.replace(
        drawn("suspended_payload"), effects=[*drawn("suspended_payload").effects, lag]
    )
    config = short(reality, kind="oracle", duration=1.0)
    ours, theirs = (fly(config, seed=0, **how).metrics()["E_xy"] for how in ({}, {"real": FOREIGN}))
    assert theirs == pytest.approx(ours, rel=0.01)


def test_the_fields_of_a_reality_act_as_its_effects_do():
    own = dc.replace(
        RealityConfig().nominal(),
        rotor_drag=0.2,
        motor_lag=0.03,
        thrust_scale=0.9,
        command_delay=0.02,
    )
    own = dc.replace(own, thrust_loss=0.01, wind=[1.0, 0.0, 0.0], payload=PayloadConfig(mass=0.2))
    found = {effect.identifier: effect.values for effect in foreign_effects(own)}
    assert found["linear_drag"] == {"d_x": 0.2, "d_y": 0.2, "d_z": 0.2}
    assert found["motor_lag"]["time_constant"] == 0.03
    assert found["thrust_scale"]["scale"] == 0.9
    assert found["thrust_drift"]["rate"] == -0.01
    assert found["command_delay"]["delay"] == 0.02
    assert (found["gusty_wind"]["mean_x"], found["gusty_wind"]["deviation"]) == (1.0, 0.0)
    assert found["suspended_payload"]["mass"] == 0.2


@pytest.mark.parametrize(
    "reality, message",
    [
        (
            reality_of(disturbance=DisturbanceConfig(force=[0.1, 0.0, 0.0])),
            "disturbance must be none",
        ),
        (reality_of(EffectEntry("mass_error", {}, onset=1.0)), "mass_error begins in flight"),
        (reality_of(payload=PayloadConfig(tether="rod")), "tether must be cable or none; got rod"),
        (reality_of(EffectEntry("motor_lag", {}), motor_lag=0.02), "one motor lag at most; got 2"),
    ],
)
def test_what_rotorpy_does_not_know_is_refused_in_one_line(reality, message):
    with pytest.raises(ValueError, match=message) as caught:
        make_flight_diagram(short(reality), real=FOREIGN)
    assert "\n" not in str(caught.value)


def test_events_and_pushes_are_refused():
    config = short(reality_of())
    hung = short(reality_of(payload=PayloadConfig()))
    hung.events = [release(0.5 * hung.end)]
    with pytest.raises(ValueError, match="events must be none for this simulator"):
        fly(hung, seed=0, real=FOREIGN)
    with pytest.raises(ValueError, match="no pushes from outside"):
        make_flight_diagram(config, pushed=True, real=FOREIGN)
