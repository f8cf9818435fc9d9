"""Laws of the corrected simulator: what a diagnosis found flies, and nothing else."""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.gap.corrected import FILE, corrected_simulator, remaining_disturbance, write_corrected
from diagrams.loop.experiments import load_experiment, training_flight
from diagrams.loop.flight import default_flight, load_flight
from diagrams.loop.flight_result import fly
from diagrams.loop.reality import RealityConfig
from np_drake.diagnosis import result as an
from np_drake.effects import Downwash, LinearDrag, MassError, SuspendedPayload, ThrustScale
from np_drake.effects.base import Measurement, SensorEffect
from np_drake.effects.effect_entry import EffectEntry, Posterior
from np_drake.effects.library import LIBRARY, MEASURED_ROTORS
from np_drake.flight_log import FlightLog
from np_drake.logs.clock import shift_state
from np_drake.vehicle import Vehicle, load_vehicle
from tests.diagrams.gap.conftest import diagnosis

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


def written(found, folder, vehicle=None):
    """The scenario of a diagnosis after a trip through its file."""
    config = corrected_simulator(found, vehicle or Vehicle())
    write_corrected(config, found, folder / FILE)
    return load_flight(str(folder / FILE))


def flown(config, seconds=0.4, track="hover"):
    """Recorded states of a flight without noise."""
    quiet = dc.replace(config.reality.noise, **dict.fromkeys(dc.asdict(config.reality.noise), 0.0))
    reality = dc.replace(config.reality, noise=quiet)
    reference = dc.replace(config.reference, ramp=0.0, track=track)
    return fly(dc.replace(config, reality=reality, reference=reference, duration=seconds), seed=0)


@pytest.mark.parametrize("kind", EVERY.values(), ids=list(EVERY))
def test_every_effect_comes_back_from_the_file_as_it_was(kind, tmp_path):
    effect = odd(kind)
    drag = () if not kind.needs else (cause(LinearDrag(0.3, 0.3, 0.3)),)
    config = written(diagnosis(cause(effect), *drag), tmp_path)
    assert effect in config.reality.added
    assert len(config.reality.added) == 1 + len(drag)


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
    p, q, v, w = np.split(read.x, [3, 7, 10], axis=1)
    wanted = FlightLog(t=s["t"], p=p, q=q, v=v, w=w, u=s["u"], a=read.a, al=read.al, name="b")
    wanted = shift_state(wanted, effect.clock_shift) if effect.clock_shift else wanted
    for name in ("x", "a", "al"):
        np.testing.assert_allclose(getattr(log, name), getattr(wanted, name), atol=1e-9)
    assert (
        effect.clock_shift or np.abs(read.x - truth.x).max() + np.abs(read.a - truth.a).max() > 1e-3
    )


def test_an_effect_begins_in_flight_only_if_it_did_wherever_it_shows():
    def onset(by_flight):
        found = diagnosis(cause(ThrustScale(0.9), by_flight))
        return [e.onset for e in corrected_simulator(found, Vehicle()).reality.effects]

    assert onset({"a": 4.0, "b": 8.0, "c": np.inf}) == [6.0]
    assert onset({"a": 4.0, "b": None}) == [None]
    assert onset({"a": np.inf}) == []


def test_a_diagnosis_without_causes_gives_the_nominal_simulator(tmp_path):
    heavy = Vehicle(mass=2.5, name="mine")
    config = written(diagnosis(), tmp_path, heavy)
    assert config.reality.wrench_effects() + config.reality.actuator_effects() == []
    assert config.reality.hung.tether == "none"
    assert config.vehicle == load_vehicle(tmp_path / FILE) == heavy  # it serves as vehicle file


def test_the_file_says_intervals_and_the_onsets_of_every_flight(tmp_path):
    posterior = Posterior(["thrust_scale.scale"], [[0.01**2]])
    begins = {"a": None, "b": 3.5, "c": np.inf}
    config = written(diagnosis(cause(ThrustScale(0.9), begins), posterior=posterior), tmp_path)
    (entry,) = config.reality.effects
    assert (entry.made, entry.onsets) == (ThrustScale(0.9), {"a": 0.0, "b": 3.5, "c": np.inf})
    assert "scale: 0.9  # [1], 95 %: 0.8804 to 0.9196" in (tmp_path / FILE).read_text()


def test_what_remains_has_size_and_time_of_the_noiseless_residual():
    step, time, size, noise = 0.02, 0.5, np.array([0.3, 0.2, 0.4, 0.01, 0.02, 0.005]), 0.1
    rng, n = np.random.default_rng(1), 20000
    slow, keep = np.zeros((n, 6)), np.exp(-step / time)
    for k in range(1, n):
        slow[k] = keep * slow[k - 1] + np.sqrt(1 - keep**2) * rng.standard_normal(6)
    after = size * (slow + noise * rng.standard_normal((n, 6)))
    channels = tuple(
        an.ChannelGap(name, "", 1.0, noise * s, float(np.hypot(s, noise * s)))
        for name, s in zip(an.CHANNELS, size, strict=True)
    )
    times = {"a": step * np.arange(n)}
    found = remaining_disturbance(an.Localisation(channels, times=times, after={"a": after}))
    np.testing.assert_allclose([*found.force, *found.torque], size, rtol=1e-6)
    np.testing.assert_allclose([*found.force_time, *found.torque_time], time, rtol=0.25)


@pytest.mark.parametrize("vehicle", ["paper", "crazyflie"])
def test_a_payload_that_hangs_lower_flies_as_much_higher(vehicle, tmp_path):
    own, low = load_vehicle(vehicle), SuspendedPayload(0.01, 2.0)
    config, plain = written(diagnosis(cause(low)), tmp_path, own), default_flight(own)
    more = config.reality.hung.reach - plain.reality.hung.reach
    assert config.reference.height == pytest.approx(plain.reference.height + more)
    other = load_experiment("hover", reality=tmp_path / FILE)
    assert other.reference.height == load_experiment("hover", own).reference.height + more
    for one in (config, other, training_flight(tmp_path / FILE)):
        one.check_start()
    (tmp_path / "low.yaml").write_text("{name: low, reference: {height: 1.0}}")
    with pytest.raises(ValueError, match="shorten the tether"):
        load_experiment(str(tmp_path / "low.yaml"), reality=tmp_path / FILE).check_start()


def test_a_downwash_is_left_out_for_a_flight_to_come_has_no_neighbour(tmp_path):
    config = written(diagnosis(cause(Downwash(0.4)), cause(MassError(0.1))), tmp_path)
    said = "# Left out: downwash, which acts only beside a neighbour."
    assert said in (tmp_path / FILE).read_text()
    assert [entry.effect for entry in config.reality.effects] == ["mass_error"]
    with pytest.raises(ValueError, match="downwash must have the path of a neighbour"):
        RealityConfig(effects=[EffectEntry.of(Downwash(0.4))]).check()
