"""Laws of Betaflight's firmware, without which most of these tests skip."""

import dataclasses as dc
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from np_drake.autopilot.betaflight import (
    PORTS,
    AutopilotError,
    Betaflight,
    BetaflightConfig,
    Firmware,
    Sensed,
    gain_lines,
)
from np_drake.vehicle import Vehicle, load_vehicle

HOVER = 19.62  # thrust of the paper's vehicle [N]
AT_REST = Sensed(
    np.zeros(3), np.array([0.0, 0.0, 9.81]), np.array([1.0, 0, 0, 0]), np.zeros(3), np.zeros(3)
)


needs_firmware = pytest.mark.usefixtures("firmware")


def is_alive(pid: int) -> bool:
    stat = Path(f"/proc/{pid}/stat")
    return stat.exists() and stat.read_text().split()[2] != "Z"


@needs_firmware
def test_its_time_is_granted_and_nothing_is_left_after_close():
    with closing(Firmware()) as dut, closing(Firmware()) as other:
        assert dut.offset != other.offset
        time.sleep(1.0)
        dut.advance(5.0)
        uptime = dut.ask("status").partition("System Uptime: ")[2].split()[0]
        assert abs(int(uptime) - dut.time) < 1.5
        assert other.time == 0.0
        assert is_alive(dut._process.pid)
    dut.close()
    assert not is_alive(dut._process.pid)
    assert not dut.folder.exists()
    for port in PORTS[:4]:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
            one.bind(("127.0.0.1", port + dut.offset))


@needs_firmware
def test_it_ends_with_a_user_that_is_killed():
    code = (
        "from np_drake.autopilot.betaflight import Firmware; f = Firmware(); "
        "print(f._process.pid, flush=True); input()"
    )
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", code], text=True, **pipes) as user:
        pid = int(user.stdout.readline())
        assert is_alive(pid)
        user.send_signal(signal.SIGKILL)
        user.wait()
    end = time.monotonic() + 5.0
    while is_alive(pid) and time.monotonic() < end:
        time.sleep(0.05)
    assert not is_alive(pid)


@needs_firmware
def test_what_ends_or_is_refused_is_said_in_one_line():
    with closing(Firmware()) as dut:
        os.kill(dut._process.pid, signal.SIGKILL)
        dut._process.wait()
        with pytest.raises(AutopilotError, match="the firmware has ended"):
            dut.advance(0.01)
    with pytest.raises(AutopilotError, match="refuses `set no_such_thing = 1`"):
        Betaflight(Vehicle(), BetaflightConfig(lines=["set no_such_thing = 1"]))
    tilted = dc.replace(AT_REST, q=np.array([np.cos(0.5), np.sin(0.5), 0.0, 0.0]))
    with closing(Betaflight(Vehicle())) as dut, pytest.raises(AutopilotError, match="does not arm"):
        dut.arm(tilted, HOVER)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        *(({"lines": [line]}, "lines must not hold") for line in ("set roll_srate = 10", "save")),
        ({"lines": ["aux 0 0 0 900 900 0 0"]}, "lines must not hold"),
        ({"stick_rate": 5.0}, "stick_rate must be"),
        ({"bandwidth": [20.0, 20.0]}, "bandwidth must be three values"),
    ],
)
def test_settings_that_are_impossible_are_refused(changes, named):
    with pytest.raises(ValueError, match=f"betaflight: {named}"):
        BetaflightConfig(**changes).check()


def test_gains_are_in_proportion_to_the_bandwidth_and_within_the_firmwares():
    def gains(scale: float) -> dict[str, int]:
        lines = gain_lines(Vehicle(), scale * np.array([10.0, 10.0, 2.0]))[1:]
        return {line.split()[1]: int(line.split()[3]) for line in lines}

    once, twice = gains(1.0), gains(2.0)
    for name, power in (("p_roll", 2), ("d_pitch", 2), ("i_roll", 4), ("p_yaw", 2), ("f_yaw", 1)):
        assert twice[name] == pytest.approx(power * once[name], abs=power)
    assert "d_yaw" not in once
    with pytest.raises(ValueError, match="bandwidth of yaw must be lower"):
        gain_lines(Vehicle(), [20.0, 20.0, 50.0])
    with pytest.raises(ValueError, match=r"vehicle 'hummingbird': its rotors .* must be where"):
        Betaflight(load_vehicle("hummingbird"))


@needs_firmware
@pytest.mark.parametrize("lines", [[], ["set motor_idle = 1000"]])
def test_at_hover_every_motor_gives_a_quarter_each_time(lines):
    runs = []
    for _ in range(2):
        with closing(Betaflight(Vehicle(), BetaflightConfig(lines=lines))) as dut:
            thrust = dut.rotor_thrust(dut.arm(AT_REST, HOVER))
            np.testing.assert_allclose(thrust, HOVER / 4, rtol=0.01)
            runs.append([dut.step(AT_REST, np.array([HOVER, 0.2, 0.0, 0.0])) for _ in range(100)])
    np.testing.assert_allclose(*runs, atol=2e-3)


@needs_firmware
@pytest.mark.parametrize("name", ["crazyflie", "neurobem", "x500"])
def test_any_order_and_sense_of_an_x_turns_as_it_is_told(name):
    vehicle = load_vehicle(name)
    hover, command = vehicle.mass * 9.81, np.zeros(4)
    command[0] = hover
    with closing(Betaflight(vehicle, BetaflightConfig(bandwidth=[]))) as dut:
        before = vehicle.mixer @ dut.rotor_thrust(dut.arm(AT_REST, hover))
        for axis in range(3):
            command[1:] = 0.5 * np.eye(3)[axis]
            for _ in range(40):
                motors = dut.step(AT_REST, command)
            torque = (vehicle.mixer @ dut.rotor_thrust(motors) - before)[1:]
            assert torque[axis] == max(torque)
            assert torque[axis] > 0
            command[1:] = 0.0
            for _ in range(400):
                before = vehicle.mixer @ dut.rotor_thrust(dut.step(AT_REST, command))
