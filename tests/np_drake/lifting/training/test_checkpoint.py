"""Laws of checkpoints: a killed run goes on to the same model, and what is no checkpoint of the run is refused."""

import signal
import time

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.numpy import load_file, save_file
from scipy.signal import lfilter

from np_drake.lifting.model.model_file import save_model
from np_drake.lifting.training.checkpoint import REMEDY, SCHEMA, Checkpoint
from np_drake.lifting.training.train import make_config, train
from np_drake.training_data.segments import Segment

SETTINGS = {"paper": {"epochs": 12}}  # of the configurations that train for long enough


def noise():
    """Return a segment of noise through a filter."""
    values = lfilter([0.1], [1.0, -0.9], np.random.default_rng(0).standard_normal((900, 12)), axis=0)
    return Segment(values[:, :6], values[:, 6:], 0.02)


def train_on_noise(configuration, folder):
    """Train with checkpoints; `started` appears once the training begins."""
    (folder / "started").touch()
    config = make_config(configuration, **SETTINGS[configuration])
    result = train([noise()], config, checkpoint=folder / "run.ckpt")
    save_model(result.model, folder / "model.safetensors")


def content(path):
    """Header and bytes of every tensor; the format does not fix the order of the header's names."""
    with safe_open(str(path), framework="numpy") as file:
        metadata = file.metadata()
    return metadata, {name: value.tobytes() for name, value in load_file(path).items()}


@pytest.mark.parametrize("configuration", SETTINGS)
def test_a_run_killed_at_any_three_instants_ends_in_the_same_model(configuration, tmp_path, forked):
    def start(folder):
        (folder / "started").unlink(missing_ok=True)
        run = forked(train_on_noise, configuration, folder)
        while not (folder / "started").exists():
            assert run.is_alive()
            time.sleep(0.005)
        return run

    train([noise()], make_config(configuration, **dict.fromkeys(SETTINGS[configuration], 1)))  # imports all
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    whole.mkdir()
    killed.mkdir()
    run, begun = start(whole), time.monotonic()
    run.join()
    assert run.exitcode == 0
    length = time.monotonic() - begun
    kills = 0
    for share in np.random.default_rng(7).uniform(0.1, 0.5, 3):
        run = start(killed)
        time.sleep(share * length)
        run.kill()
        run.join()
        kills += run.exitcode == -signal.SIGKILL
    run = start(killed)
    run.join()
    assert run.exitcode == 0
    assert kills >= 1
    for name in ("model.safetensors", "run.ckpt"):
        assert content(whole / name) == content(killed / name)


@pytest.fixture
def checkpoint(tmp_path):
    segment = Segment(np.zeros((200, 6)), np.zeros((200, 6)), 0.02)
    dut = Checkpoint(tmp_path / "run.ckpt", make_config("paper"), [segment])
    dut.save({"history": np.array([1.0, 0.5])})
    return dut, tmp_path / "run.ckpt"


def cut(path):
    path.write_bytes(path.read_bytes()[:-3])


def another_schema(path):
    save_file(load_file(path), path, {"schema": "np_drake.lifted_model/1"})


def another_run(path):
    save_file(load_file(path), path, {"schema": SCHEMA, "fingerprint": "0"})


def pickled(path):
    torch.save({"history": torch.zeros(2)}, path)


def empty(path):
    path.write_bytes(b"")


FAULTS = {
    cut: "not a checkpoint: truncated or another format",
    empty: "not a checkpoint: truncated or another format",
    pickled: "not a checkpoint: this is a pickle .*, which is never loaded",
    another_schema: "schema must be np_drake.training/1; got np_drake.lifted_model/1",
    another_run: "must be of this configuration and data, and of np_drake",
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_foreign_checkpoint_stays_and_is_one_line_with_file_and_remedy(checkpoint, fault):
    dut, path = checkpoint
    fault(path)
    before = path.read_bytes()
    with pytest.raises(ValueError, match=FAULTS[fault]) as caught:
        dut.load()
    said = str(caught.value)
    assert said.startswith(f"{path}: ")
    assert said.endswith(REMEDY)
    assert "\n" not in said
    assert path.read_bytes() == before


def test_what_was_saved_is_loaded(checkpoint):
    dut, _ = checkpoint
    assert dut.load()["history"].tolist() == [1.0, 0.5]
