"""Laws of links: bytes come in the order of arrival, and an address that cannot be used is said in
one line.
"""

import socket
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake.offboard.link import Channel, MavlinkLink

ARRIVALS = st.lists(
    st.tuples(st.floats(0.0, 5.0), st.one_of(st.floats(0.0, 5.0), st.just(float("inf")))),
    max_size=20,
)  # time at which a message is sent, and what it takes [s]


class Time:
    """Time that a test sets."""

    def __init__(self) -> None:
        self.now, self.takes = 0.0, 0.0

    def ends(self) -> tuple[Channel, Channel]:
        return Channel.pair(lambda: self.now, lambda now: now + self.takes)


@given(arrivals=ARRIVALS)
def test_a_channel_delivers_in_order_of_arrival_what_arrives_at_all(arrivals):
    at = Time()
    near, far = at.ends()
    for k, (at.now, at.takes) in enumerate(sorted(arrivals)):
        near.send(bytes([k]))
    at.now = 100.0
    due = [
        (sent + takes, bytes([k]))
        for k, (sent, takes) in enumerate(sorted(arrivals))
        if takes < float("inf")
    ]
    assert far.receive() == [data for _, data in sorted(due)]
    assert far.receive() == []


def test_a_channel_delivers_at_the_time_of_arrival_and_not_before():
    at = Time()
    near, far = at.ends()
    at.takes = 0.5
    near.send(b"one")
    at.now = 0.49
    assert far.receive() == []
    at.now = 0.5
    assert far.receive() == [b"one"]


def test_a_channel_goes_both_ways_and_hears_not_itself():
    at = Time()
    near, far = at.ends()
    near.send(b"there")
    far.send(b"back")
    assert near.receive() == [b"back"]
    assert far.receive() == [b"there"]


def test_what_is_under_way_to_an_end_that_closes_is_lost():
    at = Time()
    near, far = at.ends()
    near.send(b"one")
    far.close()
    assert far.receive() == []


@pytest.fixture
def port() -> int:
    """A UDP port that is free."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture
def opened():
    """Open links by their addresses; they are closed in the end."""
    pytest.importorskip("pymavlink", reason="links need pymavlink")
    links = []

    def one(address: str) -> MavlinkLink:
        links.append(MavlinkLink(address))
        return links[-1]

    yield one
    for link in links:
        link.close()


def heard(link: MavlinkLink, wait: float = 2.0) -> bytes:
    """The bytes that come within a time [s]."""
    end = time.monotonic() + wait
    while time.monotonic() < end:
        if found := link.receive():
            return b"".join(found)
        time.sleep(0.001)
    return b""


@pytest.mark.parametrize("kind", ["udp", "udpin"])
def test_two_links_exchange_datagrams(opened, port, kind):
    listens, calls = opened(f"{kind}:127.0.0.1:{port}"), opened(f"udpout:127.0.0.1:{port}")
    for data in (b"hello", bytes(range(256)) * 4):
        calls.send(data)
        assert heard(listens) == data
        listens.send(data[::-1])
        assert heard(calls) == data[::-1]


def test_datagrams_stay_apart_and_in_order(opened, port):
    listens, calls = opened(f"udp:127.0.0.1:{port}"), opened(f"udpout:127.0.0.1:{port}")
    for k in range(20):
        calls.send(bytes([k]))
    time.sleep(0.05)
    assert listens.receive() == [bytes([k]) for k in range(20)]
    assert listens.receive() == []


def test_a_link_without_its_other_end_waits_for_nothing_and_raises_nothing(opened, port):
    begin = time.monotonic()
    calls = opened(f"udpout:127.0.0.1:{port}")
    for _ in range(20):
        calls.send(b"hello")
        assert calls.receive() == []
    listens = opened(f"udp:127.0.0.1:{port}")
    listens.send(b"to nobody")
    assert time.monotonic() - begin < 0.5


def test_a_link_is_heard_again_once_its_other_end_has_come_back(opened, port):
    calls = opened(f"udpout:127.0.0.1:{port}")
    MavlinkLink(f"udp:127.0.0.1:{port}").close()
    calls.send(b"lost")
    calls.receive()
    again = opened(f"udp:127.0.0.1:{port}")
    calls.send(b"hello")
    assert heard(again) == b"hello"


def test_a_port_that_another_listens_on_is_refused_by_its_address(opened, port):
    opened(f"udp:127.0.0.1:{port}")
    with pytest.raises(
        ValueError, match=f"--link: udpin:127.0.0.1:{port} cannot be opened"
    ) as found:
        opened(f"udpin:127.0.0.1:{port}")
    assert "\n" not in str(found.value)


def test_a_port_is_free_again_after_close(opened, port):
    MavlinkLink(f"udp:127.0.0.1:{port}").close()
    opened(f"udp:127.0.0.1:{port}")


@pytest.mark.parametrize(
    "address",
    [
        "udp:14540",
        "udp::14540",
        "udp:127.0.0.1:",
        "udp:127.0.0.1:port",
        "udp:127.0.0.1:99999",
        "udpin:127.0.0.1:-1",
        "udp:no.such.host.invalid:14540",
        "tcp:127.0.0.1:1",
        "/dev/no_such_device",
        "nonsense",
        "",
    ],
)
def test_an_address_that_cannot_be_used_is_refused_in_one_line(opened, address):
    with pytest.raises(ValueError, match="--link: ") as found:
        opened(address)
    assert address in str(found.value)
    assert "\n" not in str(found.value)
