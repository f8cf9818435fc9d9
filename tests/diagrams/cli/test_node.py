"""Laws of `np-drake node`, and of `fly --link`."""

import socket

import pytest

from diagrams.cli.main import run


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


@pytest.mark.parametrize("address", ["udpout:127.0.0.1:99999", "pyproject.toml", "tcp:1", "serial"])
def test_what_is_no_link_is_refused(address, capsys):
    assert address in refused(["node", "hover", "--controller", "hold", "--link", address], capsys)


def test_a_vehicle_that_is_silent_ends_the_wait_with_a_failure(capsys):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        port = one.getsockname()[1]
    arguments = f"node hover --controller hold --link udp:127.0.0.1:{port} --wait 1".split()
    assert "no heartbeat" in refused(arguments, capsys, code=1)


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
