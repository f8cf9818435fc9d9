"""Laws of `np-drake node`, and of `fly --link`."""

import socket

import numpy as np
import pytest
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RollPitchYaw

from diagrams.cli.main import run
from tests.diagrams.offboard.rail import Rail, hover


@pytest.fixture
def taken():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        yield f"udp:127.0.0.1:{one.getsockname()[1]}"


def refused(arguments, capsys, code=2):
    assert run(arguments) == code
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    return lines[0]


def test_a_link_that_is_taken_is_said_in_one_line(taken, capsys):
    assert taken in refused(["node", "hover", "--controller", "hold", "--link", taken], capsys)


def test_an_address_that_is_none_is_said_in_one_line(capsys):
    assert "udp:127.0.0.1:14540" in refused(
        ["node", "hover", "--controller", "hold", "--link", "udp:here"], capsys
    )


@pytest.mark.parametrize("address", ["udpout:127.0.0.1:99999", "pyproject.toml", "tcp:1", "serial"])
def test_what_is_no_link_is_refused(address, capsys):
    assert address in refused(["node", "hover", "--controller", "hold", "--link", address], capsys)


def test_a_vehicle_that_is_silent_ends_the_wait_with_a_failure(capsys):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        port = one.getsockname()[1]
    arguments = [
        "node",
        "hover",
        "--controller",
        "hold",
        "--link",
        f"udp:127.0.0.1:{port}",
        "--wait",
        "1",
    ]
    assert "no heartbeat" in refused(arguments, capsys, code=1)


def test_a_controller_of_ones_own_is_refused(capsys):
    assert "--controller" in refused(["node", "hover", "--controller", "mine:Mine"], capsys)


def test_a_rate_that_no_autopilot_takes_is_refused(capsys):
    assert "offboard: rate" in refused(
        ["node", "hover", "--controller", "hold", "--rate", "20"], capsys
    )


def test_a_vehicle_behind_a_link_takes_no_controller(capsys):
    arguments = ["fly", "hover", "--link", "udpout:127.0.0.1:9", "--controller", "hold"]
    assert "--link" in refused(arguments, capsys)


def test_a_vehicle_that_nobody_commands_holds_its_place(tmp_path, capsys):
    scenario = tmp_path / "mine.yaml"
    scenario.write_text("name: mine\nduration: 1.0\nreference: {track: hover, ramp: 0.2}\n")
    out = tmp_path / "out"
    assert run(["fly", str(scenario), "--link", "udpout:127.0.0.1:9", "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    assert "never" in shown
    assert "simulated time over real time" in shown
    assert {path.name for path in out.iterdir()} == {"mine_mavlink.csv", "mine_mavlink_replay.html"}


def test_what_a_node_waits_for_is_said_at_once_in_lines_of_80_columns(capsys):
    from diagrams.cli.node import _Told

    rail = Rail(hover())
    with _Told() as dut:
        rail.node.tick(0.0)
        dut.show(rail.node)
        rail.autopilot.codec.odometry = lambda *_: b""
        rail.advance(0.02)
        for rate in (1.0, 0.31, 0.3):
            rail.node.clock.rate, rail.node.clock.waits = rate, True
            dut.show(rail.node)
        del rail.autopilot.codec.odometry
        rail.advance(2.0)
        dut.show(rail.node)
    shown = capsys.readouterr().out
    assert max(map(len, shown.splitlines())) <= 80
    assert [" ".join(line.split()) for line in shown.splitlines()] == [
        "waiting: no heartbeat of an autopilot",
        "waiting: no ODOMETRY, nor LOCAL_POSITION_NED with ATTITUDE_QUATERNION",
        "the vehicle's clock runs at 0.31 of real time, and the flight by it",
        "0.34 s ready: all is in order",
        "ready: the pilot has not handed over",
    ]


def test_the_attitude_that_is_shown_is_that_of_a_pilot():
    from diagrams.cli.node import _pose

    x = np.zeros(13)
    x[2], x[3:7] = (
        1.5,
        Quaternion(RollPitchYaw(0.1, -0.2, np.pi / 2).ToRotationMatrix().matrix()).wxyz(),
    )
    assert _pose(x) == ": right down +6, nose up +11, left of east +90 deg, height 1.50 m"
    assert _pose(np.full(13, np.nan)) == ""
