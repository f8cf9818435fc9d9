"""The MPC's weights, chosen once on the vehicle without payload."""

import dataclasses as dc
import itertools
from collections.abc import Callable, Iterator

import numpy as np
from joblib import Parallel, delayed

from diagrams.experiments import load_experiment
from diagrams.flight_result import fly

POSITION = (0.5, 1.0, 2.0)  # factors on weight_position [1]
RATE = (0.3, 1.0, 3.0)  # factors on weight_rate [1]
TORQUE = (0.3, 1.0, 3.0)  # factors on the torque part of weight_input [1]

EFFORT = 1.0  # what a newton metre of RMS torque costs in error; own choice [m/(N·m)]


def _score(position: float, rate: float, torque: float, seed: int, duration: float) -> dict:
    """Error and effort of the nominal MPC on the bare lemniscate, everything else as in the experiments."""
    config = load_experiment("lemniscate")
    config.duration, config.reality.payload.tether = duration, "none"
    config.controller.kind, config.controller.solver = "nominal", "sqp"
    mpc = config.controller.mpc
    config.controller.mpc = dc.replace(
        mpc,
        weight_position=[position * w for w in mpc.weight_position],
        weight_rate=[rate * w for w in mpc.weight_rate],
        weight_input=[mpc.weight_input[0], *(torque * w for w in mpc.weight_input[1:])],
    )
    flight = fly(config, seed=seed)
    m, rows = flight.metrics(), flight.scored
    effort = np.sqrt(np.mean(np.sum(flight.signals["u"][rows, 1:3] ** 2, axis=1)))
    factors = {"position": position, "rate": rate, "torque": torque}
    score = m["E_xy"] + m["E_z"] + EFFORT * effort
    return {**factors, "E_xy": m["E_xy"], "E_z": m["E_z"], "torque_rms": float(effort), "score": float(score)}


def weight_table(
    *,
    seed: int,
    duration: float = 20.0,
    jobs: int = 2,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[dict]:
    """Every combination of the factors; 1, 1, 1 is what is frozen in `MpcConfig`."""
    grid = list(itertools.product(POSITION, RATE, TORQUE))
    results: Iterator[dict] = Parallel(n_jobs=jobs, return_as="generator")(
        delayed(_score)(*factors, seed, duration) for factors in grid
    )
    lines = []
    for line in results:
        lines.append(line)
        on_progress(len(lines), len(grid))
    return lines
