"""Laws of `np-drake identify`."""

import dataclasses as dc
import json
import re

import numpy as np
import pytest

from diagrams.cli.main import run
from np_drake.files.yaml_file import load_checked
from np_drake.logs.formats.log_file import read, write_log
from np_drake.logs.formats.text_table import write_csv
from np_drake.logs.import_sheet import Sheet, write_sheet
from np_drake.vehicle import Vehicle, load_vehicle
from np_drake.vehicle.rotor_layout import FIRMWARE

NAME = "crazyflie_brushless"
TRUE = load_vehicle(NAME)
GUESS = ["--vehicle", NAME]
EACH = ("thrust", "tx", "ty", "tz", *(f"rotor{i}" for i in range(1, 5)))


@pytest.fixture(scope="module")
def folder(tmp_path_factory, excited_flight):
    """Logs of one vehicle: two ordinary flights, one that hovers, a short one, a desk."""
    here = tmp_path_factory.mktemp("flights")
    ordinary, other = (excited_flight(TRUE, seed, seconds=8.0) for seed in (0, 1))
    still = excited_flight(TRUE, 2, size=0.0)
    desk = dc.replace(still, rotor=0 * still.rotor, w=0 * still.w)
    logs = {"a": ordinary, "b": other, "hover": still, "desk": desk}
    logs["short"] = excited_flight(TRUE, 3, seconds=2.0)
    for name, log in logs.items():
        write_log(log, here / f"{name}.csv")
    columns = {name: c for name, c in other.columns().items() if not name.startswith("rotor")}
    throttle = {f"throttle{i}": c / 3000 for i, c in enumerate(other.rotor.T, start=1)}  # [rad/s]
    write_csv(here / "throttle.csv", columns | throttle)
    return here


@pytest.fixture(scope="module")
def result(folder):
    """Return the folder of `--out` of two flights."""
    out = folder / "out"
    logs = [str(folder / f"{name}.csv") for name in "ab"]
    assert run(["identify", *logs, *GUESS, "--out", str(out)]) == 0
    return out


def refusal(capsys, *arguments) -> str:
    """Return the one line with which a run is refused."""
    assert run(["identify", *map(str, arguments)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


def test_the_vehicle_file_holds_the_true_vehicle(result):
    found = load_checked(Vehicle, result / "vehicle.yaml", "vehicle")
    assert found.mass == TRUE.mass
    assert found.thrust_coefficient == pytest.approx(TRUE.thrust_coefficient, rel=0.01)
    np.testing.assert_allclose(
        np.diag(found.J), np.diag(TRUE.J), rtol=0.05
    )  # the bound of inertia
    assert found.sources["inertia"].startswith("identified from 1 flight")
    (low, high) = found.intervals["thrust_coefficient"][0]
    assert low < found.thrust_coefficient < high


def test_the_json_holds_every_quantity_and_the_held_out_errors(result):
    values = json.loads((result / "identification.json").read_text())
    assert values["schema"] == "np_drake.identification/1"
    assert values["config"]["input"] == "rotor_speed"
    told = {q["name"]: q for q in values["quantities"]}
    low, high = told["inertia xx"]["ci95"]
    assert low < told["inertia xx"]["value"] < high
    assert {row["model"] for row in values["held_out"]} == {"vehicle file", "identified"}
    assert {row["flight"] for row in values["held_out"]} == {"b"}


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["a.csv", *GUESS, "--mass", "0"], "--mass must be 0.005 to 1000 kg; got 0"),
        (["a.csv", *GUESS, "--input", "steam"], "command or collective; got 'steam'"),
        (["a.csv", *GUESS, "--trust", "luck"], "--trust must be mass or thrust; got 'luck'"),
        (
            ["throttle.csv", *GUESS, "--trust", "thrust"],
            "without a measured coefficient; give --mass",
        ),
        (["a.csv", *GUESS, "--held-out", "a.csv"], "must be given once"),
        (
            ["a.csv", *GUESS, "--held-out", "short.csv"],
            "--held-out: must last 3 s at least; got 2 s",
        ),
        (["short.csv", *GUESS], "needs a flight of 3 s at least; the longest lasts 2 s"),
        (["a.csv", "throttle.csv", *GUESS], "in common; got a rotor_speed; throttle throttle"),
        (
            ["desk.csv", *GUESS],
            "its rotors do not turn, as on a desk, so that it tells nothing. Fly roll and pitch",
        ),
    ],
)
def test_bad_input_is_one_clear_line(folder, monkeypatch, capsys, arguments, said):
    monkeypatch.chdir(folder)
    assert said in refusal(capsys, *arguments)


def test_logs_without_a_vehicle_file_are_identified_by_four_measures(folder, capsys, tmp_path):
    arm = 2.0**0.5 * abs(TRUE.rotor_positions[0][0]) + 2.0**0.5 * abs(TRUE.rotor_positions[0][1])
    measures = ["--wheelbase", str(arm), "--propeller", str(2 * TRUE.rotor_radius)]
    measures += ["--order", "crazyflie", "--mass", str(TRUE.mass)]
    log = str(folder / "a.csv")
    assert run(["identify", log, *measures, "--out", str(tmp_path)]) == 0
    found = load_checked(Vehicle, tmp_path / "vehicle.yaml", "vehicle")
    np.testing.assert_allclose(np.diag(found.J), np.diag(TRUE.J), rtol=0.05)
    assert "--props" in refusal(capsys, log, *measures, "--props", "out")
    assert "--props" in refusal(capsys, log, *GUESS, "--props", "out")
    assert "--props must be in or out; got 'up'" in refusal(capsys, log, *GUESS, "--props", "up")
    assert "leave --order out" in refusal(capsys, log, *GUESS, "--order", "px4")
    missing = refusal(capsys, log, *measures[2:])
    assert "give --vehicle FILE, or --wheelbase as well" in missing


def test_propellers_turn_as_the_log_states_and_no_option_contradicts_it(folder, capsys, tmp_path):
    (short,) = read(folder / "short.csv")
    path, stated = tmp_path / "out.csv", FIRMWARE["crazyflie"]
    out = dc.replace(stated, directions=tuple(-d for d in stated.directions))
    write_log(short, path)
    write_sheet(Sheet(rotors=out), path)
    frame = ["--wheelbase", "0.09", "--propeller", "0.05", "--order", "crazyflie", "--mass", "0.04"]
    for option in ([], ["--props", "out"]):  # read, and too short
        assert "needs a flight of 3 s" in refusal(capsys, path, *frame, *option)
    said = refusal(capsys, path, *frame, "--props", "in")
    assert said.endswith(
        f"--props in: the propellers of out turn out at the front ({out.source}). "
        "Leave --props out."
    )


def test_a_collective_command_gives_its_map_and_says_what_needs_rotors(folder, capsys, tmp_path):
    paths = [tmp_path / f"{name}.csv" for name in "ab"]
    for path in paths:
        (log,) = read(folder / path.name)
        lift = TRUE.thrust_coefficient * np.sum(log.rotor**2, axis=1)
        command = 0.06 + 0.44 * lift / (TRUE.mass * TRUE.gravity)
        kept = {name: c for name, c in log.columns().items() if name not in EACH}
        write_csv(path, kept | {"throttle": command})
    assert run(["identify", *map(str, paths), *GUESS, "--out", str(tmp_path / "out")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert re.search(
        r"not told: inertia xx[^;]*; rotor speed, or the throttle of each motor, in the log", said
    )
    found = load_checked(Vehicle, tmp_path / "out" / "vehicle.yaml", "vehicle")
    share = 4 * found.throttle.thrust(0.5) / (TRUE.mass * TRUE.gravity)
    assert share == pytest.approx(1.0, abs=0.02)


def test_a_hover_says_what_it_does_not_tell_and_which_manoeuvre_would(folder, capsys):
    assert run(["identify", str(folder / "hover.csv"), *GUESS]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert re.search(r"not told: [^;]*inertia xx[^;]*; roll and pitch doublets would tell", said)
    assert re.search(r"not told: [^;]*drag, lateral[^;]*; speed would tell", said)
    assert "none tells which way the propellers turn" in said
