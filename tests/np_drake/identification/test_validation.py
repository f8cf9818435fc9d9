import dataclasses as dc

import numpy as np
import pytest

from np_drake.identification.validation import ERRORS, HORIZONS, held_out, vehicle_values


@pytest.fixture(scope="module")
def unseen(analytic):
    return [analytic.flight(seed=11, seconds=8.0)]


@pytest.fixture(scope="module")
def dut(found, unseen):
    return {row.model: row for row in held_out(found, unseen, plain=True)}


def test_on_unseen_flights_the_identified_model_goes_before_the_file(dut):
    assert list(dut) == ["vehicle file", "identified", "least squares"]
    before, after = dut["vehicle file"], dut["identified"]
    assert np.all(after.force < before.force)
    assert np.all(after.torque < 0.5 * before.torque)
    assert np.all(after.open_loop[1] < before.open_loop[1])


def test_what_is_left_is_the_noise_of_the_sensors(analytic, dut):
    after = dut["identified"]
    assert np.all(after.force < 1.5 * analytic.TRUE.mass * analytic.NOISE["a"])
    gyro = np.sqrt(2) * analytic.NOISE["w"] / 0.01  # rad/s², of a difference over a row
    assert np.all(after.torque < 1.5 * gyro * np.diag(analytic.TRUE.J))


def test_open_loop_errors_grow_with_the_horizon(dut):
    for row in dut.values():
        assert row.open_loop.shape == (len(HORIZONS), len(ERRORS))
        assert np.all(row.open_loop[1] > row.open_loop[0])


def test_a_log_without_states_has_no_open_loop_errors(found, unseen):
    (row, _) = held_out(found, [dc.replace(unseen[0], lacks=("height",))])
    assert np.isnan(row.open_loop).all()
    assert np.isfinite(row.torque).all()


def test_only_the_asked_part_of_a_flight_is_scored(found, unseen):
    log = unseen[0]
    w = log.w.copy()
    w[: len(w) // 2] += np.random.default_rng(0).normal(0.0, 0.5, (len(w) // 2, 3))
    last = [(0.6, 1.0)]
    clean, broken = (held_out(found, [x], last)[1] for x in (log, dc.replace(log, w=w)))
    np.testing.assert_allclose(broken.torque, clean.torque, rtol=0.5)


@pytest.mark.parametrize("drive", ["rotor_speed", "throttle", "command"])
def test_hover_of_a_file_is_its_weight(analytic, found, drive):
    v, frame = analytic.TRUE, found.basis.frame
    weight = 0.25 * v.mass * 9.81
    unit = {"rotor_speed": np.sqrt(weight / v.thrust_coefficient), "command": weight}
    unit["throttle"] = float(v.throttle.throttle(weight))
    values = vehicle_values(v, dc.replace(frame, unit=unit[drive]), drive, v.mass, {})
    assert values["scale"] == pytest.approx(1.0)
    assert values["lag"] == 0.03
    assert values["delay"] == 0.008
