"""Laws of the held-out gap by kind of force and torque."""

import numpy as np
import pytest

from np_drake.diagnosis.result import CHANNELS, ChannelGap, gap_kinds

NOISE = (0.05, 0.05, 0.08, 0.004, 0.004, 0.002)  # [N, N·m]
SIZE = (8.0, 7.0, 22.0, 3.0, 2.6, 1.3)  # of the gap in noise units


def channels(after=1.08):
    return [
        ChannelGap(name, "N" if k < 3 else "N·m", noise * size, noise, after * noise)
        for k, (name, noise, size) in enumerate(zip(CHANNELS, NOISE, SIZE, strict=True))
    ]


def test_the_gap_has_three_kinds_with_shares_of_their_own():
    lateral, vertical, torque = gap_kinds(channels())
    assert [part.kind for part in (lateral, vertical, torque)] == [
        "lateral force",
        "vertical force",
        "torque",
    ]
    assert lateral.before == pytest.approx(np.hypot(0.05 * 8, 0.05 * 7))  # [N]
    assert vertical.left == pytest.approx((1.08**2 - 1) / (22**2 - 1))
    assert vertical.above_noise == pytest.approx(0.08 * np.sqrt(1.08**2 - 1))  # [N]


def test_without_a_gap_no_share_is_left_of_it():
    assert np.isnan(gap_kinds([ChannelGap("force z", "N", 0.08, 0.08, 0.08)])[0].left)
    assert gap_kinds([]) == []
