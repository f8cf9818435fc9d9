"""Law: a killed training leaves nothing half-written, and begins again to the same model."""

import os
import signal
import sys
import time
from contextlib import redirect_stderr, redirect_stdout

import numpy as np
import pytest

from diagrams.cli.main import run
from np_drake.logs.formats.log_file import write_log
from np_drake.logs.opening import open_flights
from np_drake.payload_filter import training as payload_filter_training  # noqa: F401 - before a child
from np_drake.residual_models import motion_training, predictor_training  # noqa: F401

# Runs of seconds
SHORT = {
    "knode": ("--epochs", "5"),
    "lifted": ("--envelope", "0", "--epochs", "300"),
    "paper": ("--epochs", "2"),
}  # runs of seconds


def train(folder, log, configuration):
    """Train by the verb, silently; `started` appears once the training begins."""
    (folder / "started").touch()
    with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere), redirect_stderr(nowhere):
        command = [
            "train",
            str(log),
            "--configuration",
            configuration,
            *SHORT.get(configuration, ()),
        ]
        sys.exit(run([*command, "--out", str(folder / "np.safetensors")]))


def content(folder):
    """Bytes of every file by name; what a killed writer leaves under a temporary name is none."""
    wanted = [
        path
        for path in folder.iterdir()
        if not path.name.startswith(".") and path.name != "started"
    ]
    return {path.name: path.read_bytes() for path in wanted}


@pytest.fixture(scope="module")
def log(logs, tmp_path_factory):
    """Twelve seconds of a log."""
    path = tmp_path_factory.mktemp("short") / "short.csv"
    write_log(open_flights(logs[0])[0][0].rows(0, 600), path)
    return path


@pytest.mark.parametrize("configuration", ["gp", "knode", "payload_filter", "lifted", "paper"])
def test_killed_at_any_instant(configuration, log, tmp_path, forked):
    def start(folder):
        folder.mkdir(exist_ok=True)
        (folder / "started").unlink(missing_ok=True)
        training = forked(train, folder, log, configuration)
        while not (folder / "started").exists():
            assert training.is_alive()
            time.sleep(0.005)
        return training

    whole, killed = tmp_path / "whole", tmp_path / "killed"
    training, begun = start(whole), time.monotonic()
    training.join()
    assert training.exitcode == 0
    length, kills = time.monotonic() - begun, 0
    for share in np.random.default_rng(7).uniform(0.1, 0.8, 2):
        training = start(killed)
        time.sleep(share * length)
        training.kill()
        training.join()
        kills += training.exitcode == -signal.SIGKILL
        assert content(killed).items() <= content(whole).items()
    training = start(killed)
    training.join()
    assert training.exitcode == 0
    assert kills >= 1
    assert content(killed) == content(whole)
    assert "np.safetensors" in content(whole)
