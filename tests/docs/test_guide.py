"""The pages of docs/guide run from top to bottom, each in one empty folder.

Of fenced blocks, `bash` holds commands of `np-drake`, which run in this process; `python` runs in a
namespace of its own; `yaml` is saved where its first line is `# NAME.yaml`; `console` is not run.
"""

import json
import re
import shlex
import shutil
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from diagrams.cli.app import PROGRAM
from diagrams.cli.main import run
from np_drake import attitude
from np_drake.effects.base import Effect
from np_drake.effects.library import LIBRARY
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.flight_log import FlightLog
from np_drake.logs.formats.format import Stream
from np_drake.vehicle import Vehicle, load_vehicle
from np_drake.vehicle.estimate import Measured, estimate
from tests.np_drake.diagnosis.simulated_flights import fly
from tests.np_drake.logs.formats.made_files import writer

GUIDE = Path(__file__).parents[2] / "docs" / "guide"
SLOW = ("autopilot.md", "clusters.md", "corrected-simulator.md")  # by night
PAGES = [
    pytest.param(page, id=page.name, marks=[pytest.mark.nightly] if page.name in SLOW else [])
    for page in sorted(GUIDE.glob("*.md"))
]
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.S | re.M)
TOLD = {  # page: folder of a report, parameter of a cause, its true value and what it may be off by
    "diagnose.md": [("report", "scale", 0.92, 0.02), ("report", "d_x", 0.3, 0.05)],
    "log-to-simulator.md": [
        ("px4_report", "d_x", 0.3, 0.05),
        ("bf_report", "efficiency", 0.7 / 0.925, 0.05),  # of the mean rotor, which lifts the weight
        ("crazyflie_report", "d_x", 0.006, 0.001),
    ],
    "corrected-simulator.md": [("report", "d_x", 0.006, 0.001)],
}
FEWEST, MOST = 200, 720  # words of a page, code included: five minutes
HOVER = 0.41  # throttle
TO_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
Q_NED = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])
Q_FRD = np.array([0.0, 1.0, 0.0, 0.0])
FRD = np.array([1.0, -1.0, -1.0])
FIVE_INCH = estimate(Measured(0.6, 0.22, 0.127, 0.3, "quadratic", "betaflight"), "five_inch")
CRAZYFLIE = load_vehicle("crazyflie_brushless").with_mass(0.0397)


def run_block(language: str, block: str, page: Path) -> None:
    if language == "bash":
        for line in block.replace("\\\n", " ").splitlines():
            program, *words = shlex.split(line, comments=True)
            assert program == PROGRAM, f"{page.name}: only {PROGRAM} runs; got {line!r}"
            assert run(words) == 0, f"{page.name}: {line}"
    elif language == "python":
        exec(compile(block, str(page), "exec"), {"__name__": "example"})
    elif language == "yaml":
        if named := re.match(r"# ([\w-]+\.yaml)\n", block):
            Path(named[1]).write_text(block)
    else:
        assert language == "console", f"{page.name}: a block is bash, python, yaml or console"


def run_page(page: Path, section: str = "") -> None:
    """Run every block of the page, or of one section, in the current folder."""
    text = page.read_text()
    if section:
        text = text.split(f"## {section}\n")[1].split("\n## ")[0]
    with mock.patch.dict(LIBRARY):  # an example may register an effect of its own
        for language, block in BLOCK.findall(text):
            run_block(language, block, page)


def diagnosed(folder: str) -> dict:
    """Return the diagnosis in a folder, with the values of its causes' parameters by name."""
    found = json.loads(Path(folder, "diagnosis.json").read_text())
    parameters = [cause["parameters"] for cause in found["causes"]]
    return found | {"values": {name: p["value"] for of in parameters for name, p in of.items()}}


@pytest.mark.parametrize("page", PAGES)
def test_the_page_runs_from_top_to_bottom(page, tmp_path, monkeypatch, capsys):
    assert FEWEST <= len(page.read_text().split()) <= MOST
    assert f"(guide/{page.name})" in (GUIDE.parent / "index.md").read_text()
    monkeypatch.chdir(tmp_path)
    if card := CARDS.get(page.name):
        fill(tmp_path, card)
    run_page(page)
    for folder, name, true, tolerance in TOLD.get(page.name, []):
        assert abs(diagnosed(folder)["values"][name] - true) < tolerance
    if page.name == "identify.md":  # the interval is 1.5 % wide
        assert abs(load_vehicle("found/vehicle.yaml").thrust_coefficient / 9.2e-6 - 1) < 0.02


@pytest.mark.nightly
def test_the_page_on_memory_cards_runs_on_real_ones(real_flights, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for number, name in enumerate(("eckart06", "eckart07", "eckart08"), 1):
        shutil.copy(real_flights / "imrc" / "payload" / name, tmp_path / f"card0{number}")
    run_page(GUIDE / "log-to-simulator.md", "Crazyflie")
    assert "suspended_payload" in diagnosed("crazyflie_report")["verdict"]


# Memory cards: simulated flights as PX4 and Crazyflie logs, in the conventions of those formats.


def flown(seed: int, vehicle: Vehicle, effect: Effect) -> FlightLog:
    """Return a flight under an effect, with noise."""
    return fly(effect, seed=seed, seconds=9.0, noise=1.0, vehicle=vehicle)


def columns(names: str, values: np.ndarray) -> dict[str, np.ndarray]:
    """Return columns (n,) by name."""
    return dict(zip(names.split(), np.reshape(values, (len(values), -1)).T, strict=True))


def specific_force(log: FlightLog) -> np.ndarray:
    """Return what an accelerometer reads, (n, 3) in B [m/s²]."""
    assert log.a is not None
    return attitude.rotate_back(log.q, log.a + [0.0, 0.0, 9.81])


def write_px4(path: Path, seed: int) -> None:
    """Write a PX4 log: NED and FRD, normalised collective thrust, no torque."""
    log, vehicle = flown(seed, Vehicle(), LinearDrag(0.3, 0.3, 0.3)), Vehicle()
    ones = np.ones((len(log), 1))
    q = attitude.multiply(attitude.multiply(ones * Q_NED, log.q), ones * Q_FRD)
    throttle = HOVER * np.maximum(log.u[:, 0] / (vehicle.mass * vehicle.gravity), 0.0) ** (1 / 1.5)
    setpoint = np.column_stack([0 * throttle, 0 * throttle, -throttle])
    p, v = log.p @ TO_NED.T, log.v @ TO_NED.T
    streams = {
        "vehicle_local_position": columns("x y z vx vy vz", np.hstack([p, v])),
        "vehicle_attitude": columns("q[0] q[1] q[2] q[3]", q),
        "vehicle_angular_velocity": columns("xyz[0] xyz[1] xyz[2]", log.w * FRD),
        "sensor_combined": columns(
            " ".join(f"accelerometer_m_s2[{i}]" for i in range(3)), specific_force(log) * FRD
        ),
        "vehicle_thrust_setpoint": columns("xyz[0] xyz[1] xyz[2]", setpoint),
    }
    writer("ulog").write(
        path, {name: Stream(10.0 + log.t, content) for name, content in streams.items()}
    )


def write_crazyflie(path: Path, seed: int) -> None:
    """Write a Crazyflie micro-SD log: degrees, g, rotor speed in rpm, one event."""
    log = flown(seed, CRAZYFLIE, LinearDrag(0.006, 0.006, 0.006))
    speed = np.sqrt(np.maximum(log.u @ CRAZYFLIE.unmixer.T, 0.0) / CRAZYFLIE.thrust_coefficient)
    content = columns(
        " ".join(f"stateEstimate.{name}" for name in ("x", "y", "z", "vx", "vy", "vz")),
        np.hstack([log.p, log.v]),
    )
    content |= columns("stateEstimate.qw stateEstimate.qx stateEstimate.qy stateEstimate.qz", log.q)
    content |= columns("gyro.x gyro.y gyro.z", np.degrees(log.w))
    content |= columns("acc.x acc.y acc.z", specific_force(log) / 9.80665)
    content |= columns("rpm.m1 rpm.m2 rpm.m3 rpm.m4", speed * 60 / (2 * np.pi))
    writer("crazyflie").write(path, {"fixedFrequency": Stream(3.0 + log.t, content)})


def write_betaflight(path: Path, seed: int) -> None:
    """Write a Betaflight log of a vehicle with a weak rotor: no position, electrical rpm of motors
    with 14 poles.
    """
    log, vehicle = flown(seed, FIVE_INCH, WeakRotor(2, 0.7)), FIVE_INCH
    speed = np.sqrt(np.maximum(log.u @ vehicle.unmixer.T, 0.0) / vehicle.thrust_coefficient)
    throttle = speed * np.sqrt(vehicle.thrust_coefficient / vehicle.max_rotor_thrust)
    q = log.q * np.where(log.q[:, :1] < 0, -1, 1)
    parts = {
        "gyroADC": 10 * np.degrees(log.w),
        "accSmooth": 2048 * specific_force(log) / 9.80665,
        "imuQuaternion": 32767 * q[:, 1:],
        "motor": 158 + (2047 - 158) * np.clip(throttle, 0.0, 1.0),
        "eRPM": 7 * speed * 60 / (2 * np.pi) / 100,
    }
    content = {f"{name}[{i}]": v for name, values in parts.items() for i, v in enumerate(values.T)}
    made, fine = writer("blackbox"), {"blackbox_high_resolution": "1"}
    made.write(path, made.main_log(content, step=10_000, settings=fine))


WRITERS = {"px4_{}.ulg": write_px4, "bf_{}.bbl": write_betaflight, "card0{}": write_crazyflie}
CARDS = {  # page: names of what it reads from memory cards
    "import.md": ["px4_{}.ulg"],
    "corrected-simulator.md": ["card0{}"],
    "log-to-simulator.md": list(WRITERS),
}


def fill(folder: Path, names: list[str]) -> None:
    """Write what a page of the guide reads from memory cards."""
    for name in names:
        for number in (1, 2, 3):
            WRITERS[name](folder / name.format(number), number)
