"""Selection of the MPC's weights on the vehicle without payload."""

import dataclasses as dc
import itertools
from collections.abc import Sequence

import numpy as np

from diagrams.batch.campaign import Case
from diagrams.batch.columns import tabulate
from diagrams.batch.run import NoOptions as Options
from diagrams.batch.run import Report, Run
from diagrams.batch.workers import failures, results
from diagrams.loop.experiments import load_experiment, settings_of
from diagrams.loop.flight_result import fly

POSITION = (0.25, 0.5, 1.0, 2.0, 4.0)  # factors on weight_position [1]
TORQUE = (0.1, 0.3, 1.0, 3.0, 10.0)  # factors on the torque part of weight_input [1]
EFFORT = (
    0.035  # RMS roll and pitch torque that may be spent on noise and tracking; own choice [N·m]
)
LAG = 0.06  # of the motors: twice what flies, so that the loop keeps its margin; own choice [s]


def score(case: Case) -> dict:
    """Return error and effort of the nominal MPC on the lemniscate without payload and with slower
    motors.
    """
    position, torque, seed, duration = (
        case[key] for key in ("position", "torque", "seed", "duration")
    )
    config = load_experiment("lemniscate")
    config.duration, config.reality.payload.tether = duration, "none"
    config.reality.motor_lag = LAG
    config.controller.kind, config.controller.solver = "nominal", "sqp"
    mpc = config.controller.mpc
    config.controller.mpc = dc.replace(
        mpc,
        weight_position=[position * w for w in mpc.weight_position],
        weight_input=[mpc.weight_input[0], *(torque * w for w in mpc.weight_input[1:])],
    )
    flight = fly(config, seed=seed)
    m, rows = flight.metrics(), flight.scored
    effort = np.sqrt(np.mean(np.sum(flight.signals["u"][rows, 1:3] ** 2, axis=1)))
    allowed = bool(effort <= EFFORT)
    named = {"position": position, "torque": torque}
    return {
        **named,
        "E_xy": m["E_xy"],
        "E_z": m["E_z"],
        "torque_rms": float(effort),
        "allowed": allowed,
    }


def weight_table(
    run: Run,
    duration: float = 20.0,
    position: Sequence[float] = POSITION,
    torque: Sequence[float] = TORQUE,
) -> list[dict]:
    """Return every combination of the factors, best first: least E_xy within the effort allowed.

    Factors 1, 1 are those of `MpcConfig`. Flights without a result are missing; the records of the
    run's workers say why.

    Args:
        duration: of a flight, after the ramp [s].
        position: factors on `weight_position` [1].
        torque: factors on the torque part of `weight_input` [1].
    Raises: FailedRun: if no flight has a result.
    """
    cases = [
        {"position": p, "torque": t, "seed": run.seed, "duration": duration}
        for p, t in itertools.product(position, torque)
    ]
    config = {
        "motor_lag": LAG,
        "allowed": EFFORT,
        "lemniscate": settings_of(load_experiment("lemniscate")),
    }
    records = run.cases("weights", "", score, cases, config=config)
    return sorted(results(records), key=lambda line: (not line["allowed"], line["E_xy"]))


def run(run: Run, options: Options) -> Report:
    """How the MPC's weights were chosen. On the vehicle without payload."""
    lines = weight_table(run)
    title = (
        f"factors on the frozen weights; lemniscate, no payload, motor lag {LAG} s, seed {run.seed}"
    )
    columns = (
        ("position", "position"),
        ("torque", "torque"),
        ("E_xy [cm]", lambda line: round(100 * line["E_xy"], 2)),
        ("E_z [cm]", lambda line: round(100 * line["E_z"], 2)),
        ("torque RMS [N·m]", lambda line: round(line["torque_rms"], 4)),
        ("allowed", lambda line: "yes" if line["allowed"] else "no"),
    )
    config = {"allowed_torque_rms": EFFORT, "motor_lag": LAG}
    return Report(
        [tabulate(title, lines, columns)],
        config=config,
        metrics={"table": lines},
        notes=failures(run.workers.finished),
    )
