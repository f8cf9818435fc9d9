"""Laws of the firmware as a process."""

import dataclasses as dc
import os
import signal
import socket
import subprocess
import sys
import time

import numpy as np
import pytest

from np_drake.autopilot.betaflight import Betaflight, BetaflightConfig
from np_drake.autopilot.command_line import CommandLine
from np_drake.autopilot.firmware import BINARY, PORTS, AutopilotError, Firmware, find_firmware
from np_drake.vehicle import Vehicle, load_vehicle
from np_drake.vehicle.vehicle import RateLoop

HOVER = 19.62  # thrust of the paper's vehicle [N]


def is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        try:
            one.bind(("127.0.0.1", port))
        except OSError:
            return False
        return True


def is_alive(pid: int) -> bool:
    try:
        with open(f"/proc/{pid}/stat") as stat:
            return stat.read().split()[2] != "Z"
    except FileNotFoundError:
        return False


def test_its_time_goes_on_only_as_far_as_it_is_granted():
    with Firmware() as dut:
        time.sleep(1.0)
        dut.advance(5.0)
        with CommandLine(dut) as line:
            uptime = line.ask("status").partition("System Uptime: ")[2].split()[0]
        assert abs(int(uptime) - dut.time) < 1.5


def test_after_close_no_process_port_or_folder_is_left():
    dut = Firmware()
    pid, folder, offset = dut._process.pid, dut.folder, dut.offset
    assert is_alive(pid)
    dut.close()
    dut.close()
    assert not is_alive(pid)
    assert not folder.exists()
    assert all(is_free(port + offset) for port in PORTS if port > 9000)


def test_it_ends_with_a_user_that_is_killed():
    code = (
        "from np_drake.autopilot.firmware import Firmware; f = Firmware(); "
        "print(f._process.pid, flush=True); input()"
    )
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", code], text=True, **pipes) as user:
        pid = int(user.stdout.readline())
        assert is_alive(pid)
        user.send_signal(signal.SIGKILL)
        user.wait()
    for _ in range(100):
        if not is_alive(pid):
            break
        time.sleep(0.05)
    assert not is_alive(pid)


def test_two_run_side_by_side():
    with Firmware() as one, Firmware() as other:
        assert one.offset != other.offset
        one.advance(0.5)
        assert other.time == 0.0
        with CommandLine(other) as line:
            assert "SITL" in line.ask("version")


def test_a_firmware_that_has_ended_is_said_in_one_line():
    with Firmware() as dut:
        os.kill(dut._process.pid, signal.SIGKILL)
        dut._process.wait()
        with pytest.raises(AutopilotError, match="the firmware has ended"):
            dut.advance(0.01)


def test_a_binary_that_is_not_there_is_said(monkeypatch, tmp_path):
    monkeypatch.setenv(BINARY, str(tmp_path / "none"))
    with pytest.raises(AutopilotError, match=f"{BINARY} must name"):
        find_firmware()


def test_a_binary_that_does_not_run_is_said(monkeypatch, tmp_path):
    (tmp_path / "none").write_text("no program")
    monkeypatch.setenv(BINARY, str(tmp_path / "none"))
    with pytest.raises(AutopilotError, match="does not run"):
        Firmware()


def test_a_setting_that_the_firmware_refuses_is_said_with_its_reason():
    with pytest.raises(AutopilotError, match="refuses `set no_such_thing = 1`"):
        Betaflight(Vehicle(), BetaflightConfig(lines=["set no_such_thing = 1"]))


@pytest.mark.parametrize(
    "line", ["set min_check = 1100", "set roll_srate = 10", "save", "aux 0 0 0 900 900 0 0"]
)
def test_lines_that_would_turn_sticks_into_something_else_are_refused(line):
    with pytest.raises(ValueError, match="lines must not hold"):
        BetaflightConfig(lines=[line]).check()


def test_another_idle_speed_leaves_the_thrust_as_it_is(at_rest):
    with Betaflight(Vehicle(), BetaflightConfig(lines=["set motor_idle = 1000"])) as dut:
        np.testing.assert_allclose(dut.rotor_thrust(dut.arm(at_rest, HOVER)), HOVER / 4, rtol=0.01)


def test_a_bandwidth_beyond_the_firmwares_gains_is_refused():
    with pytest.raises(ValueError, match="bandwidth of yaw must be lower"):
        Betaflight(Vehicle(), BetaflightConfig(bandwidth=[20.0, 20.0, 50.0]))


def test_at_hover_every_motor_gives_a_quarter_of_the_thrust(at_rest):
    with Betaflight(Vehicle()) as dut:
        thrust = dut.rotor_thrust(dut.arm(at_rest, HOVER))
        np.testing.assert_allclose(thrust, HOVER / 4, rtol=0.01)


def test_a_vehicle_that_is_not_level_is_not_armed_for_that_reason(at_rest):
    tilted = dc.replace(at_rest, q=np.array([np.cos(0.5), np.sin(0.5), 0.0, 0.0]))
    with (
        Betaflight(Vehicle()) as dut,
        pytest.raises(AutopilotError, match=r"does not arm: .*not level"),
    ):
        dut.arm(tilted, HOVER)


@pytest.mark.parametrize(
    ("axis", "signs"), [(0, (1, -1, -1, 1)), (1, (-1, -1, 1, 1)), (2, (1, -1, 1, -1))]
)
def test_a_commanded_rate_turns_the_motors_that_give_its_torque(at_rest, axis, signs):
    command = np.array([HOVER, 0.0, 0.0, 0.0])
    with Betaflight(Vehicle()) as dut:
        hover = dut.arm(at_rest, HOVER)
        command[1 + axis] = 0.3
        for _ in range(60):
            motors = dut.step(at_rest, command)
        assert np.array_equal(np.sign(np.round(motors - hover, 3)), signs)


def test_the_same_inputs_give_the_same_outputs(at_rest):
    runs = []
    for _ in range(2):
        with Betaflight(dc.replace(Vehicle(), rate_loop=RateLoop())) as dut:
            dut.arm(at_rest, HOVER)
            runs.append([dut.step(at_rest, np.array([HOVER, 0.2, 0.0, 0.0])) for _ in range(100)])
    np.testing.assert_allclose(*runs, atol=2e-3)


@pytest.mark.parametrize("name", ["crazyflie", "neurobem", "x500"])
def test_any_order_and_sense_of_an_x_turns_as_it_is_told(at_rest, name):
    vehicle = load_vehicle(name)
    hover, command = vehicle.mass * 9.81, np.zeros(4)
    command[0] = hover
    with Betaflight(vehicle, BetaflightConfig(bandwidth=[])) as dut:
        before = vehicle.mixer @ dut.rotor_thrust(dut.arm(at_rest, hover))
        for axis in range(3):
            command[1:] = 0.5 * np.eye(3)[axis]
            for _ in range(40):
                motors = dut.step(at_rest, command)
            torque = (vehicle.mixer @ dut.rotor_thrust(motors) - before)[1:]
            assert torque[axis] == max(torque)
            assert torque[axis] > 0
            command[1:] = 0.0
            for _ in range(400):
                before = vehicle.mixer @ dut.rotor_thrust(dut.step(at_rest, command))


def test_a_plus_is_refused():
    with pytest.raises(
        ValueError, match=r"betaflight: vehicle 'hummingbird': its rotors .* must be where"
    ):
        Betaflight(load_vehicle("hummingbird"))
