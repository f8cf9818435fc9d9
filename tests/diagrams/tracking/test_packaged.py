"""Laws of the comparison of model files with the packaged ones."""

import dataclasses as dc
import shutil

import numpy as np
import pytest

from diagrams.loop.controllers import DEFAULT_MODEL, FLYING_MODEL
from diagrams.tracking.packaged import difference
from np_drake.residual_models.pendulum_model import PendulumModel


@pytest.mark.parametrize("packaged", [DEFAULT_MODEL, FLYING_MODEL])
def test_a_copy_does_not_differ(packaged, tmp_path):
    assert difference(shutil.copy(packaged, tmp_path / packaged.name)) == 0


def test_a_change_by_a_tenth_is_a_tenth(tmp_path):
    model = PendulumModel.load(FLYING_MODEL)
    path = tmp_path / FLYING_MODEL.name
    dc.replace(model, drag=1.1 * model.drag).save(path)
    assert difference(path) == pytest.approx(0.1)


def test_another_configuration_differs_without_bound(tmp_path):
    assert difference(shutil.copy(DEFAULT_MODEL, tmp_path / FLYING_MODEL.name)) == np.inf
