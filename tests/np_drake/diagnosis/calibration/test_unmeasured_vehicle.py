"""Laws of the diagnosis of a vehicle that nobody measured: healthy differences are calibration,
larger ones causes.
"""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.calibration import calibration_effects
from np_drake.diagnosis.gap import measure_gap_reduction
from np_drake.diagnosis.options import SPREAD, Options
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.diagnosis.residuals.flight_residuals import CLEAR
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.combine import mass_properties, split_effects
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.vehicle import Vehicle

REAL = Options.for_sensors(True)
HEALTHY = (WeakRotor(1.0, 1 - SPREAD.rotor_gain), BladeFlapping(0.05))
SENSORS = {"noise": 1.0, "attitude_noise": 0.005, "seconds": 8.0}


def flown(seen, *effects):
    return [seen(*effects, name=n, seed=i, **SENSORS) for i, n in enumerate("abc", start=1)]


@pytest.fixture(scope="module")
def healthy(seen, inferred):
    *train, held_out = flown(seen, *HEALTHY)
    return inferred(train, [held_out], REAL)


def test_a_healthy_vehicle_has_no_cause(healthy):
    assert healthy.causes == []


def test_calibration_closes_the_gap_of_a_flight_that_it_has_not_seen(healthy):
    found = measure_gap_reduction(
        healthy.causes, healthy.ranking.noise, healthy.held, healthy.left, None
    )
    assert found.before > 2.0
    assert found.fraction > 0.9
    assert [rung.name for rung in found.ladder] == ["nominal", "+ calibration", "noise floor"]


def test_calibration_is_in_the_corrected_simulator(healthy):
    effects = calibration_effects(
        healthy.ranking.best, healthy.flights[0], healthy.options.tolerance
    )
    gains = {e.rotor: e.efficiency for e in effects if isinstance(e, WeakRotor)}
    assert len(gains) == 4
    assert gains[1.0] < min(gains[i] for i in (2.0, 3.0, 4.0))  # the only one that is weak
    assert not any(e.place == "measurement" or e.shifts_commands for e in effects)


@pytest.mark.parametrize("share", [(0.5, 0.6, 1.0), (1.0, 1.0, 0.05)], ids=str)
def test_the_simulator_shows_the_share_of_torque_that_the_flights_show(healthy, share):
    e = dc.replace(healthy.flights[0], torque_gain=share)
    effects = calibration_effects(healthy.ranking.best, e, healthy.options.tolerance)
    body = mass_properties(e.vehicle, split_effects(effects).mass)
    assert body.rigid
    shown = e.vehicle.J.diagonal() / body.J.diagonal()
    assert shown[:2] == pytest.approx(share[:2])
    assert shown[2] == pytest.approx(share[2]) or shown[2] > share[2]  # as a rigid body can have it


def test_a_rotor_that_no_healthy_vehicle_has_is_a_cause(seen, inferred):
    *train, held_out = flown(seen, WeakRotor(1.0, 0.8))
    found = inferred(train, [held_out], REAL)
    assert [c.identifier for c in found.causes] == ["weak_rotor"]
    assert found.causes[0].effect is not None
    assert found.causes[0].effect.values["rotor"] == 1.0


@pytest.mark.parametrize("timing, cut", [("unknown", True), ("held", False)])
def test_take_off_is_cut_where_there_can_be_contact(fly, timing, cut):
    log = fly(name="a", seed=1, seconds=8.0)
    rising = np.minimum(0.05 + 0.4 * (log.t - log.t[0]), 1.2)
    log = dc.replace(log, p=np.column_stack([log.p[:, :2], rising]))
    dut = make_flight_residuals(log, dc.replace(Vehicle(), command_timing=timing))
    first = log.t[rising >= CLEAR][0]
    assert bool(dut.t[0] >= first) is cut


@pytest.mark.parametrize("timing, left_out", [("unknown", True), ("held", False)])
def test_time_on_the_ground_in_mid_flight_is_left_out(fly, timing, left_out):
    log = fly(name="a", seed=1, seconds=8.0)
    stands = (log.t > 4.0) & (log.t < 5.0)
    u, v = log.u.copy(), log.v.copy()
    u[stands], v[stands] = 0.0, 0.0
    dut = make_flight_residuals(
        dc.replace(log, u=u, v=v), dc.replace(Vehicle(), command_timing=timing)
    )
    assert dut.outliers[(dut.t > 4.1) & (dut.t < 4.9)].all() == left_out
    assert not dut.outliers[np.abs(dut.t - 4.5) > 1.1].any()
