"""A log that lacks what a flight needs is told what, which columns may hold it, and the line of a
map.
"""

import pytest

from np_drake.logs.importing.import_log import input_line, lacking

OURS = ["t", "px", "py", "pz", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz", "thrust"]


OR = ", or gyro and accelerometer (wx wy wz sx sy sz)"


@pytest.mark.parametrize(
    "names, said",
    [
        ([n for n in OURS if n[0] != "q"], f"attitude (qw qx qy qz, or Euler angles by a map){OR}"),
        ([n for n in OURS if n != "qz"], f"attitude (qz, or Euler angles by a map){OR}"),
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


def test_columns_that_may_be_motors_are_named():
    said = input_line({"table": ("t", *(f"motor_m{k}" for k in (1, 2, 3, 4)), "px")})
    assert said.startswith(" Its motor_m1 … motor_m4 may be such")
