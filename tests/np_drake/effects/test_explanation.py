"""Laws of explanations as `diagnosis.json` holds them."""

import dataclasses as dc
import json

import numpy as np
import pytest

from np_drake.effects.explanation import Explanation
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.thrust_scale import ThrustScale

DRAG = Explanation(
    ("linear_drag",),
    0.7,
    (LinearDrag(0.1, 0.2, 0.3),),
    (ThrustScale(1.001),),
    ("linear_drag.d_x", "calibration.thrust_scale.scale"),
    np.array([[1e-3, 1e-5], [1e-5, 1e-4]]),
)


def test_an_explanation_is_read_as_it_was_written():
    dut = Explanation.of_json(json.loads(json.dumps(DRAG.as_json())))
    assert dc.replace(dut, covariance=DRAG.covariance) == DRAG
    np.testing.assert_array_equal(dut.covariance, DRAG.covariance)


def test_an_explanation_of_nothing_has_no_parameters():
    dut = Explanation.of_json(json.loads(json.dumps(Explanation((), 1.0, ()).as_json())))
    assert dut.covariance.shape == (0, 0)
    assert dut.label == "nothing"


@pytest.mark.parametrize(
    "wrong, why",
    [
        ({"covariance": [[1.0]]}, "2 by 2"),
        ({"effects": [{"effect": "ghost", "parameters": {}}]}, "ghost"),
    ],
)
def test_what_is_no_explanation_is_refused(wrong, why):
    with pytest.raises(ValueError, match=why):
        Explanation.of_json(DRAG.as_json() | wrong)
