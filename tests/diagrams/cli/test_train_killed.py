"""Law: a killed training without checkpoints leaves nothing half-written, and begins again to the same model."""

import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from np_drake.logs.formats.log_file import write_log
from np_drake.logs.opening import open_flights

# `started` appears once all is imported and the training begins.
PROGRAM = """
import sys
from pathlib import Path

from diagrams.cli.main import run
from np_drake.residual_models import motion_training, predictor_training
from np_drake.payload_filter import training as payload_filter_training

Path(sys.argv[1]).touch()
sys.exit(run(sys.argv[2:]))
"""


def start(folder, log, configuration):
    folder.mkdir(exist_ok=True)
    started = folder / "started"
    started.unlink(missing_ok=True)
    command = ["train", str(log), "--configuration", configuration, "--out", str(folder / "np.safetensors")]
    training = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(started), *command],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    while not started.exists():
        assert training.poll() is None
        time.sleep(0.005)
    return training


def content(folder):
    """Bytes of every file by name; what a killed writer leaves under a temporary name is none."""
    wanted = [path for path in folder.iterdir() if not path.name.startswith(".") and path.name != "started"]
    return {path.name: path.read_bytes() for path in wanted}


@pytest.fixture(scope="module")
def log(logs, tmp_path_factory):
    """Twelve seconds of a log."""
    path = tmp_path_factory.mktemp("short") / "short.csv"
    write_log(open_flights(logs[0])[0][0].rows(0, 600), path)
    return path


@pytest.mark.parametrize("configuration", ["gp", "knode", "payload_filter", "delay-modal"])
def test_killed_at_any_instant(configuration, log, tmp_path):
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    training, begun = start(whole, log, configuration), time.monotonic()
    assert training.wait() == 0
    length, kills = time.monotonic() - begun, 0
    for share in np.random.default_rng(7).uniform(0.1, 0.8, 2):
        training = start(killed, log, configuration)
        time.sleep(share * length)
        training.kill()
        kills += training.wait() == -signal.SIGKILL
        assert content(killed).items() <= content(whole).items()
    training = start(killed, log, configuration)
    assert training.wait() == 0
    assert kills >= 1
    assert content(killed) == content(whole)
    assert "np.safetensors" in content(whole)
