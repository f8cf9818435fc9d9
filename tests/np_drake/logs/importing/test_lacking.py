"""A log that lacks what a flight needs is told what, which columns may hold it, and the line of a
map.
"""

import re

import numpy as np
import pytest
import yaml

from np_drake.logs.errors import LogError
from np_drake.logs.formats.log_file import write_log
from np_drake.logs.importing.import_log import import_log, lacking
from np_drake.logs.importing.log_map import load_map_file

OURS = ["t", "px", "py", "pz", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz", "thrust"]


@pytest.fixture
def table(excited, tmp_path):
    """Return a function that writes the flight as a table without some columns and with others."""

    def go(without, **beside):
        write_log(excited, tmp_path / "ours.csv")
        head, *rows = (line.split(",") for line in (tmp_path / "ours.csv").read_text().splitlines())
        kept = [k for k, name in enumerate(head) if not name.startswith(without)]
        lines = [",".join([*(head[k] for k in kept), *beside])]
        for i, row in enumerate(rows):
            lines.append(
                ",".join(
                    [
                        *(row[k] for k in kept),
                        *(repr(float(values[i])) for values in beside.values()),
                    ]
                )
            )
        path = tmp_path / "table.csv"
        path.write_text("\n".join(lines) + "\n")
        return path

    return go


OR = ", or gyro and accelerometer (wx wy wz sx sy sz)"


@pytest.mark.parametrize(
    "names, said",
    [
        ([n for n in OURS if n[0] != "q"], f"attitude (qw qx qy qz, or Euler angles by a map){OR}"),
        ([n for n in OURS if n != "qz"], f"attitude (qz, or Euler angles by a map){OR}"),
        (
            [*(n for n in OURS if n[0] != "q"), "roll", "pitch", "yaw"],
            "attitude (qw qx qy qz, or Euler angles by a map: "
            f"`attitude: {{columns: [roll, pitch, yaw], unit: rad}}`, or deg){OR}",
        ),
        (OURS[1:], "time (t)"),
        (
            ["t", "qw", "qx", "qy", "qz", "wx"],
            "position, velocity or acceleration (px py pz, vx vy vz, ax ay az)",
        ),
        (OURS, ""),
        (["a", "b", "c"], ""),
    ],
)
def test_what_the_names_of_a_table_do_not_tell_is_listed(names, said):
    assert lacking({"table": tuple(names)}) == said


def test_a_table_without_attitude_is_told_so(table):
    with pytest.raises(
        LogError,
        match=r"none tells attitude \(qw qx qy qz, or Euler .*\)\. Give a map \(--map FILE",
    ):
        import_log(table(("q",)))


@pytest.mark.parametrize(
    "largest, unit",
    [(1.0, "1"), (100.0, "percent"), (2000.0, "us"), (65535.0, "pwm16"), (2001.0, "dshot")],
)
def test_columns_that_may_be_motors_are_named_with_a_line_that_is_a_map(
    table, excited, tmp_path, largest, unit
):
    share = (
        np.linspace(0.2, 0.6, len(excited)) if unit != "us" else np.linspace(0.6, 0.8, len(excited))
    )
    share[3] = 1.0
    if unit == "dshot":
        share[4:] *= 0.5
    motors = {f"motor_m{k}": largest * share for k in (1, 2, 3, 4)}
    path = table(("thrust", "tx", "ty", "tz", "rotor"), **motors)
    with pytest.raises(
        LogError, match=r"thrust, rotor_speed or throttle; .* motor_m1 … motor_m4 may be such"
    ) as error:
        import_log(path)
    (line,) = re.findall(r"`(.*)`", str(error.value))
    stated = {"unit": unit} if unit != "1" else {}
    assert yaml.safe_load(line) == {"throttle": {"columns": list(motors)} | stated}
    (tmp_path / "map.yaml").write_text(line)
    assert load_map_file(tmp_path / "map.yaml").values.throttle.columns == list(motors)


@pytest.mark.parametrize(
    "stem, unit", [("motor_rpm", {"unit": "rpm"}), ("eRPM", {"unit": "erpm", "pole_pairs": 7})]
)
def test_columns_of_rotor_speed_are_named_with_their_unit(table, excited, stem, unit):
    speeds = {f"{stem}[{k}]": 7000.0 + 0 * excited.t for k in range(4)}
    with pytest.raises(LogError, match="may be such") as error:
        import_log(table(("thrust", "tx", "ty", "tz", "rotor"), **speeds))
    (line,) = re.findall(r"`(.*)`", str(error.value))
    assert yaml.safe_load(line) == {"rotor_speed": {"columns": list(speeds)} | unit}
