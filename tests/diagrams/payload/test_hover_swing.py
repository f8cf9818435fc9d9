"""Laws of the hover experiment."""

import numpy as np
import pytest

from diagrams.batch.failed_run import FailedRun
from diagrams.batch.flown import FlownRun
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight_result import fly
from diagrams.payload import hover_swing
from diagrams.payload.figures import payload_distance
from diagrams.payload.hover_study import verdict


def made_run(row, seed, error, rate, settling=5.0):
    figures = (error, 2.0 * error, 0.8 * error, 0.5 * error, 0.1 * error, 0.32, rate, settling)
    values = dict(zip(hover_swing.KEYS, figures, strict=True))
    t = np.linspace(0.0, 20.0, 50)
    metrics = {**values, "solve_failures": 1, "fallbacks": 0}
    return {"row": row, "seed": seed, "metrics": metrics, "course": (t, 0.3 * np.exp(rate * t))}


def made_runs():
    rows = (
        ("nominal", 0.04, -0.15, 11.0),
        ("hold", 0.02, 0.02, np.inf),
        ("np", 0.005, 0.0005, np.inf),
    )
    rows += ((hover_swing.DAMPED, 0.02, -0.4, 5.0),)
    return [
        made_run(n, s, e, r + 0.001 * s, settle) for n, e, r, settle in rows for s in (-1, 0, 1)
    ]


def test_only_the_damped_rows_depart_from_the_frozen_weights():
    frozen = load_experiment("hover").controller.mpc
    for row in hover_swing.ROWS:
        mpc = hover_swing.hover_config(row, solver="sqp", model="a file").controller.mpc
        assert (mpc == frozen) == (row.name not in (hover_swing.DAMPED, hover_swing.FILTER_DAMPED))
    assert frozen.weight_swing == 0.0


def test_the_table_holds_means_intervals_and_cuts():
    lines = {line["row"]: line for line in hover_swing.hover_table(made_runs())}
    assert lines["np"]["position_rmse_cut"] == pytest.approx(1 - 0.005 / 0.04)
    assert lines["nominal"]["rate_ci95"] == pytest.approx(
        4.303 * 0.001 / np.sqrt(3), rel=1e-3
    )  # Student, 2 degrees
    assert lines["hold"]["settling"] == np.inf
    assert lines["np"]["solve_failures"] == 3


def test_a_swing_grows_only_where_its_interval_is_above_zero():
    said = verdict(hover_swing.hover_table(made_runs()))
    assert "cut by 87.5 %" in said[0]
    assert f"nominal decays, hold grows, np neither, {hover_swing.DAMPED} decays." in said[1]
    assert said[2].endswith("with: hold.")
    assert "after 5.0 s, nominal after 11.0 s" in said[3]


def test_a_lost_vehicle_is_an_infinite_error_and_loses_no_other_flight(
    monkeypatch, in_this_process, tmp_path
):
    def lose(*_, **__):
        raise FailedRun("hover: nominal lost the vehicle before 6.0 s.")

    monkeypatch.setattr(hover_swing, "fly_hover", lose)
    runs = hover_swing.run_hover(FlownRun(0, tmp_path, count=2), hover_swing.ROWS[:1])
    assert [run["metrics"]["position_rmse"] for run in runs] == [np.inf, np.inf]
    assert "lost the vehicle" in runs[0]["lost"]
    assert hover_swing.hover_table(runs)[0]["position_rmse"] == np.inf


def test_the_impulse_swings_the_payload_by_the_height_its_energy_reaches():
    config = hover_swing.hover_config(hover_swing.ROWS[0], solver="sqp")
    config.reference.ramp, config.duration, config.events[0].time = 0.4, 0.8, 0.4
    flight = fly(config, seed=1)
    found = hover_swing.hover_metrics(flight)
    rise = (0.3 / 0.26) ** 2 / (2 * 9.81)
    fixed = np.sqrt(0.8**2 - (0.8 - rise) ** 2)  # from a fixed point [m]
    assert found["amplitude"] == pytest.approx(fixed, rel=0.05)  # the vehicle gives way
    assert found["amplitude"] > 0.3  # [m], as the experiment asks
    assert found["solve_failures"] == 0


def test_early_and_late_errors_make_up_the_whole():
    config = hover_swing.hover_config(hover_swing.ROWS[0], solver="sqp")
    config.reference.ramp, config.duration, config.events[0].time = 0.4, 0.8, 0.4
    flight = fly(config, seed=1)
    early = 0.2  # [s]
    found = hover_swing.hover_metrics(flight, early)
    share = np.mean(hover_swing.swing_course(flight)[0] < early)
    whole = share * found["early"] ** 2 + (1 - share) * found["late"] ** 2
    assert found["position_rmse"] == pytest.approx(np.sqrt(whole), rel=1e-12)


def test_the_figure_has_a_line_for_every_controller_that_came_home():
    runs = made_runs()
    runs[0]["course"] = runs[1]["course"] = runs[2]["course"] = None
    figure = payload_distance(runs, "title")
    named = [[text.get_text() for text in ax.get_legend().get_texts()] for ax in figure.axes]
    assert named == [["hold"], ["np", hover_swing.DAMPED]]
