import dataclasses as dc

import numpy as np
import pytest

from diagrams.batch.failed_run import FailedRun
from diagrams.loop import flight_result
from diagrams.loop.experiments import EXPERIMENTS, load_experiment
from diagrams.loop.flight import ARENA, load_flight
from diagrams.loop.flight_result import fly
from diagrams.loop.reality import RealityConfig
from np_drake import rigid_body
from np_drake.labels import labels
from np_drake.vehicle.vehicle import MeasurementNoise
from systems.tethered_quadrotor import PayloadConfig


def short(track="circle", kind="nominal", **changes):
    config = load_experiment(track)
    config.duration, config.reference.ramp = 2.0, 1.5
    config.controller.kind, config.controller.solver = kind, "sqp"
    for name, value in changes.items():
        setattr(config, name, value)
    return config


@pytest.fixture(scope="module")
def nominal_flight():
    return fly(short(), seed=3)


def test_same_seed_same_flight(nominal_flight):
    again = fly(short(), seed=3)
    np.testing.assert_array_equal(again.signals["x_true"], nominal_flight.signals["x_true"])
    other = fly(short(), seed=4)
    assert not np.array_equal(other.signals["x_true"], nominal_flight.signals["x_true"])


def test_log_rows_pair_each_command_with_the_acceleration_under_it():
    # Without lag, drag or noise eq. (1) holds row by row: the residual wrench is that of the cable
    # alone.
    reality = RealityConfig(
        payload=PayloadConfig(tether="none"),
        rotor_drag=0.0,
        motor_lag=0.0,
        thrust_scale=1.0,
        noise=MeasurementNoise(0, 0, 0, 0, 0, 0),
    )
    log = fly(short(reality=reality), seed=0).log()
    chi = rigid_body.residual_wrench(
        load_experiment("circle").vehicle, q=log.q, w=log.w, a=log.a, al=log.al, u=log.u
    )
    np.testing.assert_allclose(
        chi, 0.0, atol=1e-6
    )  # [N, N·m]; the instants differ by a microsecond
    wrong = rigid_body.residual_wrench(
        load_experiment("circle").vehicle,
        q=log.q,
        w=log.w,
        a=log.a,
        al=log.al,
        u=np.roll(log.u, 1, axis=0),
    )
    assert np.abs(wrong[5:]).max() > 1e-3


def test_measured_rotor_speed_does_not_give_the_lost_thrust_away(nominal_flight):
    nominal = nominal_flight.config.vehicle.thrust_coefficient * nominal_flight.log().rotor ** 2
    np.testing.assert_allclose(nominal_flight.signals["rotor_thrust"], 0.96 * nominal, rtol=1e-9)


def test_log_starts_at_zero_and_holds_a_row_a_period(nominal_flight):
    log = nominal_flight.log()
    np.testing.assert_allclose(np.diff(log.t), 0.02, atol=1e-12)
    assert len(log) == round(nominal_flight.config.end / 0.02)
    np.testing.assert_allclose(np.linalg.norm(log.q, axis=1), 1.0, atol=1e-9)


def test_labels_follow_the_true_wrench(nominal_flight, record_property):
    """Reports the label's error against the simulator's truth, per axis, after its low-pass."""
    chi = labels(
        nominal_flight.log(), nominal_flight.config.vehicle, nominal_flight.config.controller.label
    )
    rows = nominal_flight.scored
    rmse = np.sqrt(np.mean((chi - nominal_flight.chi_true)[rows] ** 2, axis=0))
    record_property("label_rmse", rmse.tolist())
    print("label error [N, N·m] x, y, z:", np.round(rmse, 4).tolist())
    # [N]: a 4 Hz low-pass of 0.2 N white noise and its delay; in z the lag's share of every thrust
    # step too.
    assert np.all(rmse[:3] < [0.16, 0.16, 0.38])
    # [N·m]: J times 0.5 rad/s² of noise, low-passed, and the share of the lag that is faster than
    # the label.
    assert np.all(rmse[3:] < [0.027, 0.027, 0.008])


@pytest.mark.parametrize("track, force", [("circle", 0.15), ("training_circle", 0.25)])
def test_online_labels_differ_from_those_of_the_log_by_the_lags_share(track, force):
    # The estimator pairs a with the command before, the log with the command after. What is left
    # after the low-pass is the change of command in a period: more of it under dither.
    flight = fly(short(track), seed=3)
    online = flight.signals["label"]
    offline = labels(flight.log(), flight.config.vehicle, flight.config.controller.label)
    difference = np.sqrt(np.mean((online - offline)[flight.scored] ** 2, axis=0))
    print(f"{track}: online minus offline label [N, N·m]:", np.round(difference, 4).tolist())
    assert np.all(difference[:3] < force)  # [N]
    assert np.all(difference[3:] < 0.02)  # [N·m]


def test_prediction_does_not_make_the_command_chatter(nominal_flight):
    def chatter(flight):
        return np.diff(flight.signals["u"][flight.scored, 0]).std()

    predicted = fly(short(kind="np"), seed=3)
    assert chatter(predicted) < 1.5 * chatter(nominal_flight)  # [N]; both are measurement noise


def test_a_residual_model_flies_better_than_none(nominal_flight):
    hold = fly(short(kind="hold"), seed=3).metrics()
    assert hold["E_z"] < 0.2 * nominal_flight.metrics()["E_z"]
    assert hold["solve_failures"] == 0


def test_the_oracle_flies_within_a_centimetre():
    m = fly(short(kind="oracle"), seed=3).metrics()
    assert m["E_xy"] < 0.01
    assert m["E_z"] < 0.005


def test_without_gap_and_payload_the_nominal_mpc_tracks():
    reality = RealityConfig(
        payload=PayloadConfig(tether="none"), rotor_drag=0.0, motor_lag=0.0, thrust_scale=1.0
    )
    m = fly(short("lemniscate", reality=reality), seed=1).metrics()
    assert m["position_rmse"] < 0.005  # [m]


@pytest.mark.parametrize("tether", ["cable", "rod", "none"])
def test_every_tether_flies(tether):
    config = short()
    config.reality.payload.tether = tether
    assert fly(config, seed=0).metrics()["E_xy"] < 0.1


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_file_loads(name):
    assert load_experiment(name).name == name


@pytest.mark.parametrize(
    "text",
    [
        "spede: 1.0",
        "duration: -1.0",
        "reality: {payload: {mass: -0.2}}",
        "reference: {track: spiral}",
        "controller: {kind: pid}",
        "controller: {mpc: {step: 0.05}}",
        "controller: {mpc: {weight_input: [1.0]}}",
        "vehicle: {mass: 0.0}",
        "duration: .inf",
        "name: ../../elsewhere",
        "simulator: {integration_scheme: magic}",
        "simulator: {max_step_size: -0.1}",
        "simulator: {max_step_size: 0.1}",
        "reference: {speed: .inf}",
        "reality: {payload: {mass: .inf}}",
        "reality: {motor_lag: 0.001}",
        "reality: {payload: {stiffness: 1.0e9}}",
        "reality: {payload: {mass: 50.0}}",
        "reality: {noise: {position: -1.0}}",
        "reality: {noise: {velocity: .nan}}",
        "{reality: {payload: {tether: rod}}, controller: {kind: oracle}}",
        "{{",
    ],
)
def test_bad_scenario_gives_one_line_with_the_file(tmp_path, text):
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    with pytest.raises(ValueError, match=r"mine\.yaml") as caught:
        load_flight(str(file))
    assert "\n" not in str(caught.value)


def test_unknown_experiment_names_the_known_ones():
    with pytest.raises(ValueError, match="circle, lemniscate"):
        load_experiment("spiral")


def test_told_mass_reaches_controller_and_truth():
    config = short(kind="hold")
    config.controller = dc.replace(config.controller, extra_mass=0.26)
    flight = fly(config, seed=3)
    assert abs(flight.chi_true[flight.scored, 2].mean()) < 1.5  # [N]; the 4 % of thrust stay


def test_below_ground_a_vehicle_is_lost():
    config = short()
    config.reference.height = 0.01  # [m]; the nominal MPC does not know of the payload and sags
    with pytest.raises(FailedRun, match="nominal flew into the ground before 1"):
        fly(config, seed=0)


def test_a_lost_vehicle_is_a_failed_run_and_no_result():
    config = short()
    config.reference.radius = 2 * ARENA
    with pytest.raises(FailedRun, match="nominal lost the vehicle before 1"):
        fly(config, seed=0)


def test_a_flight_ends_where_it_is_off_its_reference():
    with pytest.raises(FailedRun, match=r"nominal was off its reference at 1\.0 s") as caught:
        flight_result.simulate(short(), seed=0, tolerance=1e-6)  # [m]
    assert caught.value.signals["t"][-1] == pytest.approx(1.0, abs=0.03)  # [s]; a period


def test_a_predictor_trained_on_other_labels_does_not_fly():
    config = short(kind="np")
    config.controller.extra_mass = 0.26
    with pytest.raises(ValueError, match="was trained with mass"):
        fly(config, seed=0)
