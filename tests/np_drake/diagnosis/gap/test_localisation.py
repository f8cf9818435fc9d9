"""Laws of where the gap lies."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.gap import assess_identifiability, excitation, excited, localise
from np_drake.diagnosis.result import CHANNELS, ChannelGap, gap_kinds


def test_the_gap_of_a_channel_is_the_rms_of_the_rows_that_count(seen, noise):
    e = seen(name="a", seconds=4.0)
    y = np.zeros_like(e.y)
    y[:, 0], y[::2, 4] = 0.3, 0.02
    rows = {"a": np.arange(len(e.t)) % 2 == 0}
    dut = localise([dc.replace(e, y=y)], {"a": 0.5 * y}, noise, rows)
    assert [c.rms for c in dut.channels] == pytest.approx([0.3, 0, 0, 0, 0.02, 0])
    assert [c.after for c in dut.channels] == pytest.approx([0.15, 0, 0, 0, 0.01, 0])
    assert [c.noise_floor for c in dut.channels] == pytest.approx(noise.rms[:6].tolist())


def test_excitation_is_that_of_the_flight(seen):
    dut = excitation([seen()])
    log = seen().log
    assert dut["speed [m/s]"] == pytest.approx(np.sqrt(np.mean(np.sum(log.v**2, axis=1))), rel=0.02)
    assert dut["rate [rad/s]"] == pytest.approx(
        np.sqrt(np.mean(np.sum(log.w**2, axis=1))), rel=0.02
    )
    assert dut["height span [m]"] == pytest.approx(np.ptp(log.p[:, 2]), rel=0.02)
    assert dut["duration [s]"] == pytest.approx(12.0, abs=0.03)
    assert dut["thrust variation [1]"] == pytest.approx(
        log.u[:, 0].std() / log.u[:, 0].mean(), rel=0.02
    )


@pytest.mark.parametrize("noise_of_the_log", [0.0, 1.0])
def test_a_hovering_flight_excites_nothing_and_a_moving_one_something(seen, noise_of_the_log):
    assert not excited(excitation([seen(vigour=0.0, noise=noise_of_the_log)]))
    assert excited(excitation([seen(noise=noise_of_the_log)]))


def test_torque_that_the_motion_hardly_shows_is_said(seen, noise):
    e = seen(noise=1.0)
    weak = dc.replace(e, torque_gain=(0.12, 0.3, 1.0))
    usual, said = (assess_identifiability([own], [own], noise).warnings for own in (e, weak))
    assert ["12 %, 30 %, 100 %" in text for text in set(said) - set(usual)] == [True]


def test_the_gap_has_three_kinds_with_shares_of_their_own():
    sizes = (8.0, 7.0, 22.0, 3.0, 2.6, 1.3)  # in noise units
    every = [
        ChannelGap(name, "N", 0.05 * size, 0.05, 0.054)
        for name, size in zip(CHANNELS, sizes, strict=True)
    ]
    lateral, vertical, torque = gap_kinds(every)
    kinds = [part.kind for part in (lateral, vertical, torque)]
    assert kinds == ["lateral force", "vertical force", "torque"]
    assert lateral.before == pytest.approx(0.05 * np.hypot(8, 7))  # [N]
    assert vertical.remaining == pytest.approx((1.08**2 - 1) / (22**2 - 1))
    assert vertical.above_noise == pytest.approx(0.05 * np.sqrt(1.08**2 - 1))  # [N]


def test_without_a_gap_no_share_is_left_of_it():
    assert np.isnan(gap_kinds([ChannelGap("force z", "N", 0.08, 0.08, 0.08)])[0].remaining)
    assert gap_kinds([]) == []
