from functools import partial

import numpy as np
import pytest

from diagrams.batch.failed_run import FailedRun
from diagrams.challenge.generate.magnitudes import draw_effect
from diagrams.challenge.generate.sensor_quality import SensorQuality
from diagrams.challenge.generate.trajectories import draw_plan
from diagrams.challenge.generate.vehicles import VEHICLES
from diagrams.challenge.simulators.drake import simulator
from np_drake import attitude
from np_drake.effects.base import (
    ActuatorEffect,
    MassEffect,
    MassProperties,
    Measurement,
    Motion,
    SensorEffect,
)
from np_drake.effects.combine import split_effects, total_wrench
from np_drake.effects.library import LIBRARY
from np_drake.labels import raw_labels

# The laws hold from any start; a settled one only takes longer.
fly = partial(simulator.fly, warm_up=0.5)  # [s]

EXACT = {"atol": 1e-5}  # [N, N·m]; the integrator lets the norm of a quaternion slip
PURE = [n for n, e in LIBRARY.items() if e.place == "wrench" and n != "suspended_payload"]
MEMORYLESS = ["thrust_scale", "thrust_drift", "weak_rotor"]
SENSORS = [n for n, e in LIBRARY.items() if e.place == "measurement" and n != "clock_offset"]


def drawn(name, vehicle):
    return draw_effect(name, np.random.default_rng(1), vehicle, 20.0)


@pytest.fixture(scope="module")
def clean(vehicle, plan, t):
    return fly(vehicle, plan, t=t)


def commanded(log, vehicle):
    return log.u @ vehicle.unmixer.T


@pytest.mark.parametrize("nominal", VEHICLES, ids=lambda vehicle: vehicle.name)
def test_without_effect_nothing_is_left(nominal, t):
    plan = draw_plan(np.random.default_rng(0), nominal, 5.0, "sprints")
    chi = raw_labels(fly(nominal, plan, t=t), nominal)[60:]
    assert np.abs(chi[:, :3]).max() < 1e-3  # [N]; the integrator's, where rotors lag
    assert np.abs(chi[:, 3:]).max() < 3e-4  # [N·m]


def test_state_and_accelerations_are_one_motion(clean):
    a = np.diff(clean.v, axis=0) / np.diff(clean.t)[:, None]
    # Between two rows one command acts and the attitude turns by half an interval at most.
    np.testing.assert_allclose(a, clean.a[:-1], atol=0.15)  # [m/s²]
    np.testing.assert_allclose(np.diff(clean.w, axis=0) / 0.01, clean.al[:-1], atol=0.3)  # [rad/s²]


@pytest.mark.parametrize("name", PURE)
def test_a_push_is_the_effects_own_wrench(name, vehicle, plan, t):
    effects = drawn(name, vehicle)
    log = fly(vehicle, plan, effects, t=t)
    chi = total_wrench(vehicle, effects, Motion(log.t, log.x, commanded(log, vehicle)))
    np.testing.assert_allclose(raw_labels(log, vehicle), chi, **EXACT)
    assert np.abs(chi).max() > 0


@pytest.mark.parametrize("name", MEMORYLESS)
def test_a_propeller_gives_the_effects_own_thrust(name, vehicle, plan, t):
    (effect,) = drawn(name, vehicle)
    log = fly(vehicle, plan, [effect], t=t)
    command = commanded(log, vehicle)
    extra = (effect.thrust(vehicle, np.zeros(0), command, log.t) - command) @ vehicle.mixer.T
    chi = np.concatenate([extra[:, :1] * attitude.body_z(log.q), extra[:, 1:]], axis=1)
    np.testing.assert_allclose(raw_labels(log, vehicle), chi, **EXACT)


def test_lagging_rotors_turn_as_their_columns_say(vehicle, plan, t):
    (effect,) = drawn("motor_lag", vehicle)
    log = fly(vehicle, plan, [effect], t=t)
    extra = (vehicle.thrust_coefficient * log.rotor**2 - commanded(log, vehicle)) @ vehicle.mixer.T
    chi = np.concatenate([extra[:, :1] * attitude.body_z(log.q), extra[:, 1:]], axis=1)
    np.testing.assert_allclose(raw_labels(log, vehicle), chi, **EXACT)
    lag = np.diff(log.rotor, axis=0) / 0.01
    speed = np.sqrt(commanded(log, vehicle) / vehicle.thrust_coefficient)
    decay = np.exp(-0.01 / effect.time_constant)
    np.testing.assert_allclose(
        lag, (1 - decay) / 0.01 * (speed - log.rotor)[:-1], rtol=0.02, atol=2.0
    )


def test_delayed_commands_act_whole_rows_later(vehicle, plan, t):
    log = fly(vehicle, plan, [LIBRARY["command_delay"](0.02)], t=t)
    late = log.u[:-2]
    chi = raw_labels(log, vehicle)[2:]
    np.testing.assert_allclose(chi[:, 3:], late[:, 1:] - log.u[2:, 1:], **EXACT)
    f = (late - log.u[2:])[:, :1] * attitude.body_z(log.q[2:])
    np.testing.assert_allclose(chi[:, :3], f, **EXACT)


def test_a_jittered_row_sees_a_delay_of_its_own_length(vehicle, plan, t):
    times = t + 5e-4 * np.random.default_rng(0).uniform(-1, 1, len(t))
    log = fly(vehicle, plan, [LIBRARY["command_delay"](0.013)], t=times)
    # Neither one nor two jittered rows reach 13 ms: at a row the command of two rows before acts.
    np.testing.assert_allclose(
        raw_labels(log, vehicle)[2:, 3:], (log.u[:-2] - log.u[2:])[:, 1:], **EXACT
    )


@pytest.mark.parametrize("name", ["mass_error", "inertia_error", "center_of_mass_offset"])
def test_another_body_moves_as_its_mass_properties_say(name, vehicle, plan, t):
    (effect,) = drawn(name, vehicle)
    assert isinstance(effect, MassEffect)
    log = fly(vehicle, plan, [effect], t=t)
    real = effect.properties(MassProperties.of(vehicle))
    c = np.broadcast_to(real.p_BoBcm_B, log.w.shape)
    a_B = attitude.rotate_back(log.q, log.a + [0, 0, 9.81])
    a_B = a_B + np.cross(log.al, c) + np.cross(log.w, np.cross(log.w, c))
    force_B = real.mass * a_B
    tau = log.al @ real.J.T + np.cross(log.w, log.w @ real.J.T) + np.cross(c, force_B)
    np.testing.assert_allclose(force_B, log.u[:, :1] * [0, 0, 1.0], **EXACT)
    np.testing.assert_allclose(tau, log.u[:, 1:], **EXACT)


def test_a_hanging_payload_pulls_with_its_weight(vehicle, t, plan):
    effect = LIBRARY["suspended_payload"](0.2, 0.6, 0.01, -0.01, -0.03)
    chi = raw_labels(fly(vehicle, plan, [effect], t=t), vehicle)
    assert chi[:, 2].mean() == pytest.approx(
        -0.2 * 9.81, rel=0.1
    )  # the plan itself goes up and down
    r = np.linalg.norm(chi[:, :3], axis=1)
    assert r.min() > 0.5  # [N]: taut


def test_a_payload_that_attaches_hangs_still_under_the_moving_hook(vehicle, t, plan):
    effect = LIBRARY["suspended_payload"](0.2, 0.6, 0.01, -0.01, -0.03)
    chi = raw_labels(fly(vehicle, plan, [effect], t=t, onset=1.2), vehicle)
    np.testing.assert_allclose(chi[:120], 0.0, atol=1e-9)
    np.testing.assert_allclose(chi[120, :3], [0, 0, -0.2 * 9.81], atol=1e-6)


@pytest.mark.parametrize("nominal", VEHICLES[:2], ids=lambda vehicle: vehicle.name)
def test_rotors_turn_on_where_a_lag_begins(nominal, t):
    plan = draw_plan(np.random.default_rng(0), nominal, 5.0, "sprints")
    before = fly(nominal, plan, t=t)
    log = fly(nominal, plan, [LIBRARY["motor_lag"](0.05)], t=t, onset=1.2)
    held = before.u[119] @ nominal.unmixer.T if nominal.rotor_time_constant == 0 else None
    expected = before.rotor[120] if held is None else np.sqrt(held / nominal.thrust_coefficient)
    np.testing.assert_allclose(log.rotor[120], expected, atol=1e-6)  # [rad/s]


@pytest.mark.parametrize("name", SENSORS)
def test_a_sensor_reads_the_effects_own_error_of_an_untouched_flight(name, clean, vehicle, plan, t):
    (effect,) = drawn(name, vehicle)
    assert isinstance(effect, SensorEffect)
    log = fly(vehicle, plan, [effect], t=t)
    truth = Measurement(clean.x, clean.a, clean.al, clean.rotor)
    read = effect.measure(vehicle, truth, np.zeros((len(t), 0)))
    np.testing.assert_array_equal(log.x, read.x)
    np.testing.assert_array_equal(log.a, read.a)
    np.testing.assert_array_equal(log.u, clean.u)


@pytest.mark.parametrize("offset", [0.03, -0.05])
def test_another_clock_shifts_state_against_commands(offset, clean, vehicle, plan, t):
    log = fly(vehicle, plan, [LIBRARY["clock_offset"](offset)], t=t)
    rows = np.arange(10, len(t) - 10)
    np.testing.assert_array_equal(log.u, clean.u)
    np.testing.assert_allclose(log.p[rows], clean.p[rows + round(100 * offset)], atol=1e-9)


@pytest.mark.parametrize("name", [n for n, e in LIBRARY.items() if e.begins])
def test_before_its_onset_an_effect_does_nothing(name, clean, vehicle, plan, t):
    effects = drawn(name, vehicle)
    log = fly(vehicle, plan, effects, t=t, onset=1.2)
    before = log.t < 1.2 - 1e-9
    np.testing.assert_allclose(log.x[before], clean.x[before], atol=1e-12)
    np.testing.assert_allclose(raw_labels(log, vehicle)[before], 0.0, atol=1e-9)
    if not any(isinstance(e, ActuatorEffect) and (e.state_size or e.dead_time) for e in effects):
        assert np.abs(raw_labels(log, vehicle)[~before]).max() > 1e-5
    jump = np.abs(np.diff(log.v, axis=0)).max()
    assert jump < 0.35  # [m/s]: nothing jumps but forces


def test_a_file_that_is_a_percent_off_is_so_throughout(vehicle, plan, t):
    background = SensorQuality("real", mass_off=0.01, thrust_off=-0.01).background(vehicle)
    log = fly(vehicle, plan, drawn("linear_drag", vehicle), t=t, onset=1.2, background=background)
    chi = raw_labels(log, vehicle)[: round(1.1 * 100)]
    expected = -0.01 * vehicle.mass * (log.a + [0, 0, 9.81]) - 0.01 * log.u[
        :, :1
    ] * attitude.body_z(log.q)
    np.testing.assert_allclose(chi[:, :3], expected[: len(chi)], **EXACT)


def test_a_lost_vehicle_is_said(vehicle, plan, t):
    with pytest.raises(FailedRun, match="lost"):
        fly(vehicle, plan, [LIBRARY["thrust_scale"](0.4)], t=t)


def test_the_payload_is_no_wrench_effect(vehicle):
    assert split_effects(drawn("suspended_payload", vehicle)).payload is not None
