"""Laws of messages and links: what is packed is read, and what is no message does no harm."""

import socket
import time
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from np_drake import attitude
from np_drake.autopilot.mavlink import (
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
    MavlinkLink,
    Pose,
    turned_attitude,
)
from np_drake.logs.importing.log_map import FRD_TO_FLU, NED_TO_ENU
from np_drake.rigid_body import P, Q, V, W
from tests.np_drake.autopilot.channel import local_position, states

common = pytest.importorskip("pymavlink.dialects.v20.common", reason="messages need pymavlink")

SINGLE = 2e-6  # of a 32-bit float over its value, with the turns between axes [1]
LONGEST = 280  # of a message of MAVLink 2 [bytes]
VECTORS = arrays(float, 3, elements=st.floats(-50, 50))
TURNS = arrays(float, 3, elements=st.floats(-3, 3))
STATES, STAMPS = states(st, arrays), st.floats(0.0, 1e6)
BEAT = Heartbeat(True, PX4, simulated=True)
KINDS = ["heartbeat", "odometry", "inertial", "command"]


def parsed(message) -> list:
    """What a message of pymavlink, or bytes, say to a companion."""
    if not isinstance(message, bytes):
        message = bytes(message.pack(common.MAVLink(None, srcSystem=1, srcComponent=1)))
    return Codec(COMPANION, 1).parse(message)


def raw(data: bytes):
    """The message as pymavlink reads it."""
    (message,) = common.MAVLink(None).parse_buffer(data)
    return message


def odometry(q=(1, 0, 0, 0), *, frames=(1, 12), v=(0, 0, 0), w=(0, 0, 0)) -> list:
    """What an ODOMETRY at north 1, east 2, down 3 says."""
    rest = ([0.0] * 21, [0.0] * 21)
    return parsed(common.MAVLink_odometry_message(0, *frames, 1.0, 2.0, 3.0, q, *v, *w, *rest))


def sent(kind: str) -> bytes:
    codec = Codec(AUTOPILOT)
    return {
        "heartbeat": codec.heartbeat(True),
        "odometry": codec.odometry(1.0, np.eye(13)[3]),
        "inertial": codec.inertial(1.0, np.ones(3), np.ones(3)),
        "command": codec.command(1.0, np.ones(3), 0.5),
    }[kind]


@given(q=TURNS.map(attitude.from_rotation_vector), r=VECTORS)
def test_body_world_and_attitude_turn_together_and_back(q, r):
    turned = attitude.rotate(turned_attitude(q), FRD_TO_FLU * r)
    np.testing.assert_allclose(turned, NED_TO_ENU @ attitude.rotate(q, r), atol=1e-9)
    R, twice = attitude.rotation_matrix(q), turned_attitude(turned_attitude(q))
    np.testing.assert_allclose(attitude.rotation_matrix(twice), R, atol=1e-12)


@given(x=STATES, stamp=STAMPS)
def test_a_state_goes_through_and_comes_back_in_one_message_or_two(x, stamp):
    (whole,) = parsed(Codec(AUTOPILOT).odometry(stamp, x))
    where, turned = parsed(local_position(Codec(AUTOPILOT), stamp, x))
    assert (where.kind, turned.kind) == ("LOCAL_POSITION_NED", "ATTITUDE_QUATERNION")
    assert where.stamp == turned.stamp == pytest.approx(whole.stamp, abs=1e-3)
    assert whole.stamp == pytest.approx(stamp, abs=1e-6)
    R = attitude.rotation_matrix(x[Q])
    for place, turn in ((whole, whole), (where, turned)):
        np.testing.assert_allclose(place.x[P], x[P], atol=50 * SINGLE)
        np.testing.assert_allclose(place.x[V], x[V], atol=50 * SINGLE)
        np.testing.assert_allclose(turn.x[W], x[W], atol=5 * SINGLE)
        np.testing.assert_allclose(attitude.rotation_matrix(turn.x[Q]), R, atol=SINGLE)
    assert np.isnan([*where.x[Q], *where.x[W], *turned.x[P], *turned.x[V]]).all()


@given(f=VECTORS, w=TURNS, stamp=STAMPS)
def test_specific_force_and_rates_go_through_and_come_back(f, w, stamp):
    (dut,) = parsed(Codec(AUTOPILOT).inertial(stamp, f, w))
    assert isinstance(dut, Inertial)
    assert dut.stamp == pytest.approx(stamp, abs=1e-6)
    assert raw(Codec(AUTOPILOT).inertial(stamp, f, w)).zacc == pytest.approx(-f[2], abs=1e-4)
    np.testing.assert_allclose(dut.f, f, atol=50 * SINGLE)
    np.testing.assert_allclose(dut.w, w, atol=5 * SINGLE)


@given(rates=TURNS, thrust=st.floats(0.0, 1.0))
@pytest.mark.parametrize(("sender", "receiver"), [(AUTOPILOT, COMPANION), (COMPANION, AUTOPILOT)])
def test_a_command_goes_through_and_comes_back(sender, receiver, rates, thrust):
    (dut,) = Codec(receiver, 1).parse(Codec(sender).command(7.25, rates, thrust))
    assert isinstance(dut, Command)
    np.testing.assert_allclose(dut.rates, rates, atol=5 * SINGLE)
    assert dut.thrust == pytest.approx(thrust, abs=SINGLE)


@pytest.mark.parametrize(
    ("axis", "w", "column", "expected"),
    [
        (0, [0.5, 0, 0], 2, [np.sin(0.3), 0, np.cos(0.3)]),  # to the right: thrust to the east
        (1, [0, -0.5, 0], 0, [0, np.cos(0.3), np.sin(0.3)]),  # the nose points up
        (2, [0, 0, -0.5], 0, [np.sin(0.3), np.cos(0.3), 0]),  # the nose to the east
    ],
)
def test_a_turn_is_seen_in_our_axes(axis, w, column, expected):
    q = np.array([np.cos(0.15), *np.sin(0.15) * np.eye(3)[axis]])
    (dut,) = odometry(q, v=(4, 0, 0), w=0.5 * np.eye(3)[axis])
    R = attitude.rotation_matrix(dut.x[Q])
    np.testing.assert_allclose(dut.x[P], [2.0, 1.0, -3.0])
    np.testing.assert_allclose(dut.x[W], w, atol=SINGLE)
    np.testing.assert_allclose(R[:, column], expected, atol=SINGLE)
    np.testing.assert_allclose(dut.x[V], 4 * R[:, 0], atol=5 * SINGLE)


def test_the_velocity_of_odometry_is_in_the_axes_that_it_names_or_not_read():
    q = [np.cos(np.pi / 4), 0.0, 0.0, np.sin(np.pi / 4)]  # facing east
    for frame, v in ((12, [3.0, 0.0, -1.0]), (1, [0.0, 3.0, -1.0])):
        (dut,) = odometry(q, v=(3, 0, 1), frames=(1, frame))
        np.testing.assert_allclose(dut.x[V], v, atol=5 * SINGLE)
    for frames in ((21, 12), (1, 7), (1, 8), (1, 9), (1, 20)):
        assert odometry(frames=frames) == []


def test_a_command_is_of_body_rates_and_thrust_in_the_axes_of_mavlink():
    for sender, kind in ((COMPANION, "SET_ATTITUDE_TARGET"), (AUTOPILOT, "ATTITUDE_TARGET")):
        dut = raw(Codec(sender).command(2.5, np.array([0.1, 0.2, 0.3]), 0.7))
        assert (dut.get_type(), dut.time_boot_ms) == (kind, 2500)
        assert dut.type_mask == common.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
        found = [dut.body_roll_rate, dut.body_pitch_rate, dut.body_yaw_rate, dut.thrust]
        np.testing.assert_allclose(found, [0.1, -0.2, -0.3, 0.7], rtol=SINGLE)


@pytest.mark.parametrize("value", [np.nan, -np.inf])
@pytest.mark.parametrize("entry", range(4))
def test_a_command_that_is_not_finite_is_refused(entry, value):
    command = np.array([0.1, 0.2, 0.3, 0.5])
    command[entry] = value
    with pytest.raises(ValueError, match="body rates and thrust must be finite"):
        Codec(COMPANION).command(0.0, command[:3], command[3])


@pytest.mark.parametrize(
    ("autopilot", "mode", "base", "engaged"),
    [
        (PX4, 6 << 16, 129, True),  # offboard
        (PX4, 6 << 16, 1, False),  # and not armed
        (PX4, 4 << 16 | 3 << 24, 129, False),  # hold
        (PX4, 4, 129, False),  # GUIDED of the other kind
        (ARDUPILOT, 4, 129, True),  # GUIDED
        (ARDUPILOT, 20, 129, True),  # GUIDED_NOGPS
        (ARDUPILOT, 4, 1, False),
        (ARDUPILOT, 5, 129, False),  # LOITER
        (ARDUPILOT, 6 << 16, 129, False),  # offboard of the other kind
        (0, 0, 128 | 8, True),  # another kind, guided
        (0, 0, 128, False),
        (0, 0, 8, False),
    ],
)
def test_the_mode_tells_whether_an_autopilot_follows_and_is_simulated(
    autopilot, mode, base, engaged
):
    for simulated in (False, True):
        flags = base | 32 * simulated
        message = common.MAVLink_heartbeat_message(2, autopilot, flags, mode, 4, 3)
        assert parsed(message) == [Heartbeat(engaged, autopilot, simulated)]


@pytest.mark.parametrize(("millivolts", "said"), [(15500, [Battery(15.5)]), (0, []), (65535, [])])
def test_the_voltage_is_read_where_it_is_known(millivolts, said):
    rest = (-1, -1, 0, 0, 0, 0, 0, 0)
    assert parsed(common.MAVLink_sys_status_message(0, 0, 0, 0, millivolts, *rest)) == said


@pytest.mark.parametrize(("autopilot", "mode"), [(PX4, (4, 3)), (ARDUPILOT, (5, 0))])
def test_requests_name_message_and_interval_or_the_mode_of_the_autopilot(autopilot, mode):
    dut = raw(Codec(COMPANION).request("ODOMETRY", 50.0))
    set_interval = common.MAV_CMD_SET_MESSAGE_INTERVAL
    assert (dut.command, dut.param1, dut.param2) == (set_interval, 331.0, 20000.0)
    assert (dut.target_system, dut.target_component) == (1, 1)
    data = Codec(COMPANION).hold(autopilot)
    dut, set_mode = raw(data), common.MAV_CMD_DO_SET_MODE
    assert (dut.command, dut.param1, dut.param2, dut.param3) == (set_mode, 1.0, *mode)
    assert Codec(AUTOPILOT).parse(data) == [HoldPlace()]


@settings(max_examples=50, deadline=None)
@given(noise=st.binary(max_size=300), kind=st.sampled_from(KINDS), share=st.floats(0.0, 0.99))
def test_what_is_no_message_is_not_read_and_does_no_lasting_harm(noise, kind, share):
    whole, good = sent(kind), sent("heartbeat")
    for bad in (noise, whole[: int(share * len(whole))]):
        dut = Codec(COMPANION, 1)
        assert bad is noise or dut.parse(bad) == []
        dut.parse(bad + good * (1 + 2 * LONGEST // len(good)))
        assert dut.parse(good) == [BEAT]
    wrong, bit = bytearray(whole), int(share * 8 * len(whole))
    wrong[bit // 8] ^= 1 << bit % 8
    assert parsed(bytes(wrong)) == []


def test_a_companion_listens_to_the_autopilot_that_it_hears_first_alone():
    first, other, gimbal = Codec(AUTOPILOT), Codec(AUTOPILOT), Codec(AUTOPILOT)
    first._out.srcSystem, other._out.srcSystem, gimbal._out.srcComponent = 7, 8, 154
    dut, x = Codec(COMPANION), np.array([0.0, 0.0, 1.0, 1.0, *np.zeros(9)])
    assert dut.parse(first.odometry(1.0, x) + gimbal.heartbeat(True)) == []
    assert dut.parse(first.heartbeat(True)) == [BEAT]
    assert dut.parse(other.heartbeat() + other.odometry(1.0, x)) == []
    assert [type(said) for said in dut.parse(first.odometry(2.0, x))] == [Pose]
    assert raw(dut.command(0.0, np.zeros(3), 0.5)).target_system == 7
    counted = [raw(dut.heartbeat()).get_seq() for _ in range(300)]
    assert [(b - a) % 256 for a, b in pairwise(counted)] == [1] * 299


# Links


@pytest.fixture
def port() -> int:
    """A UDP port that is free."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture
def opened():
    """Open links by their addresses; they are closed in the end."""
    links = []

    def one(address: str) -> MavlinkLink:
        links.append(MavlinkLink(address))
        return links[-1]

    yield one
    for link in links:
        link.close()


def heard(link: MavlinkLink, wait: float = 2.0) -> list[bytes]:
    """The datagrams that come within a time [s]."""
    end = time.monotonic() + wait
    while time.monotonic() < end:
        if found := link.receive():
            return found
        time.sleep(0.001)
    return []


def test_two_links_exchange_datagrams_apart_and_in_order(opened, port):
    listens, calls = opened(f"udp:127.0.0.1:{port}"), opened(f"udpout:127.0.0.1:{port}")
    for data in (b"hello", bytes(range(256)) * 4):
        calls.send(data)
        assert heard(listens) == [data]
        listens.send(data[::-1])
        assert heard(calls) == [data[::-1]]
    for k in range(20):
        calls.send(bytes([k]))
    time.sleep(0.05)
    assert listens.receive() == [bytes([k]) for k in range(20)]
    assert listens.receive() == []


@pytest.mark.parametrize(
    "address",
    [
        *("udp:14540", "udp:127.0.0.1:port", "udp:127.0.0.1:99999", "tcp:127.0.0.1:1"),
        *("udp:no.such.host.invalid:14540", "/dev/no_such_device", ""),
    ],
)
def test_an_address_that_cannot_be_used_is_refused_in_one_line(opened, address):
    with pytest.raises(ValueError, match="--link: ") as found:
        opened(address)
    assert address in str(found.value)
    assert "\n" not in str(found.value)
