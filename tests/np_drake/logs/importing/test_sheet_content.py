"""Laws of the sheet beside an imported log."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.effects.library import LIBRARY
from np_drake.logs.errors import LogError
from np_drake.logs.import_sheet import read_sheet
from np_drake.logs.importing.import_log import unanswerable

TIMING, TORQUE, SCALE = (
    tuple(i for i, effect in LIBRARY.items() if quantity in effect.requires)
    for quantity in ("commands", "torque", "thrust")
)


@pytest.mark.parametrize(
    "kind, throttles, hidden",
    [
        ("command", 0, ()),
        ("rotor_speed", 1, TIMING),  # a collective throttle beside rotor speed takes no torque away
        ("thrust_only", 4, TORQUE),
        ("normalised", 1, (*SCALE, *TORQUE)),
        ("normalised", 4, SCALE),
    ],
)
def test_the_sheet_names_what_the_input_cannot_tell(fly, kind, throttles, hidden):
    log = fly(seed=1)
    throttle = np.full((len(log), throttles), 0.5) if throttles else None
    told = unanswerable(dc.replace(log, input=kind, throttle=throttle))
    named = {identifier for identifiers in told.values() for identifier in identifiers}
    assert named >= set(hidden)
    assert named.isdisjoint({*SCALE, *TIMING, *TORQUE} - set(hidden))


@pytest.mark.parametrize(
    "rotors",
    [
        "1",
        "{positions: [[1, 1]], directions: [1]}",
        "{positions: [1, 2, 3, 4], directions: [1, 1, 1, 1]}",
    ],
)
def test_a_sheet_whose_rotors_are_no_layout_is_refused(tmp_path, rotors):
    (tmp_path / "a.import.yaml").write_text(f"timing: 0.0\nrotors: {rotors}\n")
    with pytest.raises(LogError, match="must be a sheet of np-drake import"):
        read_sheet(tmp_path / "a.csv")
