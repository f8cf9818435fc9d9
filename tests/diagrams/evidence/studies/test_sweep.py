"""Laws of rows, options and the one sweep."""

import json
import math

import pytest

from diagrams.evidence.studies import tracking
from diagrams.evidence.studies.options import fixed, percent, spread
from diagrams.evidence.studies.sweep import FlownRun, Row, choose_rows, configure, fly_rows, tidy
from diagrams.loop.experiments import load_experiment

ROWS = (Row("nominal", "nominal"), Row("hold", "hold"), Row("np", "np"))


def test_nominal_flies_with_every_choice_of_rows():
    assert choose_rows(ROWS, None) == ROWS
    assert [row.name for row in choose_rows(ROWS, ["np"])] == ["nominal", "np"]
    with pytest.raises(ValueError, match="of nominal; hold; np; got pid"):
        choose_rows(ROWS, ["np", "pid"])


@pytest.mark.parametrize("rows", [tracking.ROWS, tracking.HOVER_ROWS])
def test_rows_differ_in_their_controller_alone(rows):
    frozen = load_experiment("circle").controller.mpc
    for row in rows:
        config = configure("circle", row, solver="sqp", model="a file")
        assert config.reality == load_experiment("circle").reality
        assert config.controller.extra_mass == (0.26 if row.known_mass else 0.0)
        damped = row.name in (tracking.DAMPED, tracking.FILTER_DAMPED)
        assert (config.controller.mpc == frozen) == (not damped)


def test_every_row_flies_every_scenario_with_one_model(monkeypatch, in_this_process, tmp_path):
    def train(row, path, *, seed, **world):
        if row.configuration == "knode":
            raise ValueError("does not converge")
        path.write_bytes(f"{row.configuration} {seed}".encode())

    monkeypatch.setattr("diagrams.evidence.studies.sweep.train_row", train)
    learnt = [Row(name, "gp", training="circle", configuration=name) for name in ("gp", "knode")]

    def flight(case, row, model):
        with open(model or __file__, "rb") as file:
            return {"row": row.name, "E_xy": float(case["seed"]), "model": file.read(4).decode()}

    run = FlownRun(3, tmp_path, count=2)
    scenarios = [{"track": track, "seed": seed} for track in ("a", "b") for seed in run.seeds]
    trainings, flights = fly_rows(
        run,
        "flying",
        [ROWS[0], *learnt, Row("gp 2", "gp", training="circle", configuration="gp")],
        scenarios,
        flight,
        config={},
    )
    assert ["error" in record for record in trainings] == [False, True]
    assert [path.name for path in tmp_path.glob("*.safetensors")] == ["gp_circle.safetensors"]
    frame = tidy(flights)
    assert list(frame.groupby("row", sort=False).size().items()) == [
        ("nominal", 4),
        ("gp", 4),
        ("gp 2", 4),
    ]
    assert set(frame.loc[frame["row"] == "gp 2", "model"]) == {"gp 3"}
    json.dumps(flights)


@pytest.mark.parametrize(
    "column, line, text",
    [
        (spread("x"), {"x": 0.0123, "x_ci95": 0.001}, "1.23 ± 0.10"),  # in cm
        (spread("x"), {"x": 0.0123, "x_ci95": math.nan}, "1.23"),  # a single flight
        (spread("x"), {"x": math.inf, "x_ci95": math.nan}, "lost"),
        (spread("x"), {"x": -math.inf, "x_ci95": 0.1}, "lost"),
        (fixed("x", 2), {"x": 0.126}, "0.13"),
        (fixed("x", 2), {}, "–"),
        (percent("x", 1), {"x": 0.126}, "12.6 %"),
        (percent("x"), {}, "–"),
    ],
)
def test_a_column_writes_its_value(column, line, text):
    assert column(line) == text
