"""Laws of flights and their scenario files."""

import dataclasses as dc
import time
import typing

import numpy as np
import pytest

from diagrams.batch.run import FailedRun
from diagrams.loop.experiments import EXPERIMENTS, load_experiment
from diagrams.loop.flight import FlightConfig, load_flight
from diagrams.loop.flight_diagram import make_flight_diagram, make_simulator, recorded
from diagrams.loop.flight_result import FlightResult, LostVehicle, fly
from diagrams.loop.reality import REAL_VEHICLE, RealityConfig
from np_drake import rigid_body
from np_drake.effects.calibration import effects_of
from np_drake.effects.effect_entry import EffectEntry
from np_drake.files.yaml_file import fields_of
from np_drake.labels import labels
from np_drake.vehicle.vehicle import Calibration, MeasurementNoise
from systems.payload_config import release
from systems.tethered_quadrotor import PayloadConfig
from tests.diagrams.loop.conftest import short

LONG = {"ramp": 1.5, "duration": 2.0}


@pytest.fixture(scope="module")
def nominal(flown):
    return flown("circle", "nominal", **LONG)


def test_same_seed_same_flight(flown):
    again = fly(short("circle", "hold"), seed=2).signals["x_true"]
    np.testing.assert_array_equal(again, flown("circle", "hold").signals["x_true"])
    assert not np.array_equal(fly(short("circle", "hold"), seed=4).signals["x_true"], again)


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
    config = short(reality=reality, ramp=0.6)
    log = fly(config, seed=0).log()

    def residual(u):
        return rigid_body.residual_wrench(config.vehicle, q=log.q, w=log.w, a=log.a, al=log.al, u=u)

    # [N, N·m]; the instants differ by a microsecond
    np.testing.assert_allclose(residual(log.u), 0.0, atol=1e-5)
    assert np.abs(residual(np.roll(log.u, 1, axis=0))[5:]).max() > 1e-3


def test_the_log_starts_at_zero_and_hides_lost_thrust(nominal):
    log, config = nominal.log(), nominal.config
    np.testing.assert_allclose(np.diff(log.t), 0.02, atol=1e-12)
    assert len(log) == round(config.end / 0.02)
    np.testing.assert_allclose(np.linalg.norm(log.q, axis=1), 1.0, atol=1e-9)
    thrust = config.vehicle.thrust_coefficient * log.rotor**2
    np.testing.assert_allclose(nominal.signals["rotor_thrust"], 0.96 * thrust, rtol=1e-9)


def test_labels_follow_the_true_wrench(nominal):
    rows, config = nominal.scored, nominal.config
    chi = labels(nominal.log(), config.vehicle, config.controller.label)
    rmse = np.sqrt(np.mean((chi - nominal.chi_true)[rows] ** 2, axis=0))
    # [N]: a 4 Hz low-pass of 0.2 N white noise and its delay; in z the lag's share of every thrust
    # step too. [N·m]: J times 0.5 rad/s² of noise, and the lag's share that is faster.
    assert np.all(rmse < [0.16, 0.16, 0.38, 0.027, 0.027, 0.008])
    # The estimator pairs a with the command before, the log with the command after.
    apart = np.sqrt(np.mean((nominal.wrench_label - chi)[rows] ** 2, axis=0))
    assert np.all(apart < [0.15, 0.15, 0.15, 0.02, 0.02, 0.02])


def test_a_residual_model_flies_better_than_none_and_the_oracle_best(nominal, flown):
    kinds = ("hold", "oracle", "payload_filter")
    hold, oracle, learned = (flown("circle", kind, **LONG) for kind in kinds)
    assert hold.metrics()["E_z"] < 0.2 * nominal.metrics()["E_z"]
    assert hold.metrics()["solve_failures"] == 0
    assert oracle.metrics()["E_xy"] < 0.01
    assert oracle.metrics()["E_z"] < 0.005

    def chatter(flight):
        return np.diff(flight.signals["u"][flight.scored, 0]).std()

    assert chatter(learned) < 1.5 * chatter(nominal)  # [N]; both are measurement noise


def test_without_gap_and_payload_the_nominal_mpc_tracks():
    reality = RealityConfig().nominal()
    reality.noise = MeasurementNoise(attitude=0.003)
    metrics = fly(short("lemniscate", reality=reality, **LONG), seed=1).metrics()
    assert metrics["position_rmse"] < 0.005  # [m]


def test_a_vehicle_that_is_lost_is_a_failed_run_and_no_result(monkeypatch):
    for height, arena, why in (
        (1e-3, 50.0, "flew into the ground before 1"),  # nominal MPC sags: its thrust is less
        (1.6, 1.0, "lost the vehicle before 1"),
    ):
        config = short("hover", duration=1.0)
        config.reference.height, config.reality.payload.tether = height, "none"
        monkeypatch.setattr("diagrams.loop.flight_result.ARENA", arena)
        with pytest.raises(FailedRun, match=f"nominal {why}"):
            fly(config, seed=0)
    monkeypatch.undo()
    with pytest.raises(LostVehicle, match=r"nominal was off its reference at 1\.0 s") as caught:
        fly(short(duration=1.0), seed=0, tolerance=1e-6)  # [m]
    assert caught.value.signals["t"][-1] == pytest.approx(1.0, abs=0.03)  # [s]; a period


@pytest.mark.parametrize("tether", ["cable", "rod"])
def test_the_payload_is_where_the_plant_has_it(tether):
    config = short(reality=RealityConfig(payload=PayloadConfig(tether=tether)))
    diagram = make_flight_diagram(config)
    root = make_simulator(diagram, config).get_mutable_context()
    plant = diagram.GetSubsystemByName(REAL_VEHICLE).GetSubsystemByName("plant")
    context = plant.GetMyMutableContextFromRoot(root)
    q = plant.GetPositions(context) + np.random.default_rng(0).normal(size=plant.num_positions())
    q[:4] /= np.linalg.norm(q[:4])
    plant.SetPositions(context, q)
    body = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName("payload"))
    flight = FlightResult(
        config, 0, {"plant_state": plant.GetPositionsAndVelocities(context)[None]}
    )
    np.testing.assert_allclose(flight.payload_position[0], body.translation(), atol=1e-12)


def test_a_payload_below_the_ground_is_told_with_time_and_depth():
    config = short("hover", duration=0.5)
    config.reference.height = config.reality.payload.reach + 0.01  # less than the vehicle sags [m]
    flight = fly(config, seed=0)
    lowest = flight.payload_position[:, 2] - config.reality.payload.radius
    time, depth = flight.below_ground["time"], flight.below_ground["depth"]
    assert depth == pytest.approx(-lowest.min())
    assert lowest[flight.signals["t"] < time].min() >= 0
    assert f"below the ground from {time:.2f} s on" in flight.warnings()[0]
    assert flight.metrics()["payload_below_ground"] == {"time": time, "depth": depth}
    free = dc.replace(config, events=[release(0.02)])  # what is let go may fall
    assert fly(free, seed=0).below_ground is None
    config.reference.height -= 0.02
    with pytest.raises(ValueError, match=r"is 0\.01 m below it.*shorten the tether"):
        fly(config)


def test_every_experiment_file_loads_and_others_are_refused():
    assert [load_experiment(name).name for name in EXPERIMENTS] == [*EXPERIMENTS]
    with pytest.raises(ValueError, match="circle, lemniscate"):
        load_experiment("spiral")


@pytest.mark.parametrize(
    "text",
    [
        "spede: 1.0",
        "controller: {mpc: {step: 0.05}}",
        "controller: {kind: np, parameters: {gain: 1.0}}",
        "name: ../../elsewhere",
        "simulator: {integration_scheme: magic}",
        "reality: {motor_lag: 0.001}",
        "reality: {payload: {mass: 50.0}}",
        "{reality: {payload: {tether: rod}}, controller: {kind: oracle}}",
        "{{",
    ],
)
def test_a_bad_scenario_gives_one_line_with_the_file(tmp_path, text):
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    with pytest.raises(ValueError, match=r"mine\.yaml") as caught:
        load_flight(str(file))
    assert "\n" not in str(caught.value)


def numbers(kind, default, path=()):
    """Path and default of every number, and list of numbers, of a scenario."""
    for field, inner in fields_of(kind).items():
        value, parts = getattr(default, field, None), typing.get_args(inner)
        if type(None) in parts:
            inner = parts[0]
        if fields_of(inner):
            yield from numbers(inner, value, (*path, field))
        elif inner in (float, int, list[float], list[int]):
            yield (*path, field), value


def test_no_absurd_number_of_any_field_is_flown(tmp_path):
    file = tmp_path / "s.yaml"
    for path, value in numbers(FlightConfig, FlightConfig()):
        for absurd in (".nan", ".inf", "-.inf", "1e300", "-1e300", "1e16"):
            if absurd == ".inf" and value == np.inf:
                continue
            rest = [str(float(v)) for v in np.ravel(value)[1:]] if isinstance(value, list) else None
            text = absurd if rest is None else f"[{', '.join([absurd, *rest])}]"
            lines = ["  " * i + f"{name}:" for i, name in enumerate(path)]
            file.write_text("\n".join(lines) + f" {text}\n")
            with pytest.raises(ValueError, match=rf"s\.yaml: not a scenario.*{path[-1]}") as found:
                load_flight(str(file))
            assert "\n" not in str(found.value)


@pytest.mark.parametrize(
    "text, field",
    [
        ("duration: 1e9", "duration"),
        ("controller: {mpc: {horizon: 100000}}", "horizon"),
        ("controller: {period: 1e-9}", "period"),
        ("simulator: {max_step_size: 1e-12}", "step"),
    ],
)
def test_no_flight_takes_forever_or_the_whole_memory(tmp_path, text, field):
    (tmp_path / "s.yaml").write_text(text)
    start = time.process_time()
    with pytest.raises(ValueError, match=field):
        load_flight(str(tmp_path / "s.yaml"))
    assert time.process_time() - start < 5.0  # [s]


def test_the_data_frame_of_a_flight_holds_log_reference_and_truth(flown):
    flight = flown("circle", "hold")
    frame = flight.to_dataframe()
    np.testing.assert_array_equal(frame[["px_ref", "py_ref", "pz_ref"]], flight.signals["p_ref"])
    np.testing.assert_array_equal(frame["fz_true"], flight.chi_true[:, 2])
    np.testing.assert_array_equal(frame["fz_predicted"], flight.signals["chi_hat"][:, 2])
    np.testing.assert_array_equal(frame["px"], flight.log().p[:, 0])


@pytest.mark.parametrize("name", ["attach", "circle"])
def test_a_plain_simulator_flies_the_experiment(name):
    config = short(name, "hold", duration=0.6)
    config.events = [dc.replace(event, time=0.5) for event in config.events]
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
