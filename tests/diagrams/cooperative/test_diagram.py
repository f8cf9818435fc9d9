import dataclasses as dc

import numpy as np
import pytest

from diagrams.batch.failed_run import FailedRun
from diagrams.cooperative.config import load_cooperative
from diagrams.cooperative.diagram import center_of_formation, make_cooperative_diagram, simulate
from diagrams.cooperative.result import CooperativeResult, fly_cooperative
from diagrams.loop.experiments import load_experiment
from systems.payload_config import PayloadConfig


def short(kind="np", fault="none", **changes):
    """Four seconds of two vehicles."""
    config = load_cooperative()
    config.vehicles, config.controller.kind, config.fault = 2, kind, fault
    config.settle, config.hover, config.transport, config.rest, config.distance = 1.6, 0.8, 1.0, 0.2, 0.1
    return dc.replace(config, **changes)


@pytest.fixture(scope="module")
def sound():
    return fly_cooperative(short(), seed=3)


def test_the_transport_is_two_metres_at_half_a_metre_a_second():
    config = load_cooperative()
    t = np.linspace(0.0, config.end, 2000)
    p, v = center_of_formation(config).sample(t)[:2]
    np.testing.assert_allclose(p[-1] - p[0], [2.0, 0, 0], atol=1e-12)  # [m]
    assert np.abs(v).max() == pytest.approx(35 / 16 * 2.0 / 9.0, rel=1e-3)
    assert np.abs(v).max() <= 0.5  # [m/s]


def test_the_stable_step_of_a_fleet_of_one_is_the_single_flights():
    single, dut = load_experiment("circle"), load_cooperative()
    dut.vehicles, dut.reality.payload = 1, PayloadConfig()
    assert dut.largest_step == pytest.approx(single.largest_step, rel=1e-12)
    dut.vehicles = 4
    assert dut.largest_step < single.largest_step  # more cables pull on the same payload


def test_a_pilot_reads_its_own_vehicle_alone():
    diagram, _ = make_cooperative_diagram(short())
    for i in range(2):
        wires = [
            (target.get_input_port(into).get_name(), source.get_output_port(out).get_name())
            for (target, into), (source, out) in diagram.connection_map().items()
            if target.get_name() == f"pilot_{i}"
        ]
        own = ("x", "acceleration", "nominal_rotor_thrust")
        assert sorted(wires) == sorted((name, f"{name}_{i}") for name in own)


def test_predicted_wrenches_carry_the_share_that_the_nominal_model_lacks(sound):
    nominal = fly_cooperative(short("nominal"), seed=3)
    for phase in ("hover", "transport"):
        assert sound.errors(phase)["E_z"] < 0.2 * nominal.errors(phase)["E_z"]
        assert sound.errors(phase)["payload_rmse"] < nominal.errors(phase)["payload_rmse"]
    assert sound.metrics()["solve_failures"] == 0


def test_in_flight_the_cables_carry_the_payload_between_them(sound):
    pull = sound.each("tether_wrench")[:, sound.rows("hover"), 2].mean(axis=1)
    weight = sound.config.reality.payload.mass * 9.81
    assert pull.sum() == pytest.approx(-weight, rel=0.03)
    np.testing.assert_allclose(pull, -weight / 2, rtol=0.1)  # [N]


def test_vehicles_stay_apart(sound):
    assert sound.metrics()["closest"] > sound.config.spacing - 0.1  # [m]


@pytest.mark.parametrize("fault", ["zero", "frozen"])
def test_the_failure_of_one_predictor_is_survived(sound, fault):
    dut = fly_cooperative(short(fault=fault), seed=3)
    before = dut.signals["t"] < dut.config.settle - 1e-9
    for i in range(2):  # same noise, same flight, up to the instant of the fault
        np.testing.assert_array_equal(dut.signals[f"x_{i}"][before], sound.signals[f"x_{i}"][before])
    chi_hat = dut.signals["chi_hat_0"][~before]
    assert (not chi_hat.any()) if fault == "zero" else np.abs(chi_hat[:, 2] - chi_hat[0, 2]).max() < 0.5
    assert np.abs(dut.signals["chi_hat_1"][~before, 2]).min() > 1.0  # [N]; the other still predicts
    metrics = dut.metrics()
    assert metrics["transport"]["excursion"] < 0.1  # [m]
    assert metrics["solve_failures"] == 0


def test_half_the_step_flies_the_same_flight():
    config = short("nominal", settle=0.2, hover=0.2, transport=0.4, distance=0.01)
    coarse = fly_cooperative(config, seed=3)
    config.simulator.max_step_size = 0.002
    fine = fly_cooperative(config, seed=3)
    np.testing.assert_allclose(coarse.p, fine.p, atol=5e-5)  # [m]
    np.testing.assert_allclose(coarse.payload, fine.payload, atol=5e-5)


def test_vehicles_that_meet_are_a_failed_run(monkeypatch):
    config = short("nominal", settle=0.1, hover=0.1, transport=0.1)
    monkeypatch.setattr("diagrams.cooperative.diagram.closest_approach", lambda p: 0.1)
    with pytest.raises(FailedRun, match=r"within 0\.10 m"):
        simulate(config, seed=0)


BAD = {
    "vehicles must be 1 to 8": {"vehicles": 9},
    "spacing must exceed 0.56": {"spacing": 0.5},
    "transport must be positive": {"transport": 0.0},
    "no controller oracle": {"kind": "oracle"},
    "fault must be": {"fault": "late"},
    "radius must be below": {"spacing": 2.5},
    "distance must be": {"distance": -1.0},
}


@pytest.mark.parametrize("message", BAD)
def test_a_scenario_that_cannot_fly_is_refused(message):
    with pytest.raises(ValueError, match=message):
        short(**BAD[message]).check()


def test_a_step_that_would_blow_the_cables_up_is_refused():
    config = short()
    config.simulator.max_step_size = 0.02
    with pytest.raises(ValueError, match="max_step_size must be at most"):
        config.check()


def test_errors_are_of_the_formations_reference(sound):
    moved = {**sound.signals, "x_0": sound.signals["x_0"].copy()}
    moved["x_0"][:, :3] = moved["p_ref_0"] + [0.03, 0.04, 0.0]
    moved["x_1"] = moved["x_1"].copy()
    moved["x_1"][:, :3] = moved["p_ref_1"]
    errors = CooperativeResult(sound.config, 3, moved, 1.0).errors("hover")
    assert errors["excursion"] == pytest.approx(0.05)  # [m]; 3, 4, 5
    assert errors["position_rmse"] == pytest.approx(0.05 / np.sqrt(2))
    assert errors["first_rmse"] == pytest.approx(0.05)
    assert errors["E_z"] == pytest.approx(0.0, abs=1e-12)
