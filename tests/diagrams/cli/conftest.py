"""Small flights for the command line."""

from pathlib import Path

import numpy as np
import pytest

from np_drake.flight_log import FlightLog
from np_drake.logs.formats.log_file import write_log


def swinging_flight(seed: int, n: int = 1500, step: float = 0.02) -> FlightLog:
    """Level flight on a multisine: every force follows from the exact acceleration of the
    motion.
    """
    t = step * np.arange(n)
    draw = np.random.default_rng(seed)
    frequency = draw.uniform(0.5, 4.0, (5, 1, 3))
    phase = frequency * t[None, :, None] + draw.uniform(0, 2 * np.pi, (5, 1, 3))
    v = np.sum(0.4 * np.sin(phase), axis=0)
    a = np.sum(0.4 * frequency * np.cos(phase), axis=0)
    p = np.sum(-0.4 / frequency * np.cos(phase), axis=0)
    w = 0.02 * draw.normal(size=(n, 3))
    u = np.tile([19.62, 0.0, 0.0, 0.0], (n, 1))
    q = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
    return FlightLog(t=t, p=p, q=q, v=v, w=w, u=u, a=a, al=np.zeros((n, 3)), name=f"flight_{seed}")


@pytest.fixture(scope="session")
def logs(tmp_path_factory) -> list[Path]:
    """Two logs on file."""
    folder = tmp_path_factory.mktemp("logs")
    paths = [folder / "train.csv", folder / "test.csv"]
    for seed, path in enumerate(paths):
        write_log(swinging_flight(seed), path)
    return paths
