"""A log is split where it breaks, the time is said, and its conventions are never blamed for it."""

import numpy as np
import pytest

from np_drake.logs.formats.format import Stream
from np_drake.logs.importing.breaks import find_breaks, split, without_frozen_poses
from np_drake.logs.importing.log_map import LogMap, Source
from np_drake.logs.importing.signals import Signal
from tests.np_drake.logs.importing import autopilot_streams as autopilots


def delayed(streams: dict[str, Stream], after: float, by: float) -> dict[str, Stream]:
    """Return streams whose clock is ahead by `by` [s] from `after` [s] on."""
    return {name: Stream(s.t + by * (s.t > after), s.columns) for name, s in streams.items()}


def spans(found) -> list[float]:
    return [float(np.round(flight.t[-1], 2)) for flight in found.flights]


def test_a_recorder_that_pauses_makes_two_flights(flown, import_px4):
    outputs = {"actuator_motors": autopilots.throttle(flown)}
    found = import_px4(outputs, change=lambda s: delayed(s, 4.0, 5.0))
    assert spans(found) == pytest.approx([3.0, 4.99], abs=0.02)
    assert any("a pause of 5.01 s at 3.00 s: split there" in line for line in found.shown)
    assert [flight.name for flight in found.flights] == ["log_part1", "log_part2"]


def test_a_clock_that_is_set_back_in_a_sorted_file_makes_two_flights(flown, import_ardupilot):
    pulses = 1000.0 + 1000.0 * autopilots.throttle(flown)
    found = import_ardupilot(pulses, change=lambda s: delayed(s, 5.0, -0.317))
    assert spans(found) == pytest.approx([3.683, 3.683], abs=0.05)
    (line,) = (line for line in found.shown if "rows of two times stand side by side" in line)
    assert float(line.split(" at ")[1].split()[0]) == pytest.approx(3.683, abs=0.05)


def shifted(stream: Stream, column: str, after: float, by: float) -> Stream:
    return Stream(
        stream.t, {**stream.columns, column: stream.columns[column] + by * (stream.t > after)}
    )


@pytest.mark.parametrize("counted", [True, False])
def test_a_height_that_jumps_makes_two_flights(flown, import_px4, counted):
    def reset(streams):
        place = shifted(streams["vehicle_local_position"], "z", 5.0, 0.8)
        if counted:
            place = Stream(place.t, {**place.columns, "z_reset_counter": 1.0 * (place.t > 5.0)})
        return {**streams, "vehicle_local_position": place}

    found = import_px4({"actuator_motors": autopilots.throttle(flown)}, change=reset)
    assert spans(found) == pytest.approx([4.0, 3.99], abs=0.02)
    said = "the estimator resets z (position by 0.79" if counted else "the position jumps by 0.79"
    assert any(
        line.startswith(said) and line.endswith("at 4.00 s: split there") for line in found.shown
    )


def test_a_reset_of_the_attitude_breaks_and_one_bad_sample_does_not():
    t = 0.01 * np.arange(500)
    log_map = LogMap(
        position=Source(["x", "y", "z"]), attitude=Source(["roll", "pitch", "yaw"], "rad")
    )
    place = np.column_stack([np.sin(t), np.cos(t), t])
    yaw = np.column_stack([0 * t, 0.1 * np.sin(3 * t), 0.2 * t + 0.5 * (t > 2.0)])
    signals = {"position": Signal(t, place), "attitude": Signal(t, yaw)}
    (found,) = find_breaks(signals, log_map, [])
    assert (found.before, found.after) == pytest.approx((2.0, 2.01))
    assert found.reason == "the attitude jumps by 28.8 deg"
    parts, _ = split(signals, [found])
    assert [len(part["attitude"].t) for part in parts] == [201, 299]
    place[100] += 5.0
    yaw[:, 2] = 0.2 * t
    assert find_breaks({**signals, "attitude": Signal(t, yaw)}, log_map, []) == []


T = 0.01 * np.arange(900)
TURNING = LogMap(
    position=Source(["x", "y", "z"]),
    attitude=Source(["roll", "pitch", "yaw"], "rad"),
    rates=Source(["p", "q", "r"]),
)


def yawing(yaw: np.ndarray, gyro: np.ndarray) -> dict[str, Signal]:
    o = 0 * T
    place = Signal(T, np.column_stack([yaw, o, o]))
    turn, rate = np.column_stack([o, o, yaw]), np.column_stack([o, o, gyro])
    return {"position": place, "attitude": Signal(T, turn), "rates": Signal(T, rate)}


def test_a_pose_that_repeats_while_the_gyro_turns_is_frozen():
    yaw, gyro = 0.5 * np.sin(T), 0.5 * np.cos(T) + 0.05  # with a bias [rad/s]
    yaw[650:680] = yaw[650]
    signals, (span,), (said,) = without_frozen_poses(yawing(yaw, gyro), TURNING)
    assert (span.before, span.after) == pytest.approx((T[650], T[681]))
    for name in ("position", "attitude"):
        assert len(signals[name].t) == len(T) - 30
    assert len(signals["rates"].t) == len(T)
    assert said.text.endswith("30 rows, 0.31 s in 1 stretches, left out")
    found = find_breaks(signals, TURNING, [], frozen=[span])
    assert [b.reason for b in found] == ["the pose repeats while the gyro turns"]
    inertial = {**signals, "acceleration": signals["rates"]}
    assert find_breaks(inertial, TURNING, [], frozen=[span]) == []


@pytest.mark.parametrize(
    "seen", [lambda yaw: yaw, lambda yaw: np.round(yaw, 2)], ids=["fine", "coarse"]
)
def test_a_pose_at_rest_or_of_coarse_resolution_is_alive(seen):
    turns = T > 4.0
    yaw = np.where(turns, 0.2 * np.sin(T - 4.0), 0.0)
    gyro = np.where(turns, 0.2 * np.cos(T - 4.0), 0.0) + 0.05 + 1e-3 * np.sin(50 * T)
    assert without_frozen_poses(yawing(seen(yaw), gyro), TURNING)[1:] == ([], [])


def test_a_whole_row_that_repeats_is_no_frozen_pose():
    rows = np.where((T > 6.5) & (T < 6.8), 650, np.arange(len(T)))
    yaw, gyro = 0.5 * np.sin(T), 0.5 * np.cos(T)
    assert without_frozen_poses(yawing(yaw[rows], gyro[rows]), TURNING)[1:] == ([], [])
