"""Laws of the count of unstable operators along a flight."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.residual_model import constant_forecast
from np_drake.skill.flight_skill import walked_stability
from np_drake.training_data.training_segments import of_wrenches


class Growing:
    """A has the number of samples so far, over ten, on its diagonal."""

    name, step = "growing", 0.02

    def initial_memory(self):
        return {"count": np.zeros(1)}

    def update(self, memory, sample):
        return {"count": memory["count"] + 1}

    def forecast(self, memory, *, horizon, stride):
        silent = constant_forecast(np.zeros(6), horizon)
        return dc.replace(
            silent, A=memory["count"][0] / 10 * np.eye(2), B=np.zeros((2, 6)), C=np.zeros((6, 2))
        )


def test_every_sample_with_a_radius_above_one_counts():
    found = walked_stability(Growing(), of_wrenches(np.zeros((13, 6)), np.zeros((13, 6)), 0.02))
    assert (found.windows, found.unstable, found.pulled) == (
        13,
        3,
        0,
    )  # a radius of one itself is none
    assert found.largest == pytest.approx(1.3)
