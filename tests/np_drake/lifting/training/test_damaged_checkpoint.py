"""A checkpoint is resumed as it was saved, or refused in one line."""

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

from np_drake.lifting.training.checkpoint import Checkpoint
from np_drake.lifting.training.paper_training import PaperConfig

STATE = {"history": np.arange(3.0), "parameter0": np.ones((4, 6)), "parameter0/step": np.ones(1)}


@pytest.fixture
def dut(tmp_path):
    checkpoint = Checkpoint(tmp_path / "run.safetensors", PaperConfig(), [])
    checkpoint.save(STATE)
    return checkpoint, tmp_path / "run.safetensors"


def test_what_is_saved_is_loaded(dut):
    checkpoint, _ = dut
    loaded = checkpoint.load()
    assert loaded.keys() == STATE.keys()
    for name, value in STATE.items():
        np.testing.assert_array_equal(loaded[name], value)


DAMAGES = {
    "a tensor is missing": lambda tensors: tensors.pop("parameter0/step"),
    "a tensor has another shape": lambda tensors: tensors.update(parameter0=np.ones((6, 4))),
    "a tensor has another name": lambda tensors: tensors.update(parameter1=tensors.pop("parameter0")),
    "a number is another": lambda tensors: tensors["history"].__setitem__(1, 2.0),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_checkpoint_of_other_content_is_refused(dut, damage):
    checkpoint, path = dut
    with safe_open(path, "numpy") as file:
        metadata = file.metadata()
    tensors = load_file(path)
    DAMAGES[damage](tensors)
    save_file(tensors, path, metadata)
    with pytest.raises(ValueError, match=r"must be whole; it is damaged"):
        checkpoint.load()


def test_no_flip_of_a_byte_and_no_cut_is_more_than_a_refusal(dut):
    checkpoint, path = dut
    content = path.read_bytes()
    flips = [content[:k] + bytes([content[k] ^ 0x41]) + content[k + 1 :] for k in range(0, len(content), 3)]
    for damaged in [*flips, *(content[:k] for k in range(0, len(content), 50))]:
        path.write_bytes(damaged)
        try:
            loaded = checkpoint.load()
        except ValueError as error:
            assert "\n" not in str(error)  # noqa: PT017
        else:  # the flip changed nothing that is read
            np.testing.assert_array_equal(loaded["parameter0"], STATE["parameter0"])
