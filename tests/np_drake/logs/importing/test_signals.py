"""Laws of signals: what is no sample is left out, and values between samples follow the flight."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake import attitude
from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import Recording, Stream
from np_drake.logs.importing.log_map import LogMap, Source
from np_drake.logs.importing.signals import Signal, gather, with_map_time, without_zeros

MAP = LogMap(position=Source(["x", "y", "z"]))


def recording(t, **columns):
    return Recording("made", {"table": Stream(t, columns)})


def moving(t):
    return {"x": np.sin(t), "y": np.cos(t), "z": 1 + 0.1 * t}


def test_rows_without_number_or_running_back_are_left_out_and_counted():
    t = 0.01 * np.arange(100)
    x = moving(t)
    x["y"][7] = np.nan
    t = t.copy()
    t[20] = t[19]
    t[30] = 0.0
    signals, notes = gather(recording(t, **x), MAP)
    assert len(signals["position"].t) == 97
    assert np.all(np.diff(signals["position"].t) > 0)
    assert list(map(str, notes)) == [
        "position: rows left out: 1 with no number, 2 with time not increasing"
    ]


def test_a_quaternion_of_zeros_is_no_attitude():
    t = 0.01 * np.arange(100)
    q = {"w": np.cos(t), "i": np.sin(t), "j": 0 * t, "k": 0 * t}
    q["w"][:30], q["i"][:30] = 0.0, 0.0  # an estimator that has not started
    signals, notes = gather(recording(t, **q), LogMap(attitude=Source(["w", "i", "j", "k"])))
    assert signals["attitude"].t[0] == t[30]
    assert list(map(str, notes)) == ["attitude: rows left out: 30 with a quaternion of zeros"]


def test_repeated_rows_are_a_signal_of_a_slower_rate():
    t = 0.01 * np.arange(400)
    x = {name: np.repeat(value[::5], 5) for name, value in moving(t).items()}
    signals, notes = gather(recording(t, **x), MAP)
    assert signals["position"].step == pytest.approx(0.05)
    assert "rows repeat" in notes[0].text


def test_columns_of_another_stream_are_read_at_the_times_of_the_first():
    t, other = 0.01 * np.arange(100), 0.004 * np.arange(250)
    streams = {"a": Stream(t, {"x": t}), "b": Stream(other, {"y": 2 * other, "z": 3 * other})}
    signals, _ = gather(Recording("made", streams), MAP)
    assert np.allclose(signals["position"].values, t[:, None] * [1, 2, 3])


def test_times_that_do_not_increase_are_named_where_no_samples_are_left():
    t = np.full(100, 1.7e9)  # printed with six digits
    with pytest.raises(LogError, match=r"got 1 in x, y, z .99 with time not increasing"):
        gather(recording(t, **moving(0.01 * np.arange(100))), MAP)


RECORDING = Recording(
    "made.log",
    {
        "a": Stream(np.arange(3.0), {"clock": np.array([0.0, 2.0, 4.0])}),
        "b": Stream(np.arange(2.0), {}),
    },
)


@pytest.mark.parametrize("unit, factor", [("", 1.0), ("ms", 1e-3)])
def test_one_stream_takes_its_times_from_the_map(unit, factor):
    dut = with_map_time(RECORDING, LogMap(time=Source(["a/clock"], unit=unit)))
    np.testing.assert_array_equal(dut.streams["a"].t, np.array([0, 2, 4]) * factor)
    assert dut.streams["b"] is RECORDING.streams["b"]


EXACT = 1e-12
AXIS = np.array([0.36, 0.48, 0.8])
HALF_SECONDS, BETWEEN = 0.5 * np.arange(9), np.linspace(0.0, 4.0, 173)


def constant_turn(t, rate=1.3):
    return attitude.from_rotation_vector(rate * t[:, None] * AXIS)


def angle_between(q, r):
    return np.linalg.norm(
        attitude.rotation_vector(attitude.multiply(attitude.conjugate(q), r)), axis=1
    )


def test_attitude_follows_a_growing_rate_between_its_samples():
    fine = np.linspace(0.0, 4.0, 401)
    q = attitude.from_rotation_vector(0.2 * HALF_SECONDS[:, None] ** 2 * AXIS)
    dut = Signal(HALF_SECONDS, q).turned(Signal(fine, 0.4 * fine[:, None] * AXIS), BETWEEN)
    true = attitude.from_rotation_vector(0.2 * BETWEEN[:, None] ** 2 * AXIS)
    assert angle_between(dut, true).max() < 1e-10
    assert (
        angle_between(Signal(HALF_SECONDS, q).turned(None, BETWEEN), true).max() > 1e-3
    )  # the rate is needed


@pytest.mark.parametrize("bias", [None, 0.0, 0.2])
def test_attitude_in_a_constant_turn_is_exact_whatever_the_bias(bias):
    fine = np.linspace(0.0, 4.0, 401)
    gyro = None if bias is None else Signal(fine, (1.3 + bias + 0 * fine[:, None]) * AXIS)
    dut = Signal(HALF_SECONDS, constant_turn(HALF_SECONDS)).turned(gyro, BETWEEN)
    assert angle_between(dut, constant_turn(BETWEEN)).max() < 1e-12  # [rad]


def test_constant_acceleration_is_a_parabola_between_samples():
    fine = np.linspace(0.0, 4.0, 81)
    rate = Signal(fine, 3.0 * fine[:, None])
    dut = Signal(HALF_SECONDS, 1.5 * HALF_SECONDS[:, None] ** 2).integrated(rate, BETWEEN)
    assert np.abs(dut[:, 0] - 1.5 * BETWEEN**2).max() < EXACT


def test_the_mean_of_a_line_is_its_middle_and_that_of_a_wave_is_less():
    t = np.linspace(0.0, 4.0, 4001)
    at = np.linspace(0.53, 3.53, 31)  # [s], not at zeros of the wave
    assert np.allclose(Signal(t, 2 * t[:, None]).averaged(at, 0.1)[:, 0], 2 * at, atol=EXACT)
    width = 0.1
    share = np.sin(np.pi * 5 * width) / (np.pi * 5 * width)  # of a 5 Hz wave, by a window
    wave = np.sin(2 * np.pi * 5 * t[:, None])
    assert np.allclose(
        Signal(t, wave).averaged(at, width)[:, 0], share * np.sin(2 * np.pi * 5 * at), atol=1e-4
    )


def test_held_commands_average_by_the_time_that_each_is_held():
    t, x = np.array([0.0, 0.3, 0.4, 1.0]), np.array([[1.0], [5.0], [-2.0], [7.0]])
    dut = Signal(t, x).stepwise(np.array([0.0, 0.5, 1.0, 2.0]))
    assert np.allclose(dut[:, 0], [(0.3 * 1 + 0.1 * 5 - 0.1 * 2) / 0.5, -2.0, 7.0, 7.0], atol=EXACT)


@given(st.lists(st.floats(1e-3, 0.5), min_size=2, max_size=20), st.integers(0, 2**31))
def test_commands_at_their_own_rows_are_kept_to_the_bit(steps, seed):
    t = np.cumsum(steps)
    x = np.random.default_rng(seed).normal(size=(len(t), 4))
    assert np.array_equal(Signal(t, x).stepwise(t), x)


@given(st.lists(st.floats(1e-3, 0.5), min_size=2, max_size=20), st.integers(0, 2**31))
def test_holding_loses_no_impulse(steps, seed):
    t = np.cumsum(steps)
    x = np.random.default_rng(seed).normal(size=(len(t), 2))
    rows = np.linspace(t[0], t[-1], 7)
    mean = Signal(t, x).stepwise(rows)
    given_ = np.sum(x[:-1] * np.diff(t)[:, None], axis=0)
    assert np.allclose(np.sum(mean[:-1] * np.diff(rows)[:, None], axis=0), given_, atol=1e-9)


def readings(missing: dict[int, slice]) -> np.ndarray:
    """Return speeds (100, 4) at 100 Hz with zeros of some rotors."""
    speed = np.full((100, 4), 900.0)
    for rotor, rows in missing.items():
        speed[rows, rotor] = 0.0
    return speed


FIRST, TWO, LONG, END = slice(1), slice(60, 62), slice(30, 70), slice(80, 100)


@pytest.mark.parametrize(
    "missing, command, bridged, lost, zeros",
    [
        ({0: TWO}, None, 2, 0, 0),
        (dict.fromkeys(range(4), TWO), None, 8, 0, 0),
        ({0: FIRST}, None, 0, 1, 0),
        ({0: LONG, 1: LONG, 2: LONG}, None, 0, 40, 0),
        (dict.fromkeys(range(4), LONG), 0.5, 0, 40, 0),
        (dict.fromkeys(range(4), END), 0.5, 0, 20, 0),
        (dict.fromkeys(range(4), END), 0.05, 0, 0, 80),  # it has landed
        ({3: END}, 0.5, 0, 0, 20),  # it has stopped, as far as its speed tells
        ({3: slice(100)}, None, 0, 100, 0),
    ],
)
def test_a_rotor_that_reads_zero_while_the_vehicle_flies_is_not_read(
    missing, command, bridged, lost, zeros
):
    own, level = Signal(0.01 * np.arange(100), readings(missing)), np.full(100, 0.5)
    level[next(iter(missing.values()))] = command or 0.5
    values, short, long = without_zeros(own, level if command else None)
    assert (short.sum(), long.any(axis=1).sum()) == (bridged, lost)
    assert np.all(values[short] == 900.0)
    assert np.sum((own.values == 0) & ~short & ~long) == zeros


def test_a_rotor_that_slows_down_before_it_stops_is_read():
    speed = readings({0: LONG})
    speed[20:30, 0] = np.linspace(900.0, 60.0, 10)
    values, *missing = without_zeros(Signal(0.01 * np.arange(100), speed))
    assert not np.any(missing)
    np.testing.assert_array_equal(values, speed)


def test_rotor_speed_of_which_much_is_missing_gives_way_to_throttle():
    columns = {f"r{i}": x for i, x in enumerate(readings({0: LONG}).T)}
    log_map = LogMap(rotor_speed=Source(list(columns)), throttle=Source(["u"]))
    told = recording(0.01 * np.arange(100), u=np.full(100, 0.5), **columns)
    signals, notes = gather(told, log_map)
    assert list(signals) == ["throttle"]
    assert "in 40% of the rows; left out" in notes[0].text
    dead = recording(
        0.01 * np.arange(100), **{f"r{i}": x for i, x in enumerate(readings({0: slice(100)}).T)}
    )
    with pytest.raises(LogError, match=r"must be that of turning rotors; .* in 100% of the rows"):
        gather(dead, LogMap(rotor_speed=log_map.rotor_speed))
