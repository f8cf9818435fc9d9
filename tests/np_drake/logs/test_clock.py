import numpy as np
import pytest

from np_drake import attitude
from np_drake.flight_log import FlightLog
from np_drake.logs.clock import shift_state


def turning_flight(n=200, step=0.01, **more):
    t = 3.0 + step * np.arange(n)
    half = 0.5 * 2.0 * t  # yaw at 2 rad/s: the sign of q turns over on the way
    q = np.stack([np.cos(half), 0 * t, 0 * t, np.sin(half)], axis=1)
    q[q[:, 0] < 0] *= -1
    p = np.stack([t, 2 * t, np.sin(t)], axis=1)
    v = np.stack([1 + 0 * t, 2 + 0 * t, np.cos(t)], axis=1)
    w = np.tile([0, 0, 2.0], (n, 1))
    u = np.random.default_rng(0).normal(size=(n, 4))
    return FlightLog(t, p, q, v, w, u, **more)


@pytest.mark.parametrize("offset", [0.013, -0.027, 0.02, 0.0])
def test_the_state_of_row_t_is_that_of_t_plus_offset_and_the_command_stays(offset):
    log = turning_flight(a=np.zeros((200, 3)), rotor=np.arange(800.0).reshape(200, 4))
    dut = shift_state(log, offset)
    then = dut.t + offset
    np.testing.assert_allclose(dut.p[:, 0], then, atol=1e-12)
    np.testing.assert_allclose(dut.p[:, 2], np.sin(then), atol=2e-5)  # [m]; linear between rows
    np.testing.assert_allclose(dut.v[:, 2], np.cos(then), atol=2e-5)
    heading = attitude.rotate(dut.q, np.broadcast_to([1.0, 0, 0], (len(dut), 3)))
    np.testing.assert_allclose(heading[:, 0], np.cos(2 * then), atol=1e-7)
    np.testing.assert_allclose(np.linalg.norm(dut.q, axis=1), 1.0, rtol=1e-12)
    rows = np.searchsorted(log.t, dut.t)
    np.testing.assert_array_equal(dut.u, log.u[rows])
    np.testing.assert_array_equal(dut.rotor, log.rotor[rows])
    assert dut.al is None
    assert len(dut) == 200 - int(np.ceil(abs(offset) / 0.01 - 1e-6))
    assert then[0] >= log.t[0] - 1e-9
    assert then[-1] <= log.t[-1] + 1e-9


def test_the_opposite_shift_undoes_it():
    log = turning_flight()
    back = shift_state(shift_state(log, 0.03), -0.03)
    rows = np.searchsorted(log.t, back.t - 1e-9)
    np.testing.assert_allclose(back.x, log.x[rows] * _signs(back, log, rows), atol=1e-9)
    assert len(back.notes) == 2
    assert log.notes == []


def _signs(back, log, rows):
    """q and -q are one attitude."""
    signs = np.ones((len(rows), 13))
    signs[:, 3:7] = np.sign(np.sum(back.q * log.q[rows], axis=1))[:, None]
    return signs


def test_an_offset_as_long_as_the_log_is_refused():
    with pytest.raises(ValueError, match="shift_state"):
        shift_state(turning_flight(), 2.5)
