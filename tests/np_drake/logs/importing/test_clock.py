"""Laws of clocks: states that are late are moved by as much."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake import attitude
from np_drake.flight_log import FlightLog
from np_drake.logs.clock import lag_of, on_one_clock, shift_state
from np_drake.logs.importing.log_map import LogMap
from np_drake.logs.importing.signals import Signal


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


def test_an_offset_as_long_as_the_log_is_refused():
    with pytest.raises(ValueError, match="shift_state"):
        shift_state(turning_flight(), 2.5)


POSE = ("position", "velocity", "attitude")
ATTITUDE, MOVED = ("attitude",), ("position", "velocity")


@pytest.fixture(scope="module")
def flown(fly):
    """Return a function that flies with the noise of motion capture and gyro."""
    return lambda seed=1, **how: fly(
        seed=seed, seconds=12.0, noise=1.0, attitude_noise=0.002, **how
    )


def signals_of(conventions, log, names=(), seconds=0.0, rate=100.0):
    """Return the signals of a log: the poses at a rate [Hz], those of `names` logged late [s]."""
    at = np.arange(0.5, 11.5, 1 / rate)
    x = {name: Signal(log.t, values) for name, values in conventions.quantities_of(log).items()}
    out = {"rates": x["rates"]}
    if log.a is not None:
        force = attitude.rotate_back(log.q, log.a + [0.0, 0.0, 9.81])
        # Held from a row to the next: of the middle of the interval.
        out["acceleration"] = Signal(log.t + 0.5 * log.step, force)
    for name in POSE:
        then = at - seconds * (name in names)
        out[name] = Signal(
            at, x[name].turned(None, then) if name == "attitude" else x[name].linear(then)
        )
    return out


def late_of(conventions, signals, **stated):
    sources = {
        name: dc.replace(getattr(conventions.plain_map(), name), late=stated.get(name))
        for name in signals
    }
    parts, log_map, said = on_one_clock([signals], signals, LogMap(**sources))
    late = {name: getattr(log_map, name).late for name in POSE}
    for name, own in parts[0].items():
        shift = late.get(name) or 0.0
        assert np.allclose(
            signals[name].t - own.t, 0.0 if name in stated else shift, rtol=0, atol=1e-12
        )
    return late, said


@pytest.mark.parametrize("shift", [-0.03, 0.0, 0.0123, 0.06])
def test_a_sinusoid_that_is_late_is_late_by_as_much(shift):
    t = np.arange(0, 10, 0.01)
    early, late = (np.sin(2 * np.pi * 0.7 * (t - by))[:, None] for by in (0.0, shift))
    dut = lag_of("late", "early", Signal(t, 3 * late + 1), Signal(t, early))
    assert dut.seconds == pytest.approx(shift, abs=1e-4)  # parabola of a 5 ms grid [s]
    assert (dut.beyond_doubt != 0) == (abs(shift) > 0.015)


@pytest.mark.parametrize("rate, seconds", [(50.0, 0.06), (200.0, -0.06)])
@pytest.mark.parametrize("names", [POSE, ATTITUDE, MOVED], ids=["pose", "attitude", "position"])
def test_what_is_late_is_measured_and_moved(flown, conventions, names, seconds, rate):
    signals = signals_of(conventions, flown(), names, seconds, rate)
    late, said = late_of(conventions, signals)
    assert late == {
        n: pytest.approx(seconds, abs=0.003) if n in names else None for n in POSE
    }  # [s]
    (line,) = map(str, said)
    assert all(f"{name}: {{late: {late[name]:g}}}" in line for name in names)


@pytest.mark.parametrize("seed", range(2))
def test_a_log_of_one_clock_keeps_its_times(flown, conventions, seed):
    for rate in (50.0, 200.0):
        late, said = late_of(conventions, signals_of(conventions, flown(seed), rate=rate))
        assert set(late.values()) == {None}
        assert said == []


def test_what_the_map_says_of_late_holds_also_zero(flown, conventions):
    signals = signals_of(conventions, flown(), POSE, 0.06)
    late, said = late_of(conventions, signals, attitude=0.0, position=0.0, velocity=0.0)
    assert set(late.values()) == {0.0}
    assert said == []
