"""Laws of messages: what is packed is read, in axes of known closed forms, and what is no message
does no harm.
"""

import sys
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from np_drake import attitude
from np_drake.offboard.codec import (
    ARDUPILOT,
    AUTOPILOT,
    COMPANION,
    PX4,
    Battery,
    Codec,
    Command,
    Heartbeat,
    HoldPlace,
    Inertial,
    Pose,
)
from np_drake.rigid_body import P, Q, V, W

common = pytest.importorskip("pymavlink.dialects.v20.common", reason="messages need pymavlink")

SINGLE = 1e-6  # of a 32-bit float over its value, with the turns between axes [1]
LEVEL_NORTH = [1.0, 0.0, 0.0, 0.0]  # of MAVLink
LONGEST = 280  # of a message of MAVLink 2 [bytes]
VECTORS = arrays(float, 3, elements=st.floats(-50, 50))
TURNS = arrays(float, 3, elements=st.floats(-3, 3))
STATES = st.builds(
    lambda p, turn, v, w: np.concatenate([p, attitude.from_rotation_vector(turn), v, w]),
    VECTORS,
    TURNS,
    VECTORS,
    TURNS,
)
STAMPS = st.floats(0.0, 1e6)
MESSAGES = st.lists(
    st.sampled_from(["heartbeat", "odometry", "local_position", "inertial", "command"]),
    min_size=1,
    max_size=6,
)


def packed(message) -> bytes:
    """Bytes of a message of pymavlink itself."""
    return bytes(message.pack(common.MAVLink(None, srcSystem=1, srcComponent=1)))


def only(data: bytes):
    (said,) = Codec(COMPANION, 1).parse(data)
    return said


def raw(data: bytes):
    """The message as pymavlink reads it."""
    (message,) = common.MAVLink(None).parse_buffer(data)
    return message


def odometry(q=LEVEL_NORTH, *, frames=(1, 12), v=(0.0, 0.0, 0.0), w=(0.0, 0.0, 0.0)) -> Pose | None:
    """What an ODOMETRY at north 1, east 2, down 3 says."""
    message = common.MAVLink_odometry_message(
        5_000_000, *frames, 1.0, 2.0, 3.0, q, *v, *w, [0.0] * 21, [0.0] * 21
    )
    found = Codec(COMPANION, 1).parse(packed(message))
    return found[0] if found else None


def sent(kind: str, codec: Codec) -> bytes:
    x = np.eye(13)[3]
    return {
        "heartbeat": codec.heartbeat(engaged=True, autopilot=PX4),
        "odometry": codec.odometry(1.0, x),
        "local_position": codec.local_position(1.0, x),
        "inertial": codec.inertial(1.0, np.ones(3), np.ones(3)),
        "command": codec.command(1.0, np.ones(3), 0.5, in_force=True),
    }[kind]


def kinds(said) -> list[str]:
    return [getattr(one, "kind", type(one).__name__) for one in said]


@given(x=STATES, stamp=STAMPS)
def test_a_state_goes_through_odometry_and_comes_back(x, stamp):
    dut = only(Codec(AUTOPILOT).odometry(stamp, x))
    assert dut.stamp == pytest.approx(stamp, abs=1e-6)
    np.testing.assert_allclose(
        dut.x[[*range(3), *range(7, 13)]], x[[*range(3), *range(7, 13)]], atol=100 * SINGLE
    )
    np.testing.assert_allclose(
        attitude.rotation_matrix(dut.x[Q]), attitude.rotation_matrix(x[Q]), atol=SINGLE
    )


@given(x=STATES, stamp=STAMPS)
def test_a_state_goes_through_position_and_attitude_and_comes_back(x, stamp):
    where, turned = Codec(COMPANION, 1).parse(Codec(AUTOPILOT).local_position(stamp, x))
    assert (where.kind, turned.kind) == ("LOCAL_POSITION_NED", "ATTITUDE_QUATERNION")
    assert where.stamp == turned.stamp == pytest.approx(stamp, abs=1e-3)
    np.testing.assert_allclose(where.x[P], x[P], atol=50 * SINGLE)
    np.testing.assert_allclose(where.x[V], x[V], atol=50 * SINGLE)
    np.testing.assert_allclose(turned.x[W], x[W], atol=5 * SINGLE)
    np.testing.assert_allclose(
        attitude.rotation_matrix(turned.x[Q]), attitude.rotation_matrix(x[Q]), atol=SINGLE
    )
    assert np.isnan([*where.x[Q], *where.x[W], *turned.x[P], *turned.x[V]]).all()


@given(f=VECTORS, w=TURNS, stamp=STAMPS)
def test_specific_force_and_rates_go_through_and_come_back(f, w, stamp):
    dut = only(Codec(AUTOPILOT).inertial(stamp, f, w))
    assert isinstance(dut, Inertial)
    assert dut.stamp == pytest.approx(stamp, abs=1e-6)
    np.testing.assert_allclose(dut.f, f, atol=50 * SINGLE)
    np.testing.assert_allclose(dut.w, w, atol=5 * SINGLE)


@given(rates=TURNS, thrust=st.floats(0.0, 1.0), in_force=st.booleans())
def test_a_command_goes_through_and_comes_back(rates, thrust, in_force):
    sender, receiver = (AUTOPILOT, COMPANION) if in_force else (COMPANION, AUTOPILOT)
    (dut,) = Codec(receiver, 1).parse(Codec(sender).command(7.25, rates, thrust, in_force=in_force))
    assert isinstance(dut, Command)
    assert dut.stamp == pytest.approx(7.25, abs=1e-3)
    np.testing.assert_allclose(dut.rates, rates, atol=5 * SINGLE)
    assert dut.thrust == pytest.approx(thrust, abs=SINGLE)


def test_north_east_down_is_y_x_and_minus_z():
    np.testing.assert_allclose(odometry().x[P], [2.0, 1.0, -3.0])


def test_a_vehicle_that_is_level_and_faces_north_has_a_yaw_of_90_degrees():
    dut = odometry(v=(4.0, 0.0, 0.0))
    np.testing.assert_allclose(
        attitude.rotation_matrix(dut.x[Q])[:, 0], [0.0, 1.0, 0.0], atol=SINGLE
    )
    np.testing.assert_allclose(
        attitude.rotation_matrix(dut.x[Q])[:, 2], [0.0, 0.0, 1.0], atol=SINGLE
    )
    np.testing.assert_allclose(dut.x[V], [0.0, 4.0, 0.0], atol=5 * SINGLE)


def test_a_roll_to_the_right_keeps_its_sign():
    dut = odometry([np.cos(0.15), np.sin(0.15), 0.0, 0.0], w=(0.5, 0.0, 0.0))
    R = attitude.rotation_matrix(dut.x[Q])
    assert dut.x[10] == pytest.approx(0.5)
    np.testing.assert_allclose(
        R[:, 2], [np.sin(0.3), 0.0, np.cos(0.3)], atol=SINGLE
    )  # the thrust leans to the east


def test_a_pitch_up_changes_its_sign():
    dut = odometry([np.cos(0.15), 0.0, np.sin(0.15), 0.0], w=(0.0, 0.5, 0.0))
    R = attitude.rotation_matrix(dut.x[Q])
    assert dut.x[11] == pytest.approx(-0.5)
    np.testing.assert_allclose(
        R[:, 0], [0.0, np.cos(0.3), np.sin(0.3)], atol=SINGLE
    )  # the nose points up


def test_a_turn_to_the_right_changes_its_sign():
    dut = odometry([np.cos(0.15), 0.0, 0.0, np.sin(0.15)], w=(0.0, 0.0, 0.5))
    assert dut.x[12] == pytest.approx(-0.5)
    np.testing.assert_allclose(
        attitude.rotation_matrix(dut.x[Q])[:, 0], [np.sin(0.3), np.cos(0.3), 0.0], atol=SINGLE
    )


def test_the_velocity_of_odometry_is_in_the_axes_that_it_names():
    q = [np.cos(np.pi / 4), 0.0, 0.0, np.sin(np.pi / 4)]  # facing east
    np.testing.assert_allclose(
        odometry(q, v=(3.0, 0.0, 1.0)).x[V], [3.0, 0.0, -1.0], atol=5 * SINGLE
    )
    np.testing.assert_allclose(
        odometry(q, v=(3.0, 0.0, 1.0), frames=(1, 1)).x[V], [0.0, 3.0, -1.0], atol=5 * SINGLE
    )


def test_odometry_in_another_world_is_not_read():
    assert odometry(frames=(21, 12)) is None


def test_at_rest_the_specific_force_is_against_gravity():
    up = np.array([0.0, 0.0, 9.81])
    assert raw(Codec(AUTOPILOT).inertial(0.0, up, np.zeros(3))).zacc == pytest.approx(-9.81)
    message = common.MAVLink_highres_imu_message(0, 0.0, 0.0, -9.81, 0.1, 0.2, 0.3, *[0.0] * 7, 63)
    dut = only(packed(message))
    np.testing.assert_allclose(dut.f, up, rtol=SINGLE)
    np.testing.assert_allclose(dut.w, [0.1, -0.2, -0.3], rtol=SINGLE)


def test_a_command_is_of_body_rates_and_thrust_in_the_axes_of_mavlink():
    dut = raw(Codec(COMPANION).command(2.5, np.array([0.1, 0.2, 0.3]), 0.7))
    assert dut.get_type() == "SET_ATTITUDE_TARGET"
    assert dut.type_mask == common.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
    assert (dut.target_system, dut.target_component, dut.time_boot_ms) == (1, 1, 2500)
    np.testing.assert_allclose(
        [dut.body_roll_rate, dut.body_pitch_rate, dut.body_yaw_rate, dut.thrust],
        [0.1, -0.2, -0.3, 0.7],
        rtol=SINGLE,
    )


def test_what_is_in_force_is_told_as_the_target_of_the_autopilot():
    dut = raw(Codec(AUTOPILOT).command(2.5, np.array([0.1, 0.2, 0.3]), 0.7, in_force=True))
    assert dut.get_type() == "ATTITUDE_TARGET"
    assert [dut.body_roll_rate, dut.body_pitch_rate, dut.body_yaw_rate] == pytest.approx(
        [0.1, -0.2, -0.3]
    )


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("entry", range(4))
def test_a_command_that_is_not_finite_is_refused(entry, value):
    command = np.array([0.1, 0.2, 0.3, 0.5])
    command[entry] = value
    with pytest.raises(ValueError, match="body rates and thrust must be finite"):
        Codec(COMPANION).command(0.0, command[:3], command[3])


def heartbeat_of(autopilot: int, mode: int, *, base: int = 128 | 1) -> list:
    return Codec(COMPANION, 1).parse(
        packed(common.MAVLink_heartbeat_message(2, autopilot, base, mode, 4, 3))
    )


@pytest.mark.parametrize(
    ("autopilot", "mode", "engaged"),
    [
        (PX4, 6 << 16, True),  # offboard
        (PX4, 4 << 16 | 3 << 24, False),  # hold
        (PX4, 4 << 16 | 4 << 24, False),  # mission
        (PX4, 3 << 16, False),  # position
        (PX4, 4, False),  # GUIDED of the other kind
        (ARDUPILOT, 4, True),  # GUIDED
        (ARDUPILOT, 20, True),  # GUIDED_NOGPS
        (ARDUPILOT, 5, False),  # LOITER
        (ARDUPILOT, 0, False),  # STABILIZE
        (ARDUPILOT, 6 << 16, False),  # offboard of the other kind
    ],
)
def test_the_mode_tells_whether_an_autopilot_follows(autopilot, mode, engaged):
    assert heartbeat_of(autopilot, mode) == [Heartbeat(engaged, autopilot)]
    assert heartbeat_of(autopilot, mode, base=1) == [Heartbeat(False, autopilot)]  # not armed


@pytest.mark.parametrize(("base", "engaged"), [(128 | 8, True), (128, False), (8, False)])
def test_another_autopilot_follows_in_its_guided_mode(base, engaged):
    assert heartbeat_of(0, 0, base=base) == [Heartbeat(engaged, 0)]


def test_a_vehicle_is_simulated_where_its_autopilot_blocks_its_motors():
    (real,), (simulated,) = (
        heartbeat_of(PX4, 6 << 16),
        heartbeat_of(PX4, 6 << 16, base=128 | 32 | 1),
    )
    assert (real.engaged, real.simulated, simulated.engaged, simulated.simulated) == (
        True,
        False,
        True,
        True,
    )


@pytest.mark.parametrize("engaged", [True, False])
def test_the_heartbeat_of_an_autopilot_is_read_as_it_was_meant(engaged):
    assert only(Codec(AUTOPILOT).heartbeat(engaged=engaged, autopilot=PX4)) == Heartbeat(
        engaged, PX4, simulated=True
    )


def test_a_companions_heartbeat_is_not_the_autopilots():
    assert Codec(AUTOPILOT).parse(Codec(COMPANION).heartbeat()) == []
    dut = raw(Codec(COMPANION).heartbeat())
    assert (dut.type, dut.autopilot) == (
        common.MAV_TYPE_ONBOARD_CONTROLLER,
        common.MAV_AUTOPILOT_INVALID,
    )
    assert (dut.get_srcSystem(), dut.get_srcComponent()) == (1, common.MAV_COMP_ID_ONBOARD_COMPUTER)


@pytest.mark.parametrize(("millivolts", "said"), [(15500, [Battery(15.5)]), (0, []), (65535, [])])
def test_the_voltage_is_read_where_it_is_known(millivolts, said):
    message = common.MAVLink_sys_status_message(0, 0, 0, 0, millivolts, -1, -1, 0, 0, 0, 0, 0, 0)
    assert Codec(COMPANION, 1).parse(packed(message)) == said


def test_a_request_names_message_and_interval():
    dut = raw(Codec(COMPANION).request("ODOMETRY", 50.0))
    assert (dut.command, dut.param1, dut.param2) == (
        common.MAV_CMD_SET_MESSAGE_INTERVAL,
        331.0,
        20000.0,
    )
    assert (dut.target_system, dut.target_component) == (1, 1)


@pytest.mark.parametrize(("autopilot", "mode"), [(PX4, (4, 3)), (ARDUPILOT, (5, 0))])
def test_a_request_to_hold_names_the_mode_of_the_autopilot(autopilot, mode):
    data = Codec(COMPANION).hold(autopilot)
    dut = raw(data)
    assert (dut.command, dut.param1, dut.param2, dut.param3) == (
        common.MAV_CMD_DO_SET_MODE,
        1.0,
        *mode,
    )
    assert Codec(AUTOPILOT).parse(data) == [HoldPlace()]


@settings(max_examples=50, deadline=None)
@given(chosen=MESSAGES, cuts=st.lists(st.integers(0, 600), max_size=8))
def test_a_stream_may_be_cut_anywhere(chosen, cuts):
    data = b"".join(sent(kind, Codec(AUTOPILOT)) for kind in chosen)
    dut, ends = Codec(COMPANION, 1), [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    found = [said for begin, end in pairwise(ends) for said in dut.parse(data[begin:end])]
    assert kinds(found) == kinds(Codec(COMPANION, 1).parse(data))
    assert len(found) == len(chosen) + chosen.count("local_position")


@settings(max_examples=100, deadline=None)
@given(noise=st.binary(max_size=300))
def test_bytes_that_are_no_messages_do_no_lasting_harm(noise):
    dut, good = Codec(COMPANION, 1), sent("heartbeat", Codec(AUTOPILOT))
    dut.parse(noise)
    for _ in range(1 + 2 * LONGEST // len(good)):
        dut.parse(good)
    assert dut.parse(good) == [Heartbeat(True, PX4, simulated=True)]


@pytest.mark.parametrize("kind", ["heartbeat", "odometry", "inertial", "command"])
def test_a_truncated_message_is_not_read_and_does_no_lasting_harm(kind):
    whole, good = sent(kind, Codec(AUTOPILOT)), sent("heartbeat", Codec(AUTOPILOT))
    for length in range(len(whole)):
        dut = Codec(COMPANION, 1)
        assert dut.parse(whole[:length]) == []
        for _ in range(1 + LONGEST // len(good)):
            dut.parse(good)
        assert dut.parse(good) == [Heartbeat(True, PX4, simulated=True)]


@pytest.mark.parametrize("kind", ["heartbeat", "odometry", "inertial", "command"])
def test_a_message_with_one_wrong_bit_is_not_read(kind):
    whole = sent(kind, Codec(AUTOPILOT))
    for bit in range(8 * len(whole)):
        wrong = bytearray(whole)
        wrong[bit // 8] ^= 1 << bit % 8
        assert Codec(COMPANION, 1).parse(bytes(wrong)) == []


def test_without_pymavlink_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymavlink.dialects.v20", None)
    with pytest.raises(ValueError, match=r"pip install 'np_drake\[node\]'"):
        Codec(COMPANION)


def test_a_companion_listens_to_the_autopilot_that_it_hears_first_alone():
    first, other = Codec(AUTOPILOT), Codec(AUTOPILOT)
    first._out.srcSystem, other._out.srcSystem = 7, 8
    dut, x = Codec(COMPANION), np.array([0.0, 0.0, 1.0, 1.0, *np.zeros(9)])
    assert dut.parse(first.odometry(1.0, x)) == []
    assert dut.parse(first.heartbeat(engaged=True, autopilot=PX4)) == [
        Heartbeat(True, PX4, simulated=True)
    ]
    assert dut.parse(other.heartbeat(engaged=False, autopilot=PX4) + other.odometry(1.0, x)) == []
    assert [type(said).__name__ for said in dut.parse(first.odometry(2.0, x))] == ["Pose"]
    assert raw(dut.command(0.0, np.zeros(3), 0.5)).target_system == 7


@pytest.mark.parametrize("component", [100, 154, 191])
def test_a_companion_does_not_listen_to_other_components(component):
    gimbal = Codec(AUTOPILOT)
    gimbal._out.srcComponent = component
    assert Codec(COMPANION, 1).parse(gimbal.heartbeat(engaged=True, autopilot=PX4)) == []


def test_messages_are_counted():
    dut = Codec(COMPANION)
    counted = [raw(dut.heartbeat()).get_seq() for _ in range(300)]
    assert [(b - a) % 256 for a, b in pairwise(counted)] == [1] * 299


@pytest.mark.parametrize("frame", [7, 8, 9, 20])
def test_a_velocity_in_axes_that_are_not_known_is_not_taken(frame):
    message = common.MAVLink_odometry_message(
        1,
        1,
        frame,
        0.0,
        0.0,
        0.0,
        [1.0, 0.0, 0.0, 0.0],
        1.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        [0.0] * 21,
        [0.0] * 21,
    )
    assert Codec(COMPANION, 1).parse(packed(message)) == []
