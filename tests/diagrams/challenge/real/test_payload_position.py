"""Laws of the payload's position: on a simulated pendulum it is found from the vehicle's motion and
force alone.
"""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.challenge.real.payload_position import error, make_drive, observed, open_loop
from np_drake.effects.pendulum import Payload, hanging, path_many
from np_drake.vehicle import Vehicle

TRUE = Payload(0.2, 0.6, (0.0, 0.0, 0.0), 0.15)
GRAVITY = 9.81


@pytest.fixture(scope="module")
def swung(make_flight):
    """A flight with a payload, and the payload's true position."""
    seen = {}

    def pull(t, p, v, a):
        start = hanging(np.array([[0.15, -0.1]]), np.array([[0.2, 0.3]]), TRUE.length)
        a, how = 0.5 * (a[1:] + a[:-1]), {"damping": TRUE.damping, "v_hook": 0.5 * (v[1:] + v[:-1])}
        r, _, pulls = path_many(np.array([TRUE.length]), *start, a, t[1] - t[0], GRAVITY, **how)
        seen["p"] = p + r[:, 0]
        rows = np.concatenate([pulls[:1], 0.5 * (pulls[1:] + pulls[:-1]), pulls[-1:]])
        return TRUE.mass * rows[:, 0]

    log = make_flight(3, pull)
    return log, seen["p"]


@pytest.mark.parametrize("predict, most", [(open_loop, 0.01), (observed, 0.04)])
def test_the_true_pendulum_is_where_the_payload_is(swung, predict, most):
    log, p = swung
    drive = make_drive(log, Vehicle(), TRUE)
    found = predict(drive, TRUE, GRAVITY)
    # m: open loop the noise of the velocity is left; the filter starts plumb, 0.18 m away, and has
    # its own noise.
    assert error(found, drive.t, p, log.t) < most


def test_a_wrong_length_is_worse_open_loop_than_observed(swung):
    log, p = swung
    wrong = dc.replace(TRUE, length=0.66)
    drive = make_drive(log, Vehicle(), wrong)
    off = {f: error(f(drive, wrong, GRAVITY), drive.t, p, log.t) for f in (open_loop, observed)}
    assert off[observed] < 0.6 * off[open_loop]


def test_what_comes_later_does_not_change_the_observed_position(swung):
    log, _ = swung
    drive = make_drive(log, Vehicle(), TRUE)
    cut = len(drive.t) // 2
    steps = drive.a_hook[: cut - 1], drive.v_hook[: cut - 1]
    first = type(drive)(drive.t[:cut], *steps, drive.p_hook[:cut], drive.force[:cut])
    assert np.allclose(observed(first, TRUE, GRAVITY), observed(drive, TRUE, GRAVITY)[:cut])
