import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, signal

from np_drake import attitude
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.residuals import FORCE, VELOCITY
from np_drake.diagnosis.slow_force import SlowForce, _markov, _slow_power, slow_force
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.rigid_body import Q

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)
THRESHOLDS = REAL.thresholds

DRAG = LinearDrag(0.3, 0.3, 0.3)


def flown(seen, *effects, seconds=30.0, **how):
    return [seen(*effects, name=str(i), seed=i, noise=1.0, seconds=seconds, **how) for i in (1, 2)]


def left_of(flights, *effects):
    return {
        e.name: e.y - predicted_residual(e, [Term(effect) for effect in effects]) for e in flights
    }


def markov(flight, rms: float, time: float, seed: int) -> np.ndarray:
    """(m, 3) level force in W [N], a first-order Gauss-Markov process."""
    keep = np.exp(-flight.grid.step / time)
    white = np.random.default_rng(seed).normal(size=(len(flight.t) + 500, 2))
    level = rms * signal.lfilter([np.sqrt(1 - keep**2)], [1.0, -keep], white, axis=0)[500:]
    return np.column_stack([level, np.zeros(len(level))])


def pushed(
    flights,
    residual,
    *,
    position: float = 0.0,
    accelerometer: float = 0.0,
    time: float,
    both: float = 0.0,
):
    """left, with forces [N RMS] that position alone, the accelerometer alone, or both show."""
    out = {}
    for i, e in enumerate(flights):
        R, mass = e.q, e.vehicle.mass
        force = [
            markov(e, size, time, 10 * i + k)
            for k, size in enumerate((position, accelerometer, both))
        ]
        seen, read, common = (attitude.rotate_back(R, f) for f in force)
        y = residual[e.name].copy()
        y[:, FORCE] += read + common
        y[:, VELOCITY] += (seen - read) / mass
        out[e.name] = y
    return out


@pytest.mark.parametrize("time", [0.5, 1.5])
def test_gusts_are_a_force_in_the_air(seen, time):
    flights = flown(seen, DRAG, GustyWind(0.0, 0.0, 0.0, 1.5, time, seed=4))
    dut = slow_force(flights, left_of(flights, DRAG), IDEAL)
    assert dut.probability(THRESHOLDS.slow_force_evidence) > 0.99
    assert dut.deviation == pytest.approx(0.45, rel=0.4)


@pytest.mark.parametrize("accelerations", [True, False])
@pytest.mark.parametrize("attitude_noise", [0.0, 0.01], ids=["laboratory", "rig"])
def test_noise_alone_is_none(seen, attitude_noise, accelerations):
    flights = flown(
        seen, DRAG, seconds=12.0, attitude_noise=attitude_noise, accelerations=accelerations
    )
    tolerance = REAL if attitude_noise else IDEAL
    assert (
        slow_force(flights, left_of(flights, DRAG), tolerance).probability(
            THRESHOLDS.slow_force_evidence
        )
        < 0.05
    )


def test_a_steady_force_is_none(seen):
    flights = flown(seen, seconds=12.0)
    residual = left_of(flights)
    still = slow_force(flights, residual, IDEAL).log_evidence
    for e in flights:
        residual[e.name][:, FORCE] += attitude.rotate_back(
            e.q, np.tile([3.0, -2.0, 0.0], (len(e.t), 1))
        )
    assert slow_force(flights, residual, IDEAL).log_evidence == pytest.approx(still, abs=0.5)


def test_an_attitude_may_wander_as_a_rig_does_but_not_as_air_pushes(seen):
    flights = [dc.replace(e, turned=False) for e in flown(seen, attitude_noise=0.007)]
    weight = flights[0].vehicle.mass * flights[0].vehicle.gravity
    residual = left_of(flights)
    wander, push = (
        slow_force(flights, pushed(flights, residual, position=size * weight, time=time), REAL)
        for size, time in ((0.008, 10.0), (0.02, 1.0))
    )
    assert wander.probability(THRESHOLDS.slow_force_evidence) < 0.1
    assert push.probability(THRESHOLDS.slow_force_evidence) > 0.9


@pytest.mark.parametrize("one", ["position", "accelerometer"])
def test_a_force_that_only_accelerometer_or_velocity_shows_is_none(seen, one):
    flights = [dc.replace(e, turned=True) for e in flown(seen, attitude_noise=0.007)]
    residual = left_of(flights)
    alone = slow_force(flights, pushed(flights, residual, **{one: 0.15}, time=1.0), REAL)
    both = slow_force(flights, pushed(flights, residual, both=0.15, time=1.0), REAL)
    assert alone.probability(THRESHOLDS.slow_force_evidence) < 0.3
    assert both.probability(THRESHOLDS.slow_force_evidence) > 0.99
    assert both.deviation == pytest.approx(0.15, rel=0.4)


@settings(max_examples=20, deadline=None)
@given(st.floats(-4.0, 1.0), st.floats(-1.5, 2.0))
def test_the_spectrum_of_a_gauss_markov_process_holds_its_variance(rms, time):
    f = np.geomspace(1e-5, 1e5, 20001) / np.exp(time)
    assert integrate.trapezoid(_markov(f, rms, time), f) == pytest.approx(np.exp(2 * rms), rel=0.01)


def test_a_slow_force_has_its_mean_square_as_power_and_a_fast_one_none(seen):
    flights = flown(seen, seconds=20.0)
    for frequency, expected in ((0.3, 0.5 * 0.8**2), (4.0, 0.0)):
        residual = {}
        for e in flights:
            level = 0.8 * np.sin(2 * np.pi * frequency * e.t)
            force = attitude.rotate_back(e.q, np.column_stack([level, level, 0 * level]))
            residual[e.name] = np.zeros_like(e.y)
            residual[e.name][:, FORCE] = force
        assert _slow_power(flights, residual) == pytest.approx(expected, rel=0.1, abs=0.01)


def test_an_attitude_read_askew_is_no_slow_force_where_the_vehicle_yaws(seen):
    flight, _ = flown(seen, seconds=20.0)
    x = flight.rows.x.copy()
    half = 0.2 * flight.rows.t
    x[:, Q] = np.column_stack([np.cos(half), 0 * half, 0 * half, np.sin(half)])
    yawing = dc.replace(flight, rows=dc.replace(flight.rows, x=x))
    askew, wind = np.zeros_like(yawing.y), np.zeros_like(yawing.y)
    askew[:, FORCE] = [0.8, -0.5, 0.0]
    wind[:, FORCE] = attitude.rotate_back(yawing.q, np.tile([0.8, -0.5, 0.0], (len(yawing.t), 1)))
    size = 0.8**2 + 0.5**2
    assert _slow_power([yawing], {"1": askew}) < 1e-6 * size
    assert _slow_power([yawing], {"1": wind}) < 0.1 * size
    assert _slow_power([yawing], {"1": wind * np.sin(1.5 * yawing.t)[:, None]}) > 0.1 * size


@pytest.mark.parametrize(
    ("evidence", "probability"), [(4.0, 0.5), (4.0 + np.log(3.0), 0.75), (4.0 - np.log(9.0), 0.1)]
)
def test_the_probability_of_a_slow_force_is_that_of_its_odds(evidence, probability):
    assert SlowForce(evidence, 1.0).probability(4.0) == pytest.approx(probability)
