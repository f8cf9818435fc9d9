"""Laws of drawn flights: ranges, intervals of a vehicle file, posterior of causes."""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.certify.ranges import Range, drawn_flight, drawn_vehicle, spread_of
from diagrams.loop.experiments import load_experiment
from np_drake.effects import MassError, ThrustScale
from np_drake.effects.disturbance import DisturbanceConfig
from np_drake.effects.effect_entry import EffectEntry, Posterior
from np_drake.vehicle import Vehicle
from np_drake.vehicle.published import published_priors

KNOWN = {
    "mass": [[1.8, 2.2]],
    "thrust_coefficient": [[0.9e-5, 1.1e-5]],
    "inertia[0][0]": [[0.018, 0.022]],
    "inertia[0][1]": [[-0.001, 0.001]],
    "calibration.rotor_gains": [[0.95, 1.05]] * 4,
    "torque_coefficient": [[1.5e-7, 1.7e-7]],
}
VEHICLE = dc.replace(Vehicle(), intervals=KNOWN).check()
NAMES = ["thrust_scale.scale", "mass_error.delta_mass"]
C = np.array([[0.01**2, 0.3e-4], [0.3e-4, 0.006**2]])


def corrected():
    config = load_experiment("circle")
    entries = [EffectEntry.of(ThrustScale(0.9)), EffectEntry.of(MassError(0.1))]
    reality = dc.replace(
        config.reality,
        effects=entries,
        posterior=Posterior(NAMES, C.tolist()),
        disturbance=DisturbanceConfig([0.1] * 3, [0.01] * 3),
    )
    return dc.replace(config, reality=reality)


def test_numbers_of_a_vehicle_are_normal_within_their_intervals():
    rng, spread = np.random.default_rng(0), spread_of(VEHICLE)
    drawn = [drawn_vehicle(VEHICLE, spread, rng) for _ in range(2000)]
    masses = np.array([vehicle.mass for vehicle, _ in drawn])
    assert masses.mean() == pytest.approx(2.0, abs=0.01)
    assert masses.std() == pytest.approx(0.2 / 1.96, rel=0.06)
    thrust = np.array([values["thrust_scale"] for _, values in drawn])
    assert thrust.std() == pytest.approx(0.1 / 1.96, rel=0.06)
    for vehicle, _ in drawn[:50]:
        np.testing.assert_array_equal(vehicle.J, vehicle.J.T)
        assert np.mean(vehicle.calibration.rotor_gains) == pytest.approx(1.0)
        # what a simulated vehicle does not have by itself stays
        assert vehicle.thrust_coefficient == VEHICLE.thrust_coefficient


def test_intervals_in_which_no_vehicle_can_be_are_refused():
    with pytest.raises(ValueError, match="its intervals hold no vehicle that can be"):
        drawn_vehicle(Vehicle(), {"mass": 1e6}, np.random.default_rng(0))


def test_the_controller_assumes_the_file_and_another_vehicle_flies():
    config = dc.replace(load_experiment("circle"), vehicle=VEHICLE)
    flight, values = drawn_flight(config, (), (), seed=(3,))
    assert flight.controller.believed(flight.vehicle) == VEHICLE
    assert flight.vehicle.mass == values["mass"] != VEHICLE.mass
    whole = config.reality.thrust_scale * values["thrust_scale"]
    assert flight.reality.thrust_scale == pytest.approx(whole)


def test_rotors_without_a_stated_lag_lag_as_published_ones():
    config, prior = dc.replace(load_experiment("circle"), vehicle=VEHICLE), published_priors()
    assert drawn_flight(config, (), (), seed=(0,))[0].reality.motor_lag == config.reality.motor_lag
    config = dc.replace(config, reality=dc.replace(config.reality, motor_lag=0.0))
    logs = np.log([drawn_flight(config, (), (), seed=(k,))[1]["motor_lag"] for k in range(300)])
    assert logs.mean() == pytest.approx(prior.time_constant.mean, abs=0.1)
    assert logs.std() == pytest.approx(prior.time_constant.deviation, rel=0.1)


def test_causes_have_the_posteriors_mean_and_covariance():
    flights = [drawn_flight(corrected(), (), (), seed=(1, k)) for k in range(400)]
    values = np.array([[values[name] for name in NAMES] for _, values in flights])
    acting = [(e.scale, m.delta_mass) for f, _ in flights for e, m in [f.reality.added]]
    np.testing.assert_array_equal(values, acting)
    np.testing.assert_allclose(values.mean(axis=0), [0.9, 0.1], atol=2e-3)
    np.testing.assert_allclose(np.cov(values.T), C, rtol=0.25, atol=1e-5)
    assert len({f.reality.disturbance.seed for f, _ in flights}) == len(flights)


def test_ranges_set_the_fields_of_a_scenario():
    over = [Range("payload", 0.1, 0.3), Range("wind", 0.0, 4.0), Range("tether", 0.5, 0.7)]
    over += [Range("speed", 1.0, 2.0), Range("reality.motor_lag", 0.02, 0.04)]
    flight, values = drawn_flight(load_experiment("circle"), over, [0.5] * 5, seed=(0,))
    reality = flight.reality
    assert reality.payload.mass == values["payload"] == pytest.approx(0.2)
    assert np.linalg.norm(reality.wind) == pytest.approx(2.0)
    assert reality.wind[2] == 0
    assert (reality.payload.length, reality.motor_lag) == pytest.approx((0.6, 0.03))
    assert flight.reference.speed == pytest.approx(1.5)
    again, _ = drawn_flight(load_experiment("circle"), over, [0.5] * 5, seed=(0,))
    assert again.reality == reality


@pytest.mark.parametrize("text", ["speed", "speed=1", "speed=1:x", "=1:2", "speed=2:1", "a=1:inf"])
def test_what_is_no_range_is_refused(text):
    with pytest.raises(ValueError, match="--over"):
        Range.parse(text)
