"""Laws of the comparison of model files with the packaged ones."""

import dataclasses as dc
import shutil

import numpy as np
import pytest

from diagrams.loop.controller_config import FILTER_MODEL, NP_MODEL
from diagrams.tracking.packaged import Difference, difference, tensor_difference
from np_drake.payload_filter.model_file import PayloadFilterModel


@pytest.mark.parametrize("packaged", [NP_MODEL, FILTER_MODEL])
def test_a_copy_does_not_differ(packaged, tmp_path):
    assert difference(shutil.copy(packaged, tmp_path / packaged.name)) == (0, 0)


def test_a_change_by_a_tenth_is_a_tenth(tmp_path):
    model = PayloadFilterModel.load(FILTER_MODEL)
    path = tmp_path / FILTER_MODEL.name
    dc.replace(model, drag=1.1 * model.drag).save(path)
    assert difference(path) == (pytest.approx(0.1), 0.0)


def test_another_configuration_differs_without_bound(tmp_path):
    assert difference(shutil.copy(NP_MODEL, tmp_path / FILTER_MODEL.name)) == (np.inf, np.inf)


def test_a_delay_where_the_packaged_model_has_none_differs_by_itself(tmp_path):
    model = PayloadFilterModel.load(FILTER_MODEL)
    assert model.delay == 0.0
    path = tmp_path / FILTER_MODEL.name
    dc.replace(model, delay=0.005).save(path)
    assert difference(path) == (0.0, 0.005)  # [s]


@pytest.mark.parametrize(("packaged", "expected"), [(2.0, (np.inf, 0.0)), (0.0, (0.0, np.inf))])
def test_a_number_that_is_none_differs_without_bound(packaged, expected):
    first, there = np.zeros(1), np.array([packaged, packaged])
    found = tensor_difference(
        {"a": first, "b": np.array([packaged, np.nan])}, {"a": first, "b": there}
    )
    assert found == Difference(*expected)
