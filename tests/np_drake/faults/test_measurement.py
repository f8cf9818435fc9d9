"""Laws of measurement faults."""

import numpy as np
import pytest

from np_drake import attitude
from np_drake.faults.measurement import (
    SENSORS,
    BiasJump,
    DroppedSamples,
    FrozenSamples,
    LateSamples,
    NanBurst,
    PoseJump,
    RepeatedSamples,
)

PERIOD = 0.02  # [s]
SPAN = {"onset": 1.0, "duration": 0.2, "sensor": "all"}


def reading(seed=0):
    values = np.random.default_rng(seed).normal(size=23)
    values[3:7] /= np.linalg.norm(values[3:7])
    return values


def delivered(dut):
    return [dut.delivered(k, PERIOD) for k in range(50, 60)]


def test_a_frozen_sensor_keeps_the_last_sample_before_the_fault():
    assert delivered(FrozenSamples(**SPAN)) == [49] * 10


def test_late_samples_are_older_by_the_same_number():
    assert delivered(LateSamples(**SPAN, samples=3)) == list(range(47, 57))


def test_each_sample_is_repeated_as_often_as_told():
    assert delivered(RepeatedSamples(**SPAN, times=4)) == [50] * 4 + [54] * 4 + [58] * 2


def test_lost_samples_leave_the_last_received_and_their_share_is_as_told():
    dut = DroppedSamples(onset=0.0, duration=100.0, sensor="all", share=0.3, seed=4)
    source = np.array([dut.delivered(k, PERIOD) for k in range(4000)])
    assert np.mean(source != np.arange(4000)) == pytest.approx(
        0.3, abs=0.03
    )  # four standard errors [1]
    assert np.all(np.diff(source) >= 0)
    assert np.all(source >= -1)  # no further back than the last sample before the fault


@pytest.mark.parametrize("sensor", SENSORS)
def test_a_burst_spoils_its_own_sensor_alone(sensor):
    spoilt = NanBurst(**SPAN | {"sensor": sensor}).reads(reading())
    assert np.flatnonzero(np.isnan(spoilt)).tolist() == sorted(SENSORS[sensor])


def test_a_bias_lies_in_body_axes():
    before = reading()
    after = BiasJump(**SPAN, rate=(0.1, 0.0, 0.0), acceleration=(0.0, 0.0, 1.0)).reads(before)
    np.testing.assert_allclose(after[10:13] - before[10:13], [0.1, 0, 0], atol=1e-12)
    # The specific force of body z, 1 m/s² of it.
    np.testing.assert_allclose(
        after[13:16] - before[13:16], attitude.body_z(before[3:7]), atol=1e-12
    )


def test_a_pose_that_jumps_stays_a_pose():
    before = reading()
    after = PoseJump(**SPAN, position=(0.1, 0.2, 0.3), turn=(0.0, 0.0, 0.2)).reads(before)
    np.testing.assert_allclose(after[:3] - before[:3], [0.1, 0.2, 0.3], atol=1e-12)  # [m]
    turn = attitude.rotation_vector(attitude.multiply(attitude.conjugate(before[3:7]), after[3:7]))
    np.testing.assert_allclose(turn, [0, 0, 0.2], atol=1e-9)  # [rad]
    np.testing.assert_array_equal(after[7:], before[7:])


def test_a_fault_acts_from_its_onset_until_its_end():
    dut = NanBurst(**SPAN)
    assert [dut.acts(t) for t in (0.99, 1.0, 1.19, 1.2)] == [False, True, True, False]
