"""Laws of the corrected simulator: what a diagnosis found flies, and nothing else."""

import dataclasses as dc

import numpy as np
import pytest
import yaml
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from diagrams.gap.corrected import (
    FILE,
    corrected_simulator,
    drawn,
    remaining_disturbance,
    write_corrected,
)
from diagrams.loop.flight import default_flight, load_flight
from diagrams.loop.flight_result import fly
from diagrams.loop.reality import RealityConfig, make_real_vehicle
from np_drake.diagnosis import result as an
from np_drake.diagnosis.residuals import residual_parts
from np_drake.effects.base import Measurement, SensorEffect
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.combine import split_effects
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.downwash import Downwash
from np_drake.effects.effect_entry import EffectEntry, Posterior
from np_drake.effects.library import LIBRARY, MEASURED_ROTORS
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.flight_log import FlightLog
from np_drake.logs.clock import shift_state
from np_drake.rigid_body import residual_wrench
from np_drake.vehicle import Vehicle, load_vehicle
from systems.payload_config import PayloadConfig, as_light, payload_config
from systems.tethered_quadrotor import make_tethered_quadrotor

EVERY = LIBRARY | MEASURED_ROTORS
RNG = np.random.default_rng(40)


def odd(kind):
    """The effect at numbers that no decimal writes exactly."""
    values = {}
    for p in kind.parameters:
        value = p.neutral + p.typical * np.exp(0.3 * RNG.standard_normal()) / 3
        values[p.name] = p.choices[-1] if p.choices else float(np.clip(value, p.lower, p.upper))
    return kind.of(values)


def cause(effect, onset=None, probability=0.97, deviation=0.01):
    estimates = {
        name: an.Estimate(value, "", (value - 1.96 * deviation, value + 1.96 * deviation))
        for name, value in effect.values.items()
    }
    return an.Cause(effect.identifier, probability, estimates, onset or {"a": None}, effect=effect)


def diagnosis(*causes, where=None, posterior=None):
    nothing = an.Identifiability(True, {}, {}, ())
    gap_reduction = an.GapReduction(1.0, 1.0, 1.0, 0.0, (0.0, 0.0), ())
    verdict = tuple(c.identifier for c in causes)
    located = residual_parts.Localisation(()) if where is None else where
    return an.Diagnosis(
        "paper",
        ("a",),
        ("b",),
        verdict,
        causes,
        nothing,
        located,
        gap_reduction,
        posterior=posterior,
    )


def written(found, folder, vehicle=None):
    """The scenario of a diagnosis after a trip through its file."""
    config = corrected_simulator(found, vehicle or Vehicle())
    write_corrected(config, found, folder / FILE)
    return load_flight(str(folder / FILE))


def flown(config, seconds=0.4, track="hover"):
    """Recorded states of a flight without noise."""
    quiet = dc.replace(config.reality.noise, **dict.fromkeys(dc.asdict(config.reality.noise), 0.0))
    reference = dc.replace(config.reference, ramp=0.0, track=track)
    config = dc.replace(
        config, reality=dc.replace(config.reality, noise=quiet), reference=reference
    )
    config = dc.replace(config, duration=seconds)
    config.controller.solver = "sqp"
    return fly(config, seed=0)


@pytest.mark.parametrize("kind", EVERY.values(), ids=list(EVERY))
def test_every_effect_comes_back_from_the_file_as_it_was(kind, tmp_path):
    effect = odd(kind)
    drag = () if not kind.needs else (cause(LinearDrag(0.3, 0.3, 0.3)),)
    config = written(diagnosis(cause(effect), *drag), tmp_path)
    assert effect in config.reality.added
    assert len(config.reality.added) == 1 + len(drag)


def residuals(diagram, vehicle, seconds=0.3):
    """Residual wrench of a flight along a fixed command, at every hundredth of a second, (n, 6) [N,
    N·m].
    """
    simulator = Simulator(diagram)
    fine = SimulatorConfig(
        integration_scheme="runge_kutta3", max_step_size=5e-4, use_error_control=False
    )
    ApplySimulatorConfig(fine, simulator)
    context = simulator.get_mutable_context()
    plant = diagram.GetSubsystemByName("plant")
    own, quadrotor = plant.GetMyMutableContextFromRoot(context), plant.GetBodyByName("quadrotor")
    lift = (
        3.0 if plant.num_bodies() > 2 else 0.6
    )  # low, so that the ground is felt; a payload hangs free
    plant.SetFreeBodyPose(own, quadrotor, RigidTransform([0.0, 0.0, lift]))
    plant.SetFreeBodySpatialVelocity(
        quadrotor, SpatialVelocity([0.3, 0.2, -0.1], [1.0, 1.5, -0.5]), own
    )
    if plant.num_bodies() > 2:
        plant.SetFreeBodyPose(
            own, plant.GetBodyByName("payload"), RigidTransform([0.1, 0.0, lift - 0.79])
        )
    rows = []
    for k in range(round(100 * seconds)):
        u = vehicle.hover_input * (1.03 + 0.05 * (k >= 10)) + [0.0, 0.01, -0.02, 0.003]
        diagram.GetInputPort("u").FixValue(context, u)
        simulator.AdvanceTo(0.01 * k + 0.002)  # soon after a new command, so that a delay shows
        x, a = (diagram.GetOutputPort(name).Eval(context) for name in ("x", "acceleration"))
        rows.append(residual_wrench(vehicle, q=x[3:7], w=x[10:13], a=a[:3], al=a[3:], u=u))
        simulator.AdvanceTo(0.01 * (k + 1))
    return np.array(rows)


BODILY = [kind for kind in EVERY.values() if not issubclass(kind, SensorEffect)]


@pytest.mark.parametrize("kind", BODILY, ids=lambda kind: kind.identifier)
def test_every_bodily_effect_of_the_file_leaves_the_same_residual_in_drake(kind, tmp_path):
    vehicle, effects = Vehicle(), [odd(kind)]
    effects += [LinearDrag(0.3, 0.3, 0.3)] if kind.needs else []
    config = written(diagnosis(*map(cause, effects)), tmp_path, vehicle)
    parts = split_effects(effects)
    given = make_tethered_quadrotor(
        vehicle,
        as_light(payload_config(parts.payload)),
        wrench_effects=parts.wrench,
        actuator_effects=parts.actuator,
        mass_effects=parts.mass,
    )
    found = residuals(make_real_vehicle(config.vehicle, config.reality), config.vehicle)
    np.testing.assert_allclose(found, residuals(given, vehicle), atol=1e-6)
    assert np.abs(found).max() > 1e-4  # it acts [N, N·m]


@pytest.mark.parametrize(
    "kind", [k for k in EVERY.values() if issubclass(k, SensorEffect)], ids=lambda k: k.identifier
)
def test_every_sensor_error_of_the_file_is_in_the_log_of_a_flight(kind, tmp_path):
    effect = odd(kind)
    flight = flown(written(diagnosis(cause(effect)), tmp_path))
    s, log = flight.signals, flight.log()
    truth = Measurement(
        s["x_true"], s["acceleration_true"][:, :3], s["acceleration_true"][:, 3:], s["rotor_speed"]
    )
    read = effect.measure(Vehicle(), truth, np.zeros(0))
    wanted = FlightLog(
        t=s["t"],
        p=read.x[:, :3],
        q=read.x[:, 3:7],
        v=read.x[:, 7:10],
        w=read.x[:, 10:],
        u=s["u"],
        a=read.a,
        al=read.al,
        rotor=read.rotor,
        name="b",
    )
    wanted = shift_state(wanted, effect.clock_shift) if effect.clock_shift else wanted
    for name in ("x", "a", "al"):
        np.testing.assert_allclose(getattr(log, name), getattr(wanted, name), atol=1e-9)
    assert (
        len(wanted.t) < len(s["t"])
        or np.abs(wanted.x - truth.x).max() + np.abs(wanted.a - truth.a).max() > 1e-3
    )


@pytest.mark.parametrize(
    "effect",
    [
        LinearDrag(0.9, 0.9, 0.9),
        ThrustScale(0.9),
        MotorLag(0.08),
        CommandDelay(0.03),
        MassError(0.3),
        CenterOfMassOffset(0.01, 0.0, 0.0),
        SuspendedPayload(0.3, 0.7),
    ],
    ids=lambda effect: effect.identifier,
)
def test_an_effect_with_an_onset_begins_at_it(effect, tmp_path):
    begins, plain = (
        flown(written(found, tmp_path), 0.8, track="circle").signals
        for found in (diagnosis(cause(effect, {"a": 0.3})), diagnosis())
    )
    before = begins["t"] < 0.3 - 1e-9
    np.testing.assert_allclose(begins["x_true"][before], plain["x_true"][before], atol=1e-6)
    assert np.abs(begins["x_true"][~before] - plain["x_true"][~before]).max() > 1e-4


def test_the_lag_of_the_file_takes_over_from_the_vehicles_at_its_onset():
    vehicle = Vehicle(rotor_time_constant=0.02)
    late, slow = MotorLag(0.2), MotorLag(0.02)

    def thrust(effects, onsets, t):
        diagram = make_tethered_quadrotor(
            vehicle, PayloadConfig(tether="none"), actuator_effects=effects, onsets=onsets
        )
        simulator = Simulator(diagram)
        context = simulator.get_mutable_context()
        diagram.GetInputPort("u").FixValue(context, 1.2 * vehicle.hover_input)
        simulator.AdvanceTo(t)
        return diagram.GetOutputPort("rotor_thrust").Eval(context)

    np.testing.assert_allclose(
        thrust([late], {late: 0.05}, 0.04), thrust([slow], {}, 0.04), rtol=1e-3
    )
    np.testing.assert_allclose(
        thrust([late], {late: 0.05}, 0.1), thrust([late], {}, 0.1), rtol=1e-3
    )


def test_an_effect_begins_in_flight_only_if_it_did_wherever_it_shows():
    def onset(by_flight):
        entry = corrected_simulator(
            diagnosis(cause(ThrustScale(0.9), by_flight)), Vehicle()
        ).reality.effects
        return [e.onset for e in entry]

    assert onset({"a": 4.0, "b": 8.0, "c": np.inf}) == [6.0]
    assert onset({"a": 4.0, "b": None}) == [None]
    assert onset({"a": np.inf}) == []


def test_a_diagnosis_without_causes_gives_the_nominal_simulator(tmp_path):
    config = written(diagnosis(), tmp_path)
    assert config.reality.wrench_effects() == []
    assert config.reality.actuator_effects() == []
    assert config.reality.hung.tether == "none"
    assert config.vehicle == Vehicle()


def test_a_second_answer_has_a_simulator_of_its_own():
    first, second = diagnosis(cause(ThrustScale(0.9))), diagnosis(cause(MassError(0.2)))
    both = dc.replace(first, refit=second)
    assert corrected_simulator(both, Vehicle()).reality.added == [ThrustScale(0.9)]
    assert corrected_simulator(both.refit, Vehicle()).reality.added == [MassError(0.2)]


def test_the_file_serves_as_vehicle_file(tmp_path):
    heavy = Vehicle(mass=2.5, name="mine")
    written(diagnosis(cause(MassError(0.2))), tmp_path, heavy)
    assert load_vehicle(tmp_path / FILE) == heavy  # nominal, as its labels are


def test_the_file_serves_drake_replay_with_the_onsets_of_every_flight(tmp_path):
    config = written(
        diagnosis(cause(ThrustScale(0.9), {"a": None, "b": 3.5, "c": np.inf})), tmp_path
    )
    assert config.reality.by_flight == [(ThrustScale(0.9), {"a": 0.0, "b": 3.5, "c": np.inf})]


def test_the_file_says_the_interval_of_every_parameter(tmp_path):
    posterior = Posterior(["thrust_scale.scale"], [[0.01**2]])
    written(diagnosis(cause(ThrustScale(0.9)), posterior=posterior), tmp_path)
    assert "scale: 0.9  # [1], 95 %: 0.8804 to 0.9196" in (tmp_path / FILE).read_text()


def test_draws_have_the_posteriors_mean_and_covariance():
    C = np.array([[0.01**2, 0.6e-4 * 0.5], [0.6e-4 * 0.5, 0.006**2]])
    posterior = Posterior(["thrust_scale.scale", "mass_error.delta_mass"], C.tolist())
    found = diagnosis(
        *(cause(e, probability=1.0) for e in (ThrustScale(0.9), MassError(0.1))),
        posterior=posterior,
    )
    sets = [c.reality.added for c in drawn(corrected_simulator(found, Vehicle()), 2000, seed=3)]
    values = np.array([[thrust.scale, mass.delta_mass] for thrust, mass in sets])
    np.testing.assert_allclose(values.mean(axis=0), [0.9, 0.1], atol=1e-3)
    np.testing.assert_allclose(np.cov(values.T), C, rtol=0.1, atol=2e-6)


def test_an_uncertain_effect_is_in_its_share_of_draws_and_wind_needs_drag():
    drag, wind = (
        EffectEntry.of(LinearDrag(0.3, 0.3, 0.3), probability=0.5),
        EffectEntry("constant_wind"),
    )
    generator = np.random.default_rng(0)
    sets = [{e.effect for e in Posterior().draw([drag, wind], generator)} for _ in range(1000)]
    assert set(map(frozenset, sets)) == {frozenset(), frozenset({"linear_drag", "constant_wind"})}
    assert np.mean([bool(s) for s in sets]) == pytest.approx(0.5, abs=0.05)


def test_a_draw_stays_within_physical_bounds():
    posterior = Posterior(["motor_lag.time_constant"], [[1.0]])
    sets = [
        posterior.draw([EffectEntry.of(MotorLag(0.05))], np.random.default_rng(k))
        for k in range(50)
    ]
    (bounds,) = MotorLag.parameters
    assert all(bounds.lower <= e.made.time_constant <= bounds.upper for (e,) in sets)


def test_without_a_posterior_nothing_can_be_drawn():
    config = dc.replace(default_flight(Vehicle()), name="mine")
    with pytest.raises(ValueError, match="mine: there must be a posterior"):
        drawn(config, 2, seed=0)


def test_what_remains_has_size_and_time_of_the_noiseless_residual():
    step, time, size, noise = 0.02, 0.5, np.array([0.3, 0.2, 0.4, 0.01, 0.02, 0.005]), 0.1
    rng, n = np.random.default_rng(1), 20000
    slow, keep = np.zeros((n, 6)), np.exp(-step / time)
    for k in range(1, n):
        slow[k] = keep * slow[k - 1] + np.sqrt(1 - keep**2) * rng.standard_normal(6)
    after = size * (slow + noise * rng.standard_normal((n, 6)))
    channels = tuple(
        residual_parts.ChannelGap(name, "", 1.0, noise * s, float(np.hypot(s, noise * s)), 0.0)
        for name, s in zip(residual_parts.CHANNELS, size, strict=True)
    )
    where = residual_parts.Localisation(
        channels, times={"a": step * np.arange(n)}, after={"a": after}
    )
    found = remaining_disturbance(where)
    np.testing.assert_allclose([*found.force, *found.torque], size, rtol=1e-6)
    np.testing.assert_allclose([*found.force_time, *found.torque_time], time, rtol=0.25)


@pytest.mark.parametrize(
    "line, says",
    [
        ("{effect: linear_drug}", "did you mean linear_drag"),
        ("{effect: linear_drag, parameters: {d: 1.0}}", "no parameter d; it has d_x, d_y, d_z"),
        (
            "{effect: thrust_scale, parameters: {scale: .nan}}",
            "parameters.scale must be a number; got nan",
        ),
        ("{effect: gyro_bias, onset: 2.0}", "acts from the start"),
        ("{effect: thrust_scale, onset: -2.0}", "onset must be finite and not negative [s]"),
        ("{effect: thrust_scale, probability: 2.0}", "0 to 1"),
        ("{effect: thrust_scale, parameters: 3}", "names with their values"),
        ("{effect: suspended_payload}", "there must be one payload"),
    ],
)
def test_a_bad_entry_is_refused_in_one_line_with_the_remedy(line, says, tmp_path):
    scenario = tmp_path / "mine.yaml"
    scenario.write_text(f"name: mine\nreality: {{effects: [{line}]}}\n")
    with pytest.raises(ValueError, match="not a scenario file") as error:
        load_flight(str(scenario))
    assert says in str(error.value)
    assert "\n" not in str(error.value)


def test_the_written_file_is_plain_yaml(tmp_path):
    written(diagnosis(cause(odd(SuspendedPayload))), tmp_path)
    assert yaml.safe_load((tmp_path / FILE).read_text())["reality"]["payload"] == {"tether": "none"}


def test_a_downwash_is_left_out_for_a_flight_to_come_has_no_neighbour(tmp_path):
    config = written(diagnosis(cause(Downwash(0.4)), cause(MassError(0.1))), tmp_path)
    assert (
        "# Left out: downwash, which acts only beside a neighbour." in (tmp_path / FILE).read_text()
    )
    assert [entry.effect for entry in config.reality.effects] == ["mass_error"]
    with pytest.raises(ValueError, match="downwash must have the path of a neighbour"):
        RealityConfig(effects=[EffectEntry.of(Downwash(0.4))]).check()
