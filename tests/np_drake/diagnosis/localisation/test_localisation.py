"""Laws of where the gap lies."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.localisation import localise


def test_the_gap_of_a_channel_is_the_rms_of_the_rows_that_count(seen, noise):
    e = seen(name="a", seconds=4.0)
    y = np.zeros_like(e.y)
    y[:, 0], y[::2, 4] = 0.3, 0.02
    rows = {"a": np.arange(len(e.t)) % 2 == 0}
    dut = localise([dc.replace(e, y=y)], {"a": 0.5 * y}, noise, rows)
    assert [c.rms for c in dut.channels] == pytest.approx([0.3, 0, 0, 0, 0.02, 0])
    assert [c.after for c in dut.channels] == pytest.approx([0.15, 0, 0, 0, 0.01, 0])
    assert [c.noise_floor for c in dut.channels] == pytest.approx(noise.rms[:6].tolist())
