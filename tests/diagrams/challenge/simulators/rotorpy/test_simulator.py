from functools import partial

import numpy as np
import pytest

pytest.importorskip("rotorpy", reason="rotorpy is not installed: pip install 'np_drake[challenge]'")

from diagrams.batch.failed_run import FailedRun
from diagrams.challenge.generate.magnitudes import draw_effect
from diagrams.challenge.generate.sensor_quality import SensorQuality
from diagrams.challenge.generate.trajectories import draw_plan
from diagrams.challenge.generate.vehicles import VEHICLES
from diagrams.challenge.out_of_library.actuators import RotorSaturation, StutteringRotor
from diagrams.challenge.out_of_library.draw import OUT_OF_LIBRARY, draw_out_of_library
from diagrams.challenge.out_of_library.wind import PassingVehicle
from diagrams.challenge.simulators.drake import simulator
from diagrams.challenge.simulators.rotorpy import simulator as rotorpy_simulator
from np_drake import attitude
from np_drake.effects.library import LIBRARY
from np_drake.labels import raw_labels
from np_drake.rigid_body import residual_wrench

# The laws hold from any start; a settled one only takes longer [s].
fly_in_drake, fly = (partial(of.fly, warm_up=0.5) for of in (simulator, rotorpy_simulator))
# What a momentary wrench does not show whole: effects with memory, with more mass, or with clocks
# of their own.
SHARED = [
    *("center_of_mass_offset", "suspended_payload", "motor_lag", "command_delay", "clock_offset"),
    *("linear_drag", "rotor_gyroscopic", "thrust_rate_torque", "yaw_backlash", "liquid_slosh"),
    *("creeping_blades", "dynamic_inflow"),
]


@pytest.fixture(scope="module")
def clean(vehicle, plan, t):
    return fly(vehicle, plan, t=t)


def drawn(name, vehicle):
    rng = np.random.default_rng(4)
    return (
        [draw_out_of_library(name, rng, vehicle)]
        if name in OUT_OF_LIBRARY
        else draw_effect(name, rng, vehicle, 20.0)
    )


def rms(difference):
    return np.sqrt(np.mean(np.square(difference)))


@pytest.mark.parametrize("nominal", VEHICLES, ids=lambda vehicle: vehicle.name)
def test_without_effect_nothing_is_left(nominal, t):
    plan = draw_plan(np.random.default_rng(0), nominal, 5.0, "sprints")
    log = fly(nominal, plan, t=t)
    u = nominal.thrust_coefficient * log.rotor**2 @ nominal.mixer.T
    np.testing.assert_allclose(
        residual_wrench(nominal, q=log.q, w=log.w, a=log.a, al=log.al, u=u), 0.0, atol=1e-10
    )
    chi = raw_labels(log, nominal)[60:]  # of the command, through the vehicle file's lag
    assert np.abs(chi[:, :3]).max() < 5e-3  # [N]
    assert np.abs(chi[:, 3:]).max() < 5e-4  # [N·m]


def test_a_flight_is_the_same_twice(vehicle, plan, t, clean):
    np.testing.assert_array_equal(fly(vehicle, plan, t=t).x, clean.x)


@pytest.mark.parametrize("nominal", VEHICLES[:2], ids=lambda vehicle: vehicle.name)
def test_a_clean_flight_is_that_of_the_other_simulator(nominal, t):
    plan = draw_plan(np.random.default_rng(0), nominal, 5.0, "sprints")
    ours, theirs = fly(nominal, plan, t=t), fly_in_drake(nominal, plan, t=t)
    np.testing.assert_allclose(ours.p, theirs.p, atol=1e-4)  # [m]; two integrators
    np.testing.assert_allclose(ours.a, theirs.a, atol=2e-3)  # [m/s²]
    np.testing.assert_allclose(ours.rotor, theirs.rotor, atol=0.05)  # [rad/s]


@pytest.mark.parametrize("name", SHARED)
def test_an_effect_moves_the_vehicle_as_in_the_other_simulator(name, vehicle, plan, t, clean):
    effects = drawn(name, vehicle)
    ours, theirs = fly(vehicle, plan, effects, t=t), fly_in_drake(vehicle, plan, effects, t=t)
    # The other one's other clock interpolates across commands, at which accelerations jump.
    for signal in (
        ("p", "v", "q", "w") if name == "clock_offset" else ("p", "v", "q", "w", "a", "al")
    ):
        a, b, c = (getattr(log, signal) for log in (ours, theirs, clean))
        # Of what the effect changes: the other one's cable is stiff_cable.
        assert rms(a - b) < 0.05 * rms(b - c) + 1e-4, signal


def test_rotors_that_speed_up_twist_back_as_in_the_other_simulator(t):
    racer = VEHICLES[1]  # with lag
    plan = draw_plan(np.random.default_rng(0), racer, 5.0, "sprints")
    effect = LIBRARY["rotor_gyroscopic"](0.005 * racer.J[2, 2])
    ours, theirs = (in_either(racer, plan, [effect], t=t) for in_either in (fly, fly_in_drake))
    added = rms(theirs.al - fly_in_drake(racer, plan, t=t).al)
    assert rms(ours.al - theirs.al) < 0.02 * added


IN_THESE_SECONDS = {  # what acts now and then, as it acts in these few
    "rotor_saturation": lambda v: RotorSaturation(1.005 * v.mass * v.gravity / 4),
    "stuttering_rotor": lambda v: StutteringRotor(0, 0.1, 0.8, 0.4),
    "passing_vehicle": lambda v: PassingVehicle(1.0, 0.02, 0.5, 4.0, 1.8, 0.1),
}


@pytest.mark.parametrize(
    "name", [n for n in (*LIBRARY, *OUT_OF_LIBRARY) if n in OUT_OF_LIBRARY or LIBRARY[n].begins]
)
def test_before_its_onset_an_effect_does_nothing(name, vehicle, plan, t, clean):
    effects = (
        [IN_THESE_SECONDS[name](vehicle)] if name in IN_THESE_SECONDS else drawn(name, vehicle)
    )
    log = fly(vehicle, plan, effects, t=t, onset=1.2)
    before = log.t < 1.2 - 1e-9
    np.testing.assert_allclose(log.x[before], clean.x[before], atol=1e-12)
    assert rms(log.x[~before] - clean.x[~before]) > 1e-7
    assert np.abs(np.diff(log.v, axis=0)).max() < 0.35  # [m/s]: nothing jumps but forces


def test_a_file_that_is_a_percent_off_is_so_throughout(vehicle, plan, t):
    background = SensorQuality("real", mass_off=0.01, thrust_off=-0.01).background(vehicle)
    log = fly(vehicle, plan, drawn("linear_drag", vehicle), t=t, onset=1.2, background=background)
    chi = raw_labels(log, vehicle)[:110]
    expected = -0.01 * vehicle.mass * (log.a + [0, 0, 9.81]) - 0.01 * log.u[
        :, :1
    ] * attitude.body_z(log.q)
    np.testing.assert_allclose(chi[:, :3], expected[:110], atol=1e-6)  # [N]


def test_a_lost_vehicle_is_said(vehicle, plan, t):
    with pytest.raises(FailedRun, match="lost"):
        fly(vehicle, plan, [LIBRARY["thrust_scale"](0.4)], t=t)


def test_what_is_no_effect_is_said(vehicle, plan, t):
    with pytest.raises(ValueError, match="must be of a class of effects"):
        fly(vehicle, plan, ["haunted"], t=t)
