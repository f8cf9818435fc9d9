"""Laws of `np-drake node`, and of `fly --link`."""

import json
import socket
import subprocess
import sys

import numpy as np
import pytest
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RollPitchYaw

from diagrams.cli.main import run
from tests.diagrams.autopilot.rail import Rail, hover

HOLD = ["node", "hover", "--controller", "hold"]


def udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def refused(arguments, capsys, code=2):
    assert run(arguments) == code
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    return lines[0]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ([*HOLD, "--link", "udp:here"], "udp:127.0.0.1:14540"),
        ([*HOLD, "--link", "pyproject.toml"], "pyproject.toml"),
        (["node", "hover", "--controller", "mine:Mine"], "controller: mine"),
        ([*HOLD, "--set", "offboard.rate=20"], "offboard: rate"),
        (["fly", "hover", "--link", "udpout:127.0.0.1:9", "--controller", "hold"], "--link"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(arguments, named, capsys):
    assert named in refused(arguments, capsys)


def test_a_link_that_is_taken_or_silent_is_said_in_one_line(capsys):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        taken = f"udp:127.0.0.1:{one.getsockname()[1]}"
        assert taken in refused([*HOLD, "--link", taken], capsys)
    arguments = [*HOLD, "--link", f"udp:127.0.0.1:{udp_port()}", "--wait", "1"]
    assert run(arguments) == 1
    shown = capsys.readouterr()
    assert "nothing was flown: no heartbeat of an autopilot" in shown.err
    assert "nan" not in shown.out


def test_a_node_flies_a_vehicle_of_another_process(tmp_path):
    (tmp_path / "short.yaml").write_text(
        "name: short\nduration: 0.5\nreference: {track: hover, ramp: 0.2}\n"
        "offboard: {stale_after: 1.0, level: 5.0, late_solves: 100, settle: 0.3}\n"
    )
    port = udp_port()
    vehicle = [sys.executable, "-m", "np_drake", "fly", "hover", "--duration", "30"]
    vehicle += ["--link", f"udpout:127.0.0.1:{port}"]
    arguments = ["node", str(tmp_path / "short.yaml"), "--controller", "hold", "--wait", "60"]
    arguments += ["--link", f"udp:127.0.0.1:{port}", "--out", str(tmp_path / "out")]
    with subprocess.Popen(vehicle, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as other:
        try:
            assert run([*arguments, "--json", str(tmp_path / "found.json")]) == 0
        finally:
            other.kill()
    found = json.loads((tmp_path / "found.json").read_text())
    assert found["flight"]["flown"] > 0.6
    assert found["deadlines"]["ticks"] > 100
    assert found["phases"][0][1] == "ready"
    assert (tmp_path / "out" / "short_hold.csv").exists()


def test_a_vehicle_that_nobody_commands_holds_its_place(tmp_path, capsys):
    scenario, out = tmp_path / "mine.yaml", tmp_path / "out"
    scenario.write_text("name: mine\nduration: 1.0\nreference: {track: hover, ramp: 0.2}\n")
    assert run(["fly", str(scenario), "--link", "udpout:127.0.0.1:9", "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    assert "never" in shown
    assert "simulated time over real time" in shown
    assert {path.name for path in out.iterdir()} == {"mine_mavlink.csv", "mine_mavlink_replay.html"}


def test_what_a_node_waits_for_is_said_at_once_in_lines_of_80_columns(capsys):
    from diagrams.cli.fly import _Messages

    rail = Rail(hover())
    with _Messages() as dut:
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
    from diagrams.cli.fly import _pose

    turned = RollPitchYaw(0.1, -0.2, np.pi / 2).ToRotationMatrix().matrix()
    x = np.array([0.0, 0.0, 1.5, *Quaternion(turned).wxyz(), *np.zeros(6)])
    assert _pose(x) == ": right down +6, nose up +11, left of east +90 deg, height 1.50 m"
    assert _pose(np.full(13, np.nan)) == ""
