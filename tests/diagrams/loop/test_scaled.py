"""Scenarios for any vehicle: the paper's keeps its values, and similar vehicles fly alike."""

import dataclasses as dc

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator

from diagrams.loop.experiments import EXPERIMENTS, load_experiment
from diagrams.loop.flight import FlightConfig, default_flight, load_flight
from diagrams.loop.flight_diagram import set_initial_state
from diagrams.loop.flight_result import fly
from diagrams.loop.real_vehicle import make_real_vehicle
from np_drake.command_delay import LONGEST_DELAY
from np_drake.references.config import make_reference
from np_drake.vehicle.scaling import SPARE_LIFT, ratios, scales, similar
from np_drake.vehicle.vehicle import Calibration, MeasurementNoise, Vehicle, load_vehicle

SMALL = Vehicle(
    name="small",
    mass=0.035,
    inertia=[[1.7e-5, 0.0, 0.0], [0.0, 1.7e-5, 0.0], [0.0, 0.0, 2.9e-5]],
    rotor_positions=[
        [0.0325, 0.0325, 0.0],
        [0.0325, -0.0325, 0.0],
        [-0.0325, -0.0325, 0.0],
        [-0.0325, 0.0325, 0.0],
    ],
    thrust_coefficient=1.7e-8,
    torque_coefficient=1.0e-10,
    rotor_radius=0.023,
    max_rotor_thrust=0.15,
)
LARGE = Vehicle(
    name="large",
    mass=20.0,
    inertia=[[1.2, 0.0, 0.0], [0.0, 1.2, 0.0], [0.0, 0.0, 2.2]],
    rotor_positions=[[0.5, 0.5, 0.0], [0.5, -0.5, 0.0], [-0.5, -0.5, 0.0], [-0.5, 0.5, 0.0]],
    thrust_coefficient=4.0e-4,
    torque_coefficient=1.0e-5,
    rotor_radius=0.36,
    max_rotor_thrust=100.0,
)


def plain(config: FlightConfig) -> dict:
    parts = {
        f.name: getattr(config, f.name)
        for f in dc.fields(config)
        if f.name not in ("simulator", "scaled")
    }
    values = {
        name: dc.asdict(part) if dc.is_dataclass(part) else part for name, part in parts.items()
    }
    simulator = config.simulator
    return values | {"simulator": (simulator.integration_scheme, simulator.max_step_size)}


def without_noise(config: FlightConfig) -> FlightConfig:
    config.reality.noise = MeasurementNoise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return config


def swing(config: FlightConfig, seconds: float, samples: int) -> np.ndarray:
    """Return the plant's state (samples, 26) of a flight under hover thrust with a payload that
    swings.
    """
    vehicle = make_real_vehicle(config.vehicle, config.reality)
    simulator = Simulator(vehicle)
    ApplySimulatorConfig(config.simulator, simulator)
    context = simulator.get_mutable_context()
    plant = vehicle.GetSubsystemByName("plant")
    own = plant.GetMyMutableContextFromRoot(context)
    weight = config.carried_mass * config.vehicle.gravity / config.reality.thrust_scale
    vehicle.GetInputPort("u").FixValue(context, [1.001 * weight, 0.0, 0.0, 0.0])
    state = plant.GetPositionsAndVelocities(own)
    length = config.reality.payload.length
    state[: 3 + 1] = [1.0, 0.0, 0.0, 0.0]
    state[7:14] = [
        1.0,
        0.0,
        0.0,
        0.0,
        0.6 * length,
        0.0,
        -0.8 * length + config.reality.payload.hook[2],
    ]
    plant.SetPositionsAndVelocities(own, state)
    rows = []
    for k in range(samples):
        simulator.AdvanceTo((k + 1) * seconds / samples)
        rows.append(plant.GetPositionsAndVelocities(own))
    return np.array(rows)


def dimensionless(config: FlightConfig, state: np.ndarray) -> np.ndarray:
    """Return the plant's state in units of the vehicle."""
    unit = scales(config.vehicle)
    angle, place = np.ones(4), np.full(3, unit.length)
    rate, speed = np.full(3, 1 / unit.time), np.full(3, unit.speed)
    return state / np.concatenate([angle, place, angle, place, rate, speed, rate, speed])


def test_the_default_scenario_of_the_papers_vehicle_is_bit_identical():
    assert plain(default_flight(Vehicle())) == plain(FlightConfig())


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_packaged_scenarios_stand_in_si_for_the_papers_vehicle(name, tmp_path):
    from diagrams.loop.experiments import FOLDER

    text = (FOLDER / f"{name}.yaml").read_text().replace("scaled: true\n", "")
    (tmp_path / "own.yaml").write_text(text)
    assert plain(load_experiment(name)) == plain(load_flight(str(tmp_path / "own.yaml")))


@pytest.mark.parametrize("vehicle", [SMALL, LARGE])
def test_the_cable_stretches_by_one_share_of_its_length_under_any_payload(vehicle):
    shares = []
    for payload, g in (
        (FlightConfig().reality.payload, 9.81),
        (default_flight(vehicle).reality.payload, 9.81),
    ):
        shares.append(payload.mass * g / (payload.stiffness * payload.length))
    assert shares[1] == pytest.approx(shares[0], rel=1e-12)  # [1]


@pytest.mark.parametrize("vehicle", [SMALL, LARGE])
def test_the_step_resolves_the_cable_of_any_vehicle_alike(vehicle):
    paper, dut = FlightConfig(), default_flight(vehicle)
    share = dut.simulator.max_step_size / dut.largest_step
    assert share == pytest.approx(
        paper.simulator.max_step_size / paper.largest_step, rel=0.08
    )  # hook lever, lift


def test_the_payload_leaves_a_weak_vehicle_spare_lift():
    weak = dc.replace(Vehicle(), max_rotor_thrust=1.3 * 19.62 / 4)
    payload = default_flight(weak).check().reality.payload
    assert payload.mass == pytest.approx(SPARE_LIFT * 0.3 * weak.mass)


@pytest.mark.parametrize("vehicle", [SMALL, LARGE])
@pytest.mark.parametrize("name", ["fast_lemniscate", "steps", "vertical"])
def test_a_track_has_the_same_form_in_the_units_of_any_vehicle(name, vehicle):
    paper, own = load_experiment(name).reference, load_experiment(name, vehicle).reference
    unit, t = ratios(vehicle), np.linspace(0.0, 20.0, 101)
    expected = make_reference(paper).sample(t)
    found = make_reference(own).sample(unit.time * t)
    np.testing.assert_allclose(found[0] / unit.length, expected[0], atol=1e-9)
    np.testing.assert_allclose(
        found[2], expected[2], atol=1e-7
    )  # accelerations: gravity is common [m/s²]


def test_the_fast_lemniscate_reaches_3_m_per_s():
    flat = make_reference(load_experiment("fast_lemniscate").reference).sample(
        np.linspace(5.0, 20.0, 20001)
    )
    assert np.linalg.norm(flat[1], axis=1).max() == pytest.approx(3.0, abs=1e-3)


@pytest.mark.parametrize("delay, known", [(0.004, 0.004), (0.5, None)], ids=str)
def test_the_controller_knows_the_delay_of_the_file_within_its_limit(delay, known):
    vehicle = dc.replace(load_vehicle("crazyflie"), calibration=Calibration(command_delay=delay))
    dut = default_flight(vehicle).check().controller
    assert dut.command_delay == pytest.approx(known or LONGEST_DELAY * dut.period)


def test_a_value_named_in_si_wins_over_the_scaled_default(tmp_path):
    (tmp_path / "own.yaml").write_text(
        "reference: {radius: 0.5}\nreality: {payload: {length: 0.3}}\n"
    )
    dut = load_flight(str(tmp_path / "own.yaml"), SMALL)
    assert (dut.reference.radius, dut.reality.payload.length) == (0.5, 0.3)
    assert dut.reference.height == pytest.approx(1.6 * ratios(SMALL).length)
    assert dut.vehicle == SMALL


def test_the_vehicle_of_the_file_sets_its_own_scale(tmp_path):
    (tmp_path / "own.yaml").write_text("vehicle: {mass: 1.0, max_rotor_thrust: 6.0}\n")
    dut = load_flight(str(tmp_path / "own.yaml"))
    assert dut.reality.payload.mass == pytest.approx(0.13)
    assert dut.reference.radius == 1.0


@pytest.mark.parametrize("length", [0.25, 4.0])
def test_similar_vehicles_swing_alike_without_a_controller(length):
    paper, dut = default_flight(Vehicle()), default_flight(similar(Vehicle(), length))
    seconds, time = 1.0, np.sqrt(length)
    expected = dimensionless(paper, swing(paper, seconds, 10))
    found = dimensionless(dut, swing(dut, seconds * time, 10))
    # All factors are powers of two, so that only cubes of lengths and sums of unlike roundings
    # differ.
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("length", [0.25, 4.0])
def test_similar_vehicles_fly_the_same_dimensionless_circle(length):
    errors = []
    for vehicle in (Vehicle(), similar(Vehicle(), length)):
        config = without_noise(load_experiment("circle", vehicle))
        config.duration = 1.0 * ratios(vehicle).time
        config.controller.kind, config.controller.solver = "hold", "sqp"
        flight, unit = fly(config, seed=0), scales(vehicle)
        errors.append((flight.signals["x_true"][:, :3] - flight.signals["p_ref"]) / unit.length)
    np.testing.assert_allclose(
        errors[1], errors[0], rtol=0, atol=1e-6
    )  # [1]: the feed-forward's step in time is fixed


@pytest.mark.parametrize("vehicle", [SMALL, LARGE])
def test_any_vehicle_flies_the_circle_out_of_the_box(vehicle):
    config = load_experiment("circle", vehicle)
    config.duration = 2.0 * ratios(vehicle).time
    config.controller.kind, config.controller.solver = "hold", "sqp"
    errors = fly(config, seed=0).metrics()
    assert max(errors["E_xy"], errors["E_z"]) < 0.1 * scales(vehicle).length
    assert errors["fallbacks"] == 0


def test_the_start_is_at_rest_for_any_vehicle():
    from diagrams.loop.flight_diagram import make_flight_diagram

    config = without_noise(load_experiment("hover", SMALL))
    diagram = make_flight_diagram(config)
    context = diagram.CreateDefaultContext()
    set_initial_state(diagram, context, config)
    vehicle = diagram.GetSubsystemByName("tethered_quadrotor")
    wrench = vehicle.GetOutputPort("tether_wrench").Eval(vehicle.GetMyContextFromRoot(context))
    weight = config.reality.payload.mass * SMALL.gravity
    assert wrench[2] == pytest.approx(-weight, rel=1e-6)  # [N]
