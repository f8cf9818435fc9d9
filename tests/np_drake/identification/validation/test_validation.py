import numpy as np
import pytest

from np_drake.identification.validation import held_out_errors
from tests.np_drake.identification import analytic


@pytest.fixture(scope="module")
def unseen():
    return [analytic.flight(seed=11, seconds=8.0)]


@pytest.fixture(scope="module")
def dut(found, unseen):
    return {row.model: row for row in held_out_errors(found, unseen)}


def test_on_unseen_flights_the_identified_model_goes_before_the_file(dut):
    assert list(dut) == ["vehicle file", "identified"]
    before, after = dut["vehicle file"], dut["identified"]
    assert np.all(after.force < before.force)
    assert np.all(after.torque < 0.5 * before.torque)
    assert np.all(after.open_loop[1] < before.open_loop[1])


def test_what_is_left_is_the_noise_of_the_sensors(dut):
    after = dut["identified"]
    assert np.all(after.force < 1.5 * analytic.TRUE.mass * analytic.NOISE["a"])
    gyro = np.sqrt(2) * analytic.NOISE["w"] / 0.01  # rad/s², of a difference over a row
    assert np.all(after.torque < 1.5 * gyro * np.diag(analytic.TRUE.J))
