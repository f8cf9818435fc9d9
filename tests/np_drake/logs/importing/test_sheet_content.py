"""Laws of the sheet beside an imported log."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.effects.library import LIBRARY
from np_drake.logs.importing.sheet_content import unanswerable

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
