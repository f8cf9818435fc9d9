"""Laws of the scenario `paper_vehicle`, and of what flies in it."""

from pathlib import Path

import numpy as np
import pytest

from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight_result import fly
from diagrams.payload.attach import ROWS as ATTACH_ROWS
from diagrams.payload.attach import attach_config
from diagrams.payload.hover_swing import ROWS as HOVER_ROWS
from diagrams.payload.hover_swing import hover_config
from diagrams.tracking.study import printed
from diagrams.tracking.tracking import PAPER, ROWS, TRACKS, configure, named, table, training_config

REGIME = Path("paper_vehicle")


@pytest.mark.parametrize("track", TRACKS)
def test_the_nominal_mpc_on_the_papers_vehicle_has_the_papers_errors(track):
    config = configure(track, named(ROWS, "nominal"), solver="sqp", reality=REGIME)
    config.duration = 15.0
    metrics = fly(config, seed=3).metrics()
    found = [metrics["E_xy"], metrics["E_z"]]
    np.testing.assert_allclose(found, PAPER["nominal"][track], rtol=0.15)  # asked for


def test_horizontally_the_papers_vehicle_has_the_autopilots_own_gains():
    config = load_experiment("paper_vehicle")
    mpc, lever = (
        config.controller.mpc,
        4 * config.vehicle.gravity**2 / config.controller.mpc.weight_attitude[1],
    )
    stiffness = np.sqrt(lever * mpc.weight_position[0])
    damping = np.sqrt(lever * mpc.weight_velocity[0] + 2 * stiffness)
    # PX4: MPC_XY_P times MPC_XY_VEL_P_ACC [1/s²], and the latter [1/s]; the weights have two
    # digits.
    np.testing.assert_allclose([stiffness, damping], [0.95 * 1.8, 1.8], rtol=0.06)


def test_what_the_paper_tells_of_its_vehicle_is_what_flies():
    config = load_experiment("circle", reality=REGIME)
    payload, home = config.reality.payload, load_experiment("circle")
    told = (
        config.vehicle.mass,
        payload.mass,
        payload.length,
        config.controller.period,
        config.reality.command_delay,
    )
    assert told == (2.0, 0.26, 0.8, 0.02, 0.015)  # [kg, kg, m, s, s]
    for name in ("rotor_drag", "motor_lag", "thrust_scale", "noise"):
        assert getattr(config.reality, name) == getattr(home.reality, name)


@pytest.mark.parametrize("row", ["np", "hold", "oracle"])
def test_every_study_flies_and_trains_with_the_weights_of_its_reality(row):
    weights = load_experiment("paper_vehicle").controller.mpc
    assert (
        configure("lemniscate", named(ROWS, row), solver="sqp", reality=REGIME).controller.mpc
        == weights
    )
    assert training_config("plain_circle", solver="sqp", reality=REGIME).controller.mpc == weights
    assert hover_config(HOVER_ROWS[0], solver="sqp", reality=REGIME).controller.mpc == weights
    assert (
        attach_config(ATTACH_ROWS[0], solver="sqp", model="", reality=REGIME).controller.mpc
        == weights
    )


def test_a_scenario_with_a_controller_keeps_it_in_another_reality(tmp_path):
    (tmp_path / "own.yaml").write_text(
        "name: own\ncontroller: {mpc: {weight_rate: [0.1, 0.1, 0.1]}}\n"
    )
    config = load_experiment(str(tmp_path / "own.yaml"), reality=REGIME)
    assert config.controller.mpc.weight_rate == [0.1, 0.1, 0.1]
    assert (
        config.controller.mpc.weight_position
        == load_experiment("circle").controller.mpc.weight_position
    )
    assert config.reality.command_delay == 0.015


def test_the_papers_cuts_stand_beside_those_of_its_controllers():
    made = [
        {
            "row": row,
            "experiment": track,
            "metrics": {"E_xy": e, "E_z": e, "growth": 1.0, "solve_failures": 0},
        }
        for row, e in (("nominal", 0.2), ("np", 0.1), ("oracle", 0.05))
        for track in TRACKS
    ]
    _, header, rows = printed(table(made), "title")
    cells = {(row[0], row[1]): dict(zip(header, row, strict=True))["paper's cuts"] for row in rows}
    assert cells["circle", "np"] == "53 % / 67 %"
    assert cells["lemniscate", "np"] == "58 % / 77 %"
    assert cells["circle", "oracle"] == "–"
