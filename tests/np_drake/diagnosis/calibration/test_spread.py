"""Laws of the documented spread of healthy vehicles, and of its columns."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.calibration import (
    calibrated_alone,
    columns_of,
    drift_columns,
    of_vehicle,
    scale_torque,
    torque_gain,
    vehicle_columns,
)
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.options import Options, Tolerance
from np_drake.diagnosis.residuals import TORQUE
from np_drake.effects.base import arm
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.library import CHANGES
from np_drake.effects.mass_error import MassError
from np_drake.effects.mixer_gain import MixerGain
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.estimation.priors import HEALTHY

UNMEASURED = dc.replace(Tolerance(), unmeasured=True)
PRIORS = Options.for_sensors(True).priors


@pytest.fixture(scope="module")
def flight(seen):
    return seen(name="a", seed=1, seconds=6.0)


def test_a_column_is_what_one_deviation_does(flight):
    shared = of_vehicle(flight, UNMEASURED)
    (first,) = [d for d in shared if d.effect is WeakRotor and d.fixed == {"rotor": 1.0}]
    column = columns_of(flight, [first])[..., 0]
    expected = predicted_residual(flight, [Term(WeakRotor(1.0, 1.0 + HEALTHY.rotor_gain))])
    np.testing.assert_allclose(column, expected, atol=1e-12)


def test_an_airframe_has_no_drag_of_its_own_beside_the_effect(flight):
    _, of_air = vehicle_columns([flight], UNMEASURED, PRIORS)
    body = np.einsum("nji,nj->ni", flight.rows.R_WB, flight.rows.x[:, 7:10])
    for axis in range(3):
        force = of_air(flight)[:, axis]
        velocity = np.interp(flight.t, flight.rows.t, body[:, axis])
        acting = force[:, force.std(axis=0) > 0]
        alike = [abs(np.corrcoef(column, velocity)[0, 1]) for column in acting.T]
        assert max(alike) < 0.999


def test_a_battery_put_in_again_shifts_later_flights_alone(flight):
    earlier = flight.revised(earlier=True)
    session, *_ = vehicle_columns([earlier, flight], UNMEASURED, PRIORS)
    assert not session(earlier).any()
    shift = HEALTHY.session_shift * arm(flight.vehicle)
    expected = predicted_residual(flight, [Term(CenterOfMassOffset(shift, 0.0, 0.0))])
    torque = session(flight)[:, TORQUE, 0]
    np.testing.assert_allclose(torque, expected[:, TORQUE], atol=1e-3 * np.abs(torque).max())
    in_place = dc.replace(UNMEASURED, reseated=False)
    without = vehicle_columns([earlier, flight], in_place, PRIORS)
    assert len(without) == len(vehicle_columns([flight], UNMEASURED, PRIORS))


def test_slow_drift_adds_up_to_a_constant(flight):
    X = drift_columns(flight)
    total = X[:, 2].sum(axis=1)
    np.testing.assert_allclose(
        total, HEALTHY.known_sag * HEALTHY.drift_time * flight.weight, rtol=1e-12
    )


def test_sensors_and_times_are_calibration_whatever_their_size(flight):
    known = calibrated_alone(flight, UNMEASURED)
    assert {"attitude_bias", "gyro_bias", "motor_lag", "mixer_gain"} <= known
    assert known.isdisjoint({"weak_rotor", "center_of_mass_offset", MassError.identifier})
    assert calibrated_alone(flight, Tolerance()) == set(CHANGES)


SHARE = np.array([0.3, 0.5, 0.8])


@pytest.fixture(scope="module")
def weak(seen):
    """Return a flight of which the motion shows a share of the logged torque."""
    return seen(MixerGain(*SHARE), name="a", seed=1, seconds=8.0)


def test_the_gain_is_the_share_of_torque_that_the_motion_shows(weak):
    assert torque_gain([weak]) == pytest.approx(SHARE, abs=0.05)


@pytest.mark.parametrize(
    "effect", [BladeFlapping(0.3), SuspendedPayload(0.2, 0.7, hook_z=-0.1)], ids=str
)
def test_torque_that_trims_a_moment_is_shown(seen, effect):
    dut = seen(MixerGain(*SHARE), effect, name="a", seed=1, seconds=8.0)
    assert torque_gain([dut]) == pytest.approx(SHARE, abs=0.05)


def test_the_gain_leaves_the_gap_against_the_file_and_takes_torque_alone(weak):
    (scaled,) = scale_torque([weak], SHARE)
    assert scaled.against_file == pytest.approx(weak.y)
    assert scaled.nominal[:, TORQUE] == pytest.approx(weak.nominal[:, TORQUE] * SHARE, abs=1e-9)
    assert scaled.nominal[:, 2] == pytest.approx(weak.nominal[:, 2])
    assert np.sqrt(np.mean(scaled.y[:, TORQUE] ** 2)) < 0.2 * np.sqrt(
        np.mean(weak.y[:, TORQUE] ** 2)
    )
