import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.calibration.columns import with_fixed_effects
from np_drake.diagnosis.residuals import TORQUE, make_flight_residuals
from np_drake.identification.identified_vehicle import identified_vehicle
from np_drake.identification.identify import identify
from np_drake.logs.inputs import with_hover_thrust
from np_drake.rotor_input import with_rotor_input
from np_drake.vehicle import load_vehicle
from np_drake.vehicle.sources import values
from np_drake.vehicle.text import save_vehicle
from np_drake.vehicle.vehicle import Calibration


@pytest.fixture(scope="module", params=["found", "by_throttle"])
def dut(request):
    return identified_vehicle(request.getfixturevalue(request.param), "mine")


def test_a_saved_file_is_the_same_vehicle_with_sources_and_intervals(dut, tmp_path):
    save_vehicle(dut, tmp_path / "mine.yaml")
    again = load_vehicle(tmp_path / "mine.yaml")
    assert again == dut
    assert again.sources == dut.sources
    assert again.intervals == dut.intervals


def test_each_value_lies_within_its_interval(dut):
    known = values(dut)
    assert len(dut.intervals) > 8
    for field, pairs in dut.intervals.items():
        for value, (low, high) in zip(np.ravel(known[field]), pairs, strict=True):
            assert low - 1e-3 * abs(low) <= value <= high + 1e-3 * abs(high), field


def test_every_identified_field_says_where_it_comes_from(dut):
    assert set(dut.intervals) <= set(dut.sources)
    assert dut.sources["mass"] == "given"
    assert dut.sources["rotor_positions"] == "given: known"
    assert all(s.startswith(("identified from", "prior: ", "given")) for s in dut.sources.values())
    assert not any(": ;" in s for s in dut.sources.values())


def test_the_file_holds_the_true_vehicle(analytic, dut):
    true = analytic.TRUE
    np.testing.assert_allclose(np.diag(dut.J), np.diag(true.J), rtol=0.03)
    np.testing.assert_allclose(
        dut.calibration.center_of_mass, true.calibration.center_of_mass, atol=3e-4
    )
    np.testing.assert_allclose(dut.calibration.rotor_gains, true.calibration.rotor_gains, atol=5e-3)
    lever = true.torque_coefficient / true.thrust_coefficient
    assert dut.torque_coefficient / dut.thrust_coefficient == pytest.approx(lever, rel=0.03)


def test_the_throttle_map_is_the_true_one(analytic, by_throttle):
    dut = identified_vehicle(by_throttle, "mine")
    u = np.linspace(0.3, 0.8, 6)
    np.testing.assert_allclose(dut.throttle.thrust(u), analytic.TRUE.throttle.thrust(u), rtol=0.02)
    assert dut.max_rotor_thrust == pytest.approx(10.0, rel=0.02)


def test_without_mass_no_file_is_written(analytic):
    found = identify([analytic.flight(seconds=4.0)], analytic.KNOWN)
    with pytest.raises(ValueError, match="needs the mass") as told:
        identified_vehicle(found, "mine")
    assert "--mass" in str(told.value)


def test_a_told_mass_has_an_interval(analytic):
    right = dc.replace(analytic.KNOWN, thrust_coefficient=9e-6)
    dut = identified_vehicle(identify([analytic.flight(seconds=4.0)], right, trusted=True), "mine")
    assert dut.mass == pytest.approx(1.3, rel=0.02)
    assert dut.intervals["mass"][0][0] < dut.mass < dut.intervals["mass"][0][1]
    assert dut.sources["mass"].startswith("identified")
    assert 1.96 * dut.mass_uncertainty == pytest.approx(
        dut.intervals["mass"][0][1] / dut.mass - 1, rel=0.02
    )


@pytest.mark.parametrize(
    "case, field",
    [("found", "thrust_coefficient"), ("by_throttle", "throttle.full_thrust")],
    ids=str,
)
def test_the_file_states_how_well_flights_tell_thrust(case, field, request, tmp_path):
    found = request.getfixturevalue(case)
    found = dc.replace(
        found, prior=dc.replace(found.prior, thrust_uncertainty=0.4, mass_uncertainty=0.01)
    )
    save_vehicle(identified_vehicle(found, "mine"), tmp_path / "mine.yaml")
    dut = load_vehicle(tmp_path / "mine.yaml")
    half = dut.intervals[field][0][1] / values(dut)[field] - 1
    assert (
        0 < 1.96 * dut.thrust_uncertainty == pytest.approx(half, rel=0.02)
    )  # 2 %: the interval is one of ratios
    assert dut.mass_uncertainty == 0.01  # the mass was given, and the flights do not tell it


def test_what_flights_tell_of_thrust_is_no_guess(found, flights):
    guessed = dc.replace(found.prior, thrust_uncertainty=0.4)
    told = identified_vehicle(dc.replace(found, prior=guessed), "mine")
    assert with_hover_thrust(guessed, flights)[0] is not guessed
    dut, logs, _ = with_hover_thrust(told, flights)
    assert dut is told
    assert all(log is flight for log, flight in zip(logs, flights, strict=True))


def test_a_diagnosis_takes_what_identify_wrote_as_its_nominal_vehicle(found, flights, tmp_path):
    save_vehicle(identified_vehicle(found, "mine"), tmp_path / "mine.yaml")
    told = load_vehicle(tmp_path / "mine.yaml")

    def torque(vehicle):
        e = with_fixed_effects(
            make_flight_residuals(with_rotor_input(flights[0], vehicle), vehicle)
        )
        return np.sqrt(np.mean(e.y[:, TORQUE] ** 2, axis=0))

    assert np.all(
        torque(told)[:2]
        < 0.5 * torque(dc.replace(told, calibration=Calibration(), intervals={}))[:2]
    )
