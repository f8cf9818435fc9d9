"""Laws of the samples that the estimator gets."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.estimation.motion import motion_from_attitude, motion_from_rates


def test_acceleration_and_wrench_are_inverse(made, vehicle):
    for dut in (
        motion_from_attitude(made.sequence, vehicle, made.q),
        motion_from_rates(made.sequence, vehicle),
    ):
        back = dut.wrench(dut.acceleration(made.sequence.chi))
        np.testing.assert_allclose(back, made.sequence.chi, atol=1e-12)


def test_the_samples_change_by_the_wrench_and_the_known_input(made, vehicle):
    """Central differences, to their own error: h²/6 of the third derivative."""
    dut = motion_from_attitude(made.sequence, vehicle, made.q)
    rate = (dut.y[2:] - dut.y[:-2]) / (2 * dut.step)
    expected = (dut.acceleration(made.sequence.chi) + dut.u)[1:-1]
    np.testing.assert_allclose(rate[:, :3], expected[:, :3], atol=5e-3)  # [m/s²]
    np.testing.assert_allclose(rate[:, 3:], expected[:, 3:], atol=5e-3)  # [rad/s²]


def test_at_rest_a_hover_is_what_the_arrays_show(made, vehicle):
    dut = motion_from_attitude(made.sequence, vehicle, made.q).first(1)
    np.testing.assert_allclose(dut.wrench(dut.hover[None])[0], made.sequence.chi[0], atol=1e-9)


def test_the_body_rates_and_the_past_tell_where_gravity_is(made, vehicle):
    logged = motion_from_attitude(made.sequence, vehicle, made.q)
    dut = motion_from_rates(made.sequence, vehicle)
    in_body = [np.einsum("kij,ki->kj", motion.R, motion.gravity) for motion in (logged, dut)]
    angle = np.arccos(np.clip(np.sum(in_body[0] * in_body[1], axis=1) / vehicle.gravity**2, -1, 1))
    assert np.degrees(angle).max() < 0.2
    np.testing.assert_allclose(np.linalg.norm(dut.gravity, axis=1), vehicle.gravity, rtol=1e-12)


def test_gravity_never_looks_at_the_force_of_its_own_row_or_later(made, vehicle):
    k, changed = 900, dc.replace(made.sequence, chi=made.sequence.chi.copy())
    changed.chi[k:] += 5.0
    before, after = (motion_from_rates(s, vehicle).gravity for s in (made.sequence, changed))
    np.testing.assert_array_equal(before[: k + 1], after[: k + 1])
    assert np.abs(before[k + 1] - after[k + 1]).max() > 1e-3


def test_the_first_rows_take_the_gravity_of_the_end_of_settling(made, vehicle):
    gravity = motion_from_rates(made.sequence, vehicle, settling=0.25).gravity
    np.testing.assert_array_equal(gravity[:101], np.tile(gravity[0], (101, 1)))
    assert np.abs(gravity[101] - gravity[102]).max() > 0


@pytest.mark.parametrize("change", [{"frame": "world"}, {"total": False}])
def test_only_the_total_wrench_in_body_axes_is_taken(made, vehicle, change):
    with pytest.raises(ValueError, match="total wrench in body axes"):
        motion_from_rates(dc.replace(made.sequence, **change), vehicle)


@pytest.mark.parametrize("column", ["zeta", "chi"])
def test_rates_with_gaps_are_not_integrated(made, vehicle, column):
    broken = getattr(made.sequence, column).copy()
    broken[7, 2] = np.nan
    with pytest.raises(ValueError, match="without gaps"):
        motion_from_rates(dc.replace(made.sequence, **{column: broken}), vehicle)
