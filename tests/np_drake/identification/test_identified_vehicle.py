import numpy as np
import pytest

from np_drake.identification.identified_vehicle import identified_vehicle
from np_drake.identification.identify import identify
from np_drake.vehicle import load_vehicle
from np_drake.vehicle.text import save_vehicle
from tests.np_drake.identification import analytic


@pytest.fixture(scope="module", params=["found", "by_throttle"])
def dut(request):
    return identified_vehicle(request.getfixturevalue(request.param), "mine")


def test_a_saved_file_is_the_same_vehicle_with_sources_and_intervals(dut, tmp_path):
    save_vehicle(dut, tmp_path / "mine.yaml")
    again = load_vehicle(tmp_path / "mine.yaml")
    assert again == dut
    assert again.sources == dut.sources
    assert again.intervals == dut.intervals


def test_the_file_holds_the_true_vehicle(dut):
    true = analytic.TRUE
    np.testing.assert_allclose(np.diag(dut.J), np.diag(true.J), rtol=0.03)
    np.testing.assert_allclose(
        dut.calibration.center_of_mass, true.calibration.center_of_mass, atol=3e-4
    )
    np.testing.assert_allclose(dut.calibration.rotor_gains, true.calibration.rotor_gains, atol=5e-3)
    lever = true.torque_coefficient / true.thrust_coefficient
    assert dut.torque_coefficient / dut.thrust_coefficient == pytest.approx(lever, rel=0.03)


def test_the_throttle_map_is_the_true_one(by_throttle):
    dut = identified_vehicle(by_throttle, "mine")
    u = np.linspace(0.3, 0.8, 6)
    np.testing.assert_allclose(dut.throttle.thrust(u), analytic.TRUE.throttle.thrust(u), rtol=0.02)
    assert dut.max_rotor_thrust == pytest.approx(10.0, rel=0.02)


def test_the_map_of_a_collective_command_is_the_true_one(by_collective):
    dut = identified_vehicle(by_collective, "mine")
    thrust = 4 * dut.throttle.thrust(np.array([0.4, 0.5, 0.6])) / (analytic.TRUE.mass * 9.81)
    np.testing.assert_allclose(thrust, (np.array([0.4, 0.5, 0.6]) - 0.06) / 0.44, rtol=0.02)
    assert dut.inertia == analytic.KNOWN.inertia  # which no collective tells


def test_without_mass_no_file_is_written():
    found = identify([analytic.flight(seconds=4.0)], analytic.KNOWN)
    with pytest.raises(ValueError, match="needs the mass") as told:
        identified_vehicle(found, "mine")
    assert "--mass" in str(told.value)
