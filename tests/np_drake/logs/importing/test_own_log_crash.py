"""A log of our own columns that ends in a crash is taken up to it, by every door; a whole flight
stays whole.
"""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.doctor.examine import examine
from np_drake.logs.errors import LogError
from np_drake.logs.formats.log_file import write_log
from np_drake.logs.opening import open_flights

G = 9.81


def crashing(log, at: float, *, rests: float = 2.0):
    """Return a flight whose rotors, at full thrust, carry it no longer from a time on [s]: it falls
    and lies there.
    """
    row = int(np.searchsorted(log.t, at))
    after = log.t - log.t[row]
    late = after >= 0
    ends = np.sqrt(2 * (log.p[row, 2] - 0.05) / G)
    fall = np.minimum(np.maximum(after, 0.0), ends)
    p, v, q, w, u, a = (x.copy() for x in (log.p, log.v, log.q, log.w, log.u, log.a))
    p[late] = np.column_stack(
        [np.tile(log.p[row, :2], (late.sum(), 1)), log.p[row, 2] - 0.5 * G * fall[late] ** 2]
    )
    falls = (fall < ends)[late, None]
    v[late] = np.where(falls, [0, 0, -G] * fall[late, None], 0.0)
    a[late] = np.where(falls, [0, 0, -G], 0.0)
    half = 0.6 * fall[late] / ends
    q[late] = np.column_stack([np.cos(half), np.sin(half), 0 * half, 0 * half])
    w[late] = np.where(falls, [1.2 / ends, 0, 0], 0.0)
    u[late] = [1.6 * np.median(log.u[:, 0]), 0, 0, 0]
    return dc.replace(log, p=p, v=v, q=q, w=w, u=u, a=a, al=None).rows(
        0, row + int((ends + rests) / log.step)
    )


def test_a_log_of_our_own_that_ends_in_a_crash_is_taken_up_to_it(flown, tmp_path):
    write_log(crashing(flown, 5.0), tmp_path / "crashed.csv")
    (dut,), sheet = open_flights(tmp_path / "crashed.csv")
    assert sheet is None
    assert dut.t[-1] == pytest.approx(4.85, abs=0.15)
    (note,) = dut.notes
    assert note == (
        f"fits until {dut.t[-1]:.1f} s, where the rotors carry it no longer though they "
        f"run; what follows is left out"
    )
    report = examine([dut])
    assert f"crashed: {note}" in report.problems
    assert report.usable
    np.testing.assert_allclose(dut.p, flown.p[: len(dut)], atol=1e-9)


def test_a_log_of_nothing_but_a_wreck_is_refused(flown, tmp_path):
    wreck = crashing(flown, 5.0, rests=3.0)
    write_log(wreck.rows(len(wreck) - 200, len(wreck)), tmp_path / "wreck.csv")
    with pytest.raises(
        LogError, match=r"wreck\.csv: must hold a flight; the vehicle lies still and tilted"
    ):
        open_flights(tmp_path / "wreck.csv")
