"""Law: arrays of a result arrive as they were, bit for bit."""

import json

import numpy as np

from diagrams.batch.arrays import packed, unpacked


def test_through_json_and_back():
    arrays = {
        "a": np.array([[0.1, np.nan], [np.inf, -0.0]]),
        "b": np.arange(3),
        "none": np.empty((0, 2)),
    }
    found = unpacked(json.loads(json.dumps(packed(arrays))))
    assert list(found) == list(arrays)
    for name, value in arrays.items():
        assert found[name].dtype == value.dtype
        assert found[name].shape == value.shape
        assert found[name].tobytes() == value.tobytes()


def test_equal_arrays_are_equal_text():
    assert packed({"a": np.ones(5)}) == packed({"a": np.ones(5)})
