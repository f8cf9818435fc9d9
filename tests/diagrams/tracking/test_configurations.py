"""Which configuration flies best: the table, and what cannot fly."""

import json

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.loop.experiments import load_experiment
from diagrams.tracking import configurations, tracking
from np_drake.lifting.model.model_file import save_model, with_origin
from np_drake.lifting.training.train import CONFIGURATIONS, make_config, train
from np_drake.training_data.segments import Segment


def flown(row: str, seed: int, e_xy: float, e_z: float, track: str = "circle") -> dict:
    metrics = {"E_xy": e_xy, "E_z": e_z, "growth": 1.0, "solve_failures": 0}
    return {"row": row, "experiment": track, "seed": seed, "metrics": metrics}


def test_every_configuration_has_a_row_between_the_floor_and_the_ceiling():
    names = [row.name for row in configurations.ROWS]
    assert names == [
        "nominal",
        "hold",
        *(f"np: {name}" for name in CONFIGURATIONS if name != "mode-dictionary"),
        "oracle",
    ]
    assert len({row.training for row in configurations.ROWS if row.kind == "np"}) == 1
    for row in configurations.ROWS:
        assert not row.configuration or make_config(
            row.configuration
        )  # in world axes, as a controller needs


def test_the_ranking_is_by_error_in_space_and_says_the_scatter_of_seeds():
    runs = [flown("np: a", s, 0.03, 0.04) for s in (1, 2)]
    runs += [flown("np: b", 1, 0.01, 0.0), flown("np: b", 2, 0.03, 0.0)]
    runs += [
        flown("np: c", 1, np.inf, np.inf),
        flown("np: c", 2, 0.0, 0.0),
        flown("oracle", 1, 0.001, 0.0),
    ]
    places = configurations.ranking(runs)
    assert [place[0] for place in places] == ["oracle", "np: b", "np: a", "np: c"]
    assert places[1][1:] == pytest.approx((0.02, 0.01 * np.sqrt(2)))
    assert places[2][1:] == pytest.approx((0.05, 0.0))
    assert configurations.verdict(places).endswith("b 2.00 ± 1.41, a 5.00 ± 0.00, c lost.")


def test_the_table_states_the_deviation_over_seeds():
    lines = tracking.table(
        [flown("nominal", s, e, 0.1) for s, e in ((1, 0.1), (2, 0.2), (3, 0.3))] * 1
        + [flown("nominal", s, 0.1, 0.1, "lemniscate") for s in (1, 2, 3)]
    )
    assert lines[0]["E_xy_sd"] == pytest.approx(0.1)
    assert lines[1]["E_xy_sd"] == pytest.approx(0.0)


def test_the_verb_trains_each_once_and_prints_seed_and_configuration(
    tmp_path, monkeypatch, capsys, in_this_process
):
    def load(name, vehicle=None, reality=None):
        config = load_experiment(name, vehicle, reality)
        config.duration, config.reference.ramp = (
            (6.0, 1.5) if name == "training_circle" else (0.5, 1.0)
        )
        return config

    monkeypatch.setattr(tracking, "load_experiment", load)
    table, metrics, models = tmp_path / "table.md", tmp_path / "table.json", tmp_path / "models"
    only = ["--only", "np: lifted", "--only", "np: paper"]
    arguments = [
        "reproduce",
        "configurations",
        "--seeds",
        "1",
        "--seed",
        "40",
        "--jobs",
        "1",
        *only,
    ]
    files = ["--markdown", str(table), "--json", str(metrics), "--out", str(models)]
    assert run([*arguments, *files]) == 0, capsys.readouterr().err
    out = capsys.readouterr().out
    rows = [
        line.split(" | ")[1] for line in table.read_text().splitlines() if line.startswith("| ")
    ]
    assert rows == ["controller", *2 * ["nominal", "np: lifted", "np: paper"]]
    assert sorted(p.name for p in models.glob("*.safetensors")) == [
        f"{n}_training_circle.safetensors" for n in ("lifted", "paper")
    ]
    content = json.loads(metrics.read_text())
    assert content["config"]["configurations"]["paper"]["width"] == make_config("paper").width
    assert {place["row"] for place in content["ranking"]} == {"nominal", "np: lifted", "np: paper"}
    below = out[out.index("training: training_circle, seed 40; evaluation: seeds [41]") :]
    assert "lifted: LiftedConfig(" in below


@pytest.mark.parametrize(
    "frame, step, message",
    [
        ("body", 0.02, "must be trained on wrenches in world axes; its are in body axes"),
        (
            "world",
            0.0025,
            "step must equal the period; got 0.0025, 0.02 [s]. Train it with --step 0.02.",
        ),
    ],
)
def test_what_does_not_fit_the_flight_is_refused_in_one_line(
    frame, step, message, tmp_path, capsys
):
    noise = np.random.default_rng(0).standard_normal((200, 12))
    model = train([Segment(noise[:, :6], noise[:, 6:], step)], make_config("paper", epochs=1)).model
    save_model(with_origin(model, {"frame": frame}), tmp_path / "np.safetensors")
    assert run(["fly", "circle", "--predictor", str(tmp_path / "np.safetensors")]) == 2
    error = capsys.readouterr().err.splitlines()
    assert len([line for line in error if line.startswith("np-drake")]) == 1
    assert message in error[-1]
