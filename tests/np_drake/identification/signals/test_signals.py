import dataclasses as dc

import numpy as np
import pytest

from np_drake.identification.signals import signals
from tests.np_drake.identification import analytic


@pytest.fixture(scope="module")
def log():
    return analytic.flight(seed=3, seconds=5.0)


@pytest.fixture(scope="module")
def dut(log):
    return signals(log, analytic.KNOWN.unmixer)


def test_the_mean_acceleration_of_a_span_is_the_change_of_its_rates(log, dut):
    total = np.sum(dut.alpha * np.diff(dut.instants)[:, None], axis=0)
    np.testing.assert_allclose(total, log.w[dut.edges[-1]] - log.w[0], atol=1e-9)


def test_without_accelerometer_the_force_is_that_of_the_velocities(dut):
    level = dc.replace(analytic.TRUE.calibration, imu_position=[0.0] * 3, imu_tilt=[0.0] * 3)
    log = analytic.flight(dc.replace(analytic.TRUE, calibration=level), 3, seconds=5.0, noisy=False)
    own = signals(log, analytic.KNOWN.unmixer)
    other = signals(dc.replace(log, a=None), analytic.KNOWN.unmixer)
    assert not other.accelerometer
    assert (
        np.sqrt(np.mean((own.force - other.force) ** 2)) < 0.03
    )  # m/s²; log.a turns with the row, not within it


def test_a_gap_a_fall_a_spike_and_bridged_rows_do_not_count(log):
    t, a, rotor, bridged = log.t.copy(), log.a.copy(), log.rotor.copy(), np.zeros(len(log), bool)
    t[101:] += 0.5
    a[200:210] = [0.0, 0.0, -9.81]
    rotor[300, 2] = 5000.0
    bridged[400] = True
    dut = signals(dc.replace(log, t=t, a=a, rotor=rotor, bridged=bridged), analytic.KNOWN.unmixer)
    assert not dut.good[[100, 200, 209, 299, 300, 399, 400]].any()
    assert dut.good.mean() > 0.95


def test_a_part_counts_only_the_bins_within_it(dut):
    first, last = dut.part(0.0, 0.6), dut.part(0.6, 1.0)
    assert not (first.good & last.good).any()
    np.testing.assert_array_equal(first.good | last.good, dut.good)
    assert first.good.sum() == pytest.approx(0.6 * dut.good.sum(), abs=2)


@pytest.mark.parametrize("field", ["t", "q", "v", "w", "a"])
def test_a_log_with_holes_is_refused(log, field):
    values = getattr(log, field).copy()
    values[50] = np.nan
    with pytest.raises(ValueError, match=f"flight3: {field} must be numbers"):
        signals(dc.replace(log, **{field: values}), analytic.KNOWN.unmixer)
