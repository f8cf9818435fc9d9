"""A log without position or velocity is what its body axes tell, and says which effects cannot be
told.
"""

import numpy as np
import pytest

from np_drake import attitude
from np_drake.diagnosis.doctor.examine import examine
from np_drake.diagnosis.residuals import FORCE, TORQUE, make_flight_residuals
from np_drake.effects.library import LIBRARY
from np_drake.logs.columns import COLUMNS
from np_drake.logs.columns import FORCE as SPECIFIC
from np_drake.logs.errors import LogError
from np_drake.logs.formats import text_table
from np_drake.logs.formats.log_file import write_log
from np_drake.logs.importing.import_log import import_log
from np_drake.logs.opening import open_flights
from np_drake.vehicle import Vehicle

NO_VELOCITY = {i for i, effect in LIBRARY.items() if "velocity" in effect.requires}
G = np.array([0.0, 0.0, 9.81])
NO_HEIGHT = {i for i, effect in LIBRARY.items() if "height" in effect.requires}


@pytest.fixture
def without(excited, tmp_path):
    """Return a function that writes the excited flight without columns of these starts, and opens
    it.
    """

    def go(*starts):
        write_log(excited, tmp_path / "whole.csv")
        rows = [line.split(",") for line in (tmp_path / "whole.csv").read_text().splitlines()]
        keep = [
            k for k, name in enumerate(rows[0]) if len(name) != 2 or not name.startswith(starts)
        ]
        text = "\n".join(",".join(row[k] for k in keep) for row in rows)
        (tmp_path / "part.csv").write_text(text + "\n")
        return open_flights(tmp_path / "part.csv", Vehicle())

    return go


@pytest.mark.parametrize(
    "starts, hidden", [(("w",), set()), (("p",), NO_HEIGHT), (("p", "v"), NO_HEIGHT | NO_VELOCITY)]
)
def test_a_log_without_columns_keeps_what_its_body_axes_tell(without, excited, starts, hidden):
    (dut,), sheet = without(*starts)
    whole, part = (make_flight_residuals(log, Vehicle()) for log in (excited, dut))
    force, torque = (part.y[:, k] - whole.y[:, k] for k in (FORCE, TORQUE))
    assert np.sqrt(np.mean(force**2)) < 0.05  # [N]
    if "w" not in starts:
        assert np.sqrt(np.mean(torque**2)) < 1e-3  # [N·m]
    answers = examine([dut], Vehicle(), sheets={dut.name: sheet.content}).answers
    assert {a.identifier for a in answers if a.verdict == "never"} == hidden
    assert all("log " in a.todo for a in answers if a.identifier in hidden)


def test_what_a_log_lacks_is_said_when_it_is_imported(excited, tmp_path):
    table = {name: column for name, column in excited.columns().items() if name[0] != "p"}
    text_table.write_csv(tmp_path / "part.csv", table)
    dut = import_log(tmp_path / "part.csv")
    assert any(line.startswith("position: none in the log") for line in dut.shown)


@pytest.fixture
def body(tmp_path):
    """Return a function: a flight as gyro, accelerometer and commands alone, in a file; changed by
    `turn`.
    """

    def go(log, turn=lambda rates, force: (rates, force), name="body.csv"):
        force = attitude.rotate_back(log.q, log.a + G)
        rates, force = turn(log.w, force)
        names = [*COLUMNS["t"], *COLUMNS["w"], *SPECIFIC, *COLUMNS["u"]]
        table = np.column_stack([log.t, rates, force, log.u])
        np.savetxt(
            tmp_path / name, table, delimiter=",", header=",".join(names), comments="", fmt="%.12g"
        )
        return tmp_path / name

    return go


def specific_force(log):
    return attitude.rotate_back(log.q, log.a + G)


def test_without_attitude_the_specific_force_survives_exactly(body, excited):
    (dut,), sheet = open_flights(body(excited, lambda w, s: (w + 0.1, s)))
    assert dut.lacks == ("attitude", "velocity", "height")
    np.testing.assert_allclose(specific_force(dut), specific_force(excited), atol=1e-6)
    np.testing.assert_allclose(dut.w, excited.w + 0.1, atol=1e-6)
    assert any("levelled by the accelerometer" in note for note in sheet.content["notes"])


def test_an_attitude_that_was_integrated_is_level_on_the_whole(body, fly):
    log = fly(seed=5, seconds=40.0, noise=1.0)
    (dut,), _ = open_flights(body(log, lambda w, s: (w + [0.02, -0.02, 0.02], s)))
    tilt = [np.arccos(attitude.body_z(x.q)[:, 2]) for x in (log, dut)]
    assert np.sqrt(np.mean((tilt[1] - tilt[0]) ** 2)) < 0.1


TURNS = {
    "g": lambda w, s: (w, s / 9.80665),
    "frd": lambda w, s: (w * [1, -1, -1], s * [1, -1, -1]),
    "sign": lambda w, s: (w, -s),
}


@pytest.mark.parametrize("name", TURNS)
def test_an_accelerometer_in_another_unit_or_frame_is_refused(body, excited, name):
    with pytest.raises(LogError, match=r"misfit of (gravity|upright)") as error:
        open_flights(body(excited, TURNS[name]))
    assert {"g": "fits acceleration.unit: g", "frd": "body: frd"}.get(name, "") in str(error.value)
