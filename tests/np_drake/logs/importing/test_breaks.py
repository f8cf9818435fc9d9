"""A log is split where it breaks, the time is said, and its conventions are never blamed for it."""

import numpy as np
import pytest

from np_drake.logs.formats.format import Recording, Stream
from np_drake.logs.importing.breaks import find_breaks, split
from np_drake.logs.importing.clock_parts import clock_parts
from np_drake.logs.importing.import_log import import_log
from np_drake.logs.importing.interpolation import Signal
from np_drake.logs.importing.log_map import LogMap, Source


def delayed(streams: dict[str, Stream], after: float, by: float) -> dict[str, Stream]:
    """Return streams whose clock is ahead by `by` [s] from `after` [s] on."""
    return {name: Stream(s.t + by * (s.t > after), s.columns) for name, s in streams.items()}


def spans(found) -> list[float]:
    return [float(np.round(flight.t[-1], 2)) for flight in found.flights]


@pytest.mark.parametrize("pause", [5.0, 1000.0])
def test_a_recorder_that_pauses_makes_two_flights(flown, autopilots, import_px4, pause):
    outputs = {"actuator_motors": autopilots.throttle(flown)}
    found = import_px4(outputs, change=lambda s: delayed(s, 4.0, pause))
    assert spans(found) == pytest.approx([3.0, 4.99], abs=0.02)
    assert any(
        f"a pause of {pause + 0.01:.3g} s at 3.00 s: split there" in line for line in found.said
    )
    assert [flight.name for flight in found.flights] == ["log_part1", "log_part2"]


def test_a_part_in_which_the_vehicle_lies_with_idling_rotors_is_no_flight(
    flown, autopilots, import_px4
):
    noise = np.random.default_rng(0).normal(0.0, 1e-3, len(flown.t))

    def lying(streams):
        out, level = {}, {"z": -0.1, "q[0]": 1.0, "accelerometer_m_s2[2]": -9.81}
        for name, s in streams.items():
            rest = {
                c: 0.3 * v if "control" in c else level.get(c, 0.0) + noise
                for c, v in s.columns.items()
            }
            out[name] = Stream(
                s.t, {c: np.where(s.t > 6.0, rest[c], v) for c, v in s.columns.items()}
            )
        return delayed(out, 6.0, 5.0)

    found = import_px4({"actuator_motors": autopilots.throttle(flown)}, change=lying)
    assert spans(found) == pytest.approx([5.0], abs=0.02)
    assert any(
        line.startswith("the part from 10.") and line.endswith("holds no flight; left out")
        for line in found.said
    )


@pytest.mark.parametrize("back", [0.5, 0.317, 2.0])
def test_a_clock_that_is_set_back_in_a_sorted_file_makes_two_flights(
    flown, autopilots, import_ardupilot, back
):
    pulses = 1000.0 + 1000.0 * autopilots.throttle(flown)
    found = import_ardupilot(pulses, change=lambda s: delayed(s, 5.0, -back))
    assert spans(found) == pytest.approx([4.0 - back, 4.0 - back], abs=0.05)
    (line,) = (line for line in found.said if "rows of two times stand side by side" in line)
    assert float(line.split(" at ")[1].split()[0]) == pytest.approx(4.0 - back, abs=0.05)


@pytest.mark.parametrize("back", [0.5, 4.5])
def test_rows_in_the_order_in_which_they_came_lose_nothing(flown, back):
    t = flown.t - back * (flown.t > 4.0)
    stream = Stream(t, {"x": flown.p[:, 0]})
    parts, said = clock_parts(Recording("made.log", {"a": stream, "b": stream}))
    assert [len(part.streams["b"]) for part in parts] == [401, 400]
    assert said == [f"the clock is set back by {back - 0.01:.3g} s at 4 s: split there"]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_clock_that_is_set_by_hours_makes_two_flights(flown, autopilots, import_px4, sign):
    def on_the_wall(streams):
        return {
            n: Stream(s.t + 1.7e9 * (sign * s.t > sign * 4.0), s.columns)
            for n, s in streams.items()
        }

    found = import_px4({"actuator_motors": autopilots.throttle(flown)}, change=on_the_wall)
    assert sorted(spans(found)) == pytest.approx([3.0, 4.99], abs=0.02)
    assert any(line.startswith("the clock is set between") for line in found.said)


def test_a_velocity_that_is_reset_breaks_the_log(flown, autopilots, import_px4):
    def reset(streams):
        return {
            **streams,
            "vehicle_local_position": shifted(streams["vehicle_local_position"], "vx", 5.0, 2.5),
        }

    found = import_px4({"actuator_motors": autopilots.throttle(flown)}, change=reset)
    assert any(line.startswith("the velocity jumps by 2.") for line in found.said)
    assert spans(found)[0] == pytest.approx(4.0, abs=0.02)


def test_rows_in_no_order_are_not_taken_for_steps_of_the_clock():
    t = np.random.default_rng(0).permutation(0.01 * np.arange(200_000))
    recording = Recording("made.log", {"a": Stream(t, {"x": t})})
    parts, said = clock_parts(recording)
    assert ([len(part.streams["a"]) for part in parts], said) == ([200_000], [])


def test_late_messages_set_no_clock_back(flown):
    t = flown.t.copy()
    t[[100, 300]] -= 0.5
    t[200] += 1e9
    parts, said = clock_parts(Recording("made.log", {"a": Stream(t, {"x": flown.p[:, 0]})}))
    assert (len(parts), said) == (1, [])


def test_a_bag_with_stamps_before_the_clock_is_read_from_the_clock_on(flown, writer, tmp_path):
    pytest.importorskip("rosbags", reason="ROS bags need rosbags")
    t = np.where(flown.t < 1.0, 0.0, flown.t + 100.0)
    pose = [f"pose.pose.position.{a}" for a in "xyz"] + [
        f"pose.pose.orientation.{a}" for a in "wxyz"
    ]
    twist = [f"twist.twist.{kind}.{a}" for kind in ("linear", "angular") for a in "xyz"]
    from np_drake import attitude

    body = np.column_stack([attitude.rotate_back(flown.q, flown.v), flown.w])
    columns = dict(zip([*pose, *twist], np.column_stack([flown.p, flown.q, body]).T, strict=True))
    wrench = dict(
        zip(["wrench.force.z", *(f"wrench.torque.{a}" for a in "xyz")], flown.u.T, strict=True)
    )
    wrench["wrench.force.x"] = 0 * flown.t
    writer("ros").write(
        tmp_path / "bag", {"/odom": Stream(t, columns), "/wrench": Stream(t, wrench)}
    )
    found = import_log(tmp_path / "bag")
    assert spans(found) == pytest.approx([7.0], abs=0.02)
    assert (
        "/odom, /wrench: 100 rows at 0 s, before the clock runs from 101 s on, left out"
        in found.said
    )


def shifted(stream: Stream, column: str, after: float, by: float) -> Stream:
    return Stream(
        stream.t, {**stream.columns, column: stream.columns[column] + by * (stream.t > after)}
    )


@pytest.mark.parametrize("counted", [True, False])
def test_a_height_that_jumps_makes_two_flights(flown, autopilots, import_px4, counted):
    def reset(streams):
        place = shifted(streams["vehicle_local_position"], "z", 5.0, 0.8)
        if counted:
            place = Stream(place.t, {**place.columns, "z_reset_counter": 1.0 * (place.t > 5.0)})
        return {**streams, "vehicle_local_position": place}

    found = import_px4({"actuator_motors": autopilots.throttle(flown)}, change=reset)
    assert spans(found) == pytest.approx([4.0, 3.99], abs=0.02)
    said = "the estimator resets z (position by 0.79" if counted else "the position jumps by 0.79"
    assert any(
        line.startswith(said) and line.endswith("at 4.00 s: split there") for line in found.said
    )


def test_a_reset_that_moves_nothing_breaks_nothing(flown, autopilots, import_px4):
    def reset(streams):
        place = streams["vehicle_local_position"]
        counter = {"xy_reset_counter": 1.0 * (place.t > 5.0)}
        return {**streams, "vehicle_local_position": Stream(place.t, {**place.columns, **counter})}

    assert (
        len(import_px4({"actuator_motors": autopilots.throttle(flown)}, change=reset).flights) == 1
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


def test_a_switch_of_the_estimator_s_core_is_followed_and_splits(
    flown, autopilots, import_ardupilot
):
    def lanes(streams):
        one = streams.pop("XKF1.0")
        drifted = dict(one.columns) | {c: one.columns[c] + 3.0 for c in ("PN", "PE")}
        t = np.arange(1.0, 9.0, 0.1)
        bad = {name: np.where(one.t > 5.0, 40.0, values) for name, values in one.columns.items()}
        core = Stream(t, {"PI": (t > 5.0).astype(float)})
        quaternion = streams.pop("XKQ.0")
        both = {f"XKQ.{i}": quaternion for i in range(2)}
        return {
            **streams,
            **both,
            "XKF1.0": Stream(one.t, bad),
            "XKF1.1": Stream(one.t, drifted),
            "XKF4.0": core,
        }

    found = import_ardupilot(1000.0 + 1000.0 * autopilots.throttle(flown), change=lanes)
    assert spans(found) == pytest.approx([4.0, 3.9], abs=0.15)
    assert any(
        "switches from core 0 of its estimator to core 1 at 3.9" in line for line in found.said
    )
    assert found.sheet.content["columns"]["position"]["from"][0] == "XKF1.primary/PN"
    assert max(np.abs(flight.p).max() for flight in found.flights) < 10.0


def test_a_switch_splits_a_log_of_one_core_as_well(flown, autopilots, import_ardupilot):
    t = np.arange(1.0, 9.0, 0.1)
    lane = {"XKF4.0": Stream(t, {"PI": (t > 5.0).astype(float)})}
    found = import_ardupilot(
        1000.0 + 1000.0 * autopilots.throttle(flown), change=lambda streams: streams | lane
    )
    assert spans(found) == pytest.approx([4.0, 3.9], abs=0.15)
    assert found.sheet.content["columns"]["position"]["from"][0] == "XKF1.0/PN"


def test_a_part_that_contradicts_itself_is_left_out_and_named(flown, autopilots, import_px4):
    def wild(streams):
        streams = delayed(streams, 6.0, 3.0)
        turn = streams["vehicle_angular_velocity"]
        columns = {
            name: np.where(turn.t > 6.0, 5 * np.sin(9 * turn.t), v)
            for name, v in turn.columns.items()
        }
        return {**streams, "vehicle_angular_velocity": Stream(turn.t, columns)}

    found = import_px4({"actuator_motors": autopilots.throttle(flown)}, change=wild)
    assert spans(found) == pytest.approx([5.0], abs=0.02)
    assert "the part from 8.01 s on does not agree with itself; left out" in found.said
    assert found.flights[0].name == "log"


def test_signals_without_a_break_stay_one_part(flown):
    t = flown.t
    signals = {
        "position": Signal(t, flown.p),
        "attitude": Signal(t, flown.q),
        "voltage": Signal(t[::500], t[::500, None]),
    }
    log_map = LogMap(position=Source(["x", "y", "z"]), attitude=Source(["w", "x", "y", "z"]))
    assert find_breaks(signals, log_map, []) == []
    assert split(signals, []) == ([signals], [])


@pytest.mark.parametrize("back, parts", [(0.5, 2), (100.0, 1)])
def test_receipts_set_back_stay_apart_and_blocks_out_of_order_do_not(
    tmp_path, writer, flown, back, parts
):
    pytest.importorskip("rosbags", reason="ROS bags need rosbags")
    import sqlite3

    from np_drake.logs.formats.ros import ROS

    writer("ros").write(
        tmp_path / "bag", {"/x": Stream(flown.t, {"data": flown.t})}, storage="sqlite3"
    )
    with sqlite3.connect(next((tmp_path / "bag").glob("*.db3"))) as database:
        database.execute(
            "UPDATE messages SET timestamp = timestamp - ? WHERE id > 400", (round(back * 1e9),)
        )
    stream = ROS.read(tmp_path / "bag", {"/x": ["data"]}, lambda share: None).streams["/x"]
    found, _ = clock_parts(Recording("bag", {"/x": stream}))
    assert len(found) == parts
    first = found[0].streams["/x"].columns["data"]
    assert first[0] == (0.0 if parts == 2 else 4.0)
    assert (np.diff(found[0].streams["/x"].t) >= 0).all()
