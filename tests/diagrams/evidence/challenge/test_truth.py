import dataclasses as dc

import numpy as np
import pytest

from diagrams.evidence.challenge.case import FILES, CaseDraw, SetRequest, draw_case
from diagrams.evidence.challenge.make import fly_case
from diagrams.evidence.challenge.out_of_library import OutOfLibraryWrench
from diagrams.evidence.challenge.truth import GroundTruth
from np_drake.effects.base import chi_from_body
from np_drake.effects.thrust_scale import ThrustScale

HELD_OUT = FILES[-1]


def ceiling(vehicle, motion, height):
    """Rotors give a fifth more just below the height, fading over half a metre."""
    near = np.exp(-np.maximum(height - motion.x[..., 2], 0.0) / 0.5)
    return chi_from_body(motion, (0.2 * motion.rotor_thrust.sum(-1) * near)[..., None] * [0, 0, 1])


@pytest.mark.parametrize(("height", "names"), [(0.0, "mass_error"), (2.5, None)])
def test_a_ceiling_is_a_mass_to_vehicles_that_stay_above_it(height, names):
    draw = CaseDraw(0, "foreign", ("wall_suction",))
    case = draw_case(draw, SetRequest(seed=3, seconds=5.0))
    case = dc.replace(case, effects=(OutOfLibraryWrench(ceiling, height=height),))
    found = GroundTruth(case, *fly_case(case)).equivalent_library_effects()
    assert (names in found) if names else not found


def test_a_class_holds_what_is_physically_the_same():
    draw = CaseDraw(0, "single", ("thrust_scale",))
    case = draw_case(draw, SetRequest(seed=3, seconds=5.0))
    case = dc.replace(case, effects=(ThrustScale(0.9),))
    truth = GroundTruth(case, *fly_case(case))
    (names,) = truth.collinear_class()
    assert names[0] == "thrust_scale"
    assert "linear_drag" not in names
    nothing = dc.replace(case, effects=())
    dut = GroundTruth(nothing, *fly_case(nothing))
    assert dut.collinear_class() == []
    assert dut.visibility(HELD_OUT) == pytest.approx(1.0, abs=0.05)
