"""Laws of the robustness sweep; the flights of the verb are made here."""

import json
from functools import partial

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.loop.experiments import load_experiment
from diagrams.loop.reality import RealityConfig
from diagrams.robustness import robustness
from diagrams.robustness.axes import BASE, FLOWN
from diagrams.robustness.figure import robustness_figure
from diagrams.robustness.measures import measures
from diagrams.robustness.robustness import ROWS, Flying, Sweep, flight_cases, flight_config
from diagrams.robustness.table import better_than, lost_lines, robustness_table
from diagrams.tracking import tracking
from np_drake.effects.base import Motion
from np_drake.effects.combine import total_wrench
from np_drake.vehicle import Vehicle

MODELS = {row.configuration: b"a model file" for row in ROWS if row.configuration}


def point(value, e_xy):
    return {"value": value, "E_xy": e_xy}


def test_an_error_crosses_nominals_on_the_line_of_log_ratios():
    base = [point(v, 1.0) for v in (0.0, 1.0, 2.0, 4.0)]
    dut = [point(0.0, 0.5), point(1.0, 0.5), point(2.0, 2.0), point(4.0, 0.5)]
    assert better_than(dut, base, "E_xy") == [(0.0, pytest.approx(1.5)), (pytest.approx(3.0), 4.0)]


def test_no_line_leads_to_a_lost_flight():
    base = [point(v, 1.0) for v in (0.0, 1.0, 2.0)]
    dut = [point(0.0, 2.0), point(1.0, 0.5), point(2.0, None)]
    assert better_than(dut, base, "E_xy") == [(pytest.approx(0.5), 1.0)]
    assert better_than(base, dut, "E_xy") == [
        (0.0, pytest.approx(0.5)),
        (2.0, 2.0),
    ]  # who flies is better
    assert better_than([point(0.0, None)], [point(0.0, None)], "E_xy") == []


def test_every_value_flies_once_a_row_and_seed_and_the_base_is_shared():
    cases = flight_cases(ROWS, [1, 2], MODELS)
    settings = {tuple(case[axis.name] for axis in FLOWN) for case in cases}
    assert len(settings) == 1 + sum(len(axis.values) - 1 for axis in FLOWN)
    assert len(cases) == len({json.dumps(case) for case in cases}) == 2 * len(ROWS) * len(settings)
    for axis in FLOWN:
        assert axis.base in axis.values == tuple(sorted(axis.values))
        assert {case[axis.name] for case in cases} == set(axis.values)
    digests = {case["row"]: case["model"] for case in cases}
    assert digests["np"] == digests["gp"] != "" == digests["hold"]


def test_rows_fly_the_same_vehicle_weights_and_draws():
    case = {"seed": 7, **BASE, "wind": 4.0, "noise": 2.0}
    configs = [flight_config({"row": row.name, **case}, solver="sqp", model="x") for row in ROWS]
    for config in configs:
        assert config.reality == configs[0].reality
        assert config.reference == configs[0].reference
        assert config.controller.mpc == configs[0].controller.mpc
    assert configs[0].reality.noise.position == pytest.approx(2 * RealityConfig().noise.position)
    assert (configs[0].reality.wind, configs[0].reality.gust) == ([4.0, 0.0, 0.0], 1.0)
    assert configs[0].reality.gust_seed == 7


def test_slow_motors_are_told_to_nobody():
    config = flight_config({"row": "np", "seed": 1, **BASE, "lag": 0.05}, solver="sqp", model="x")
    assert config.reality.motor_lag == 0.05  # [s]
    assert config.vehicle.rotor_time_constant == 0.0


@pytest.mark.parametrize(
    ("axis", "value", "field"), [("delay", 0.045, "command_delay"), ("loss", 0.006, "thrust_loss")]
)
def test_delay_and_battery_are_told_to_nobody(axis, value, field):
    config = flight_config({"row": "np", "seed": 1, **BASE, axis: value}, solver="sqp", model="x")
    base = flight_config({"row": "np", "seed": 1, **BASE}, solver="sqp", model="x")
    assert getattr(config.reality, field) == value
    assert config.controller == base.controller
    assert config.vehicle == base.vehicle


def test_gusts_alone_have_no_mean_and_a_wind_brings_its_own():
    gusty = flight_config({"row": "nominal", "seed": 5, **BASE, "gust": 1.5}, solver="sqp").reality
    assert (gusty.wind, gusty.gust, gusty.gust_seed) == ([0.0, 0.0, 0.0], 1.5, 5)


def test_a_gain_multiplies_the_thrust():
    strong = flight_config({"row": "nominal", "seed": 1, **BASE, "gain": 1.5}, solver="sqp").reality
    assert strong.thrust_scale == pytest.approx(1.5 * RealityConfig().thrust_scale)


def test_no_mass_is_no_payload_and_tells_nothing():
    config = flight_config(
        {"row": "hold + total mass", "seed": 1, **BASE, "mass": 0.0}, solver="sqp"
    )
    assert config.reality.payload.tether == "none"
    assert config.controller.extra_mass == 0.0
    heavy = flight_config(
        {"row": "hold + total mass", "seed": 1, **BASE, "mass": 0.5}, solver="sqp"
    )
    assert heavy.controller.extra_mass == heavy.reality.payload.mass == 0.5


@pytest.mark.parametrize("axis", FLOWN, ids=lambda axis: axis.name)
def test_every_value_can_be_flown(axis):
    for value in axis.values:
        assert flight_config(
            {"row": "oracle", "seed": 1, **BASE, axis.name: value}, solver="sqp"
        ).check()


def test_wind_pushes_a_resting_body_with_its_drag():
    effects = RealityConfig(wind=[4.0, 0.0, 0.0]).check().wrench_effects()
    vehicle, x = Vehicle(), np.zeros(13)
    x[3] = 1.0
    thrust = np.full(4, vehicle.mass * vehicle.gravity / 4)
    chi = total_wrench(vehicle, effects, Motion(0.0, x, thrust))
    np.testing.assert_allclose(chi, [0.25 * 4.0, 0, 0, 0, 0, 0], atol=1e-12)  # [N]; drag 0.25 N·s/m
    assert len(RealityConfig().wrench_effects()) == 1


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"wind": [1.0, 0.0]}, "wind must be 3 numbers, each finite"),
        ({"wind": [np.nan, 0.0, 0.0]}, "wind must be 3 numbers, each finite"),
        ({"gust": -1.0}, "gust must be finite and not negative"),
        ({"gust": 1.0, "rotor_drag": 0.0}, "wind acts through rotor_drag"),
    ],
)
def test_impossible_wind_is_refused(fields, message):
    with pytest.raises(ValueError, match=message):
        RealityConfig(**fields).check()


def test_a_swing_that_doubles_grows_by_two():
    config = flight_config({"row": "nominal", "seed": 1, **BASE}, solver="sqp")
    signals = made_signals(config, 1250)
    third = np.linspace(0.0, 3.0, 750, endpoint=False).astype(int)
    signals["plant_state"][500:, 11] = 0.1 * np.array([1.0, 1.5, 2.0])[third]  # [m], of the payload
    assert measures(config, signals)["swing_growth"] == pytest.approx(2.0)
    signals["plant_state"] = np.zeros((1250, 13))
    assert measures(config, signals)["swing_growth"] is None


def made_signals(config, n):
    """Hover on the reference, nothing saturated."""
    t, x = config.controller.period * np.arange(n), np.zeros((n, 13))
    x[:, 3] = 1.0
    u = np.tile(config.vehicle.hover_input, (n, 1))
    plant = np.zeros((n, 26))
    plant[:, 6], plant[:, 13] = 1.0, 0.2
    zeros = np.zeros((n, 1))
    return {
        "t": t,
        "x_true": x,
        "p_ref": np.zeros((n, 3)),
        "u": u,
        "status": zeros,
        "plant_state": plant,
    }


@pytest.mark.parametrize("far", [1.01, np.nan])
def test_a_vehicle_off_its_reference_is_lost_from_then_on(far):
    config = flight_config({"row": "nominal", "seed": 1, **BASE}, solver="sqp")
    signals = made_signals(config, 1250)
    signals["x_true"][500:, 0] = far
    signals["u"][480:, 0] = 4 * config.vehicle.max_rotor_thrust
    signals["status"][490:] = 9
    dut = measures(config, signals)
    assert dut["lost_at"] == pytest.approx(10.0)
    assert (dut["E_xy"], dut["E_z"], dut["growth"]) == (None, None, None)
    assert dut["solve_failures"] == 10  # what came after the loss does not count
    assert dut["at_limit"] == pytest.approx(20 / 500)
    assert dut["at_limit_last"] == pytest.approx(20 / 50)
    assert dut["thrust"] == pytest.approx(1.0)
    assert dut["swing"] == pytest.approx(0.0)


def test_a_flight_that_the_simulator_ended_is_lost_where_its_signals_end():
    config = flight_config({"row": "nominal", "seed": 1, **BASE}, solver="sqp")
    dut = measures(config, made_signals(config, 300), "the simulation ended before 7.0 s")
    assert dut["lost_at"] == pytest.approx(5.98)
    assert dut["E_xy"] is None
    assert measures(config, made_signals(config, 1250))["lost_at"] is None


def test_a_short_flight_has_figures_and_repeats(monkeypatch):
    def load(name, vehicle, reality=None):
        config = load_experiment(name, vehicle, reality)
        config.reference.ramp = 1.0
        return config

    monkeypatch.setattr(tracking, "load_experiment", load)
    monkeypatch.setattr(robustness, "measures", partial(measures, settling=0.2))
    work, case = Flying({}, "sqp", duration=0.6), {"row": "hold", "seed": 3, **BASE, "wind": 8.0}
    dut = work(case)
    assert dut["lost_at"] is None
    assert 0.0 < dut["E_xy"] < 0.2  # [m]
    assert 0.3 < dut["thrust"] < 1.0
    assert work(case) == dut


@pytest.fixture
def made_flights(monkeypatch):
    """No flight: hold is better than nominal below 2 m/s, and lost at 3 m/s with one seed."""

    def runs(sweep, rows, axes=FLOWN, grid=None):
        records, seeds = [], sweep.seeds
        for case in flight_cases(rows, seeds, MODELS, axes, grid):
            error = 0.02 if case["row"] == "nominal" else 0.01 * case["speed"] / 1.0
            lost = case["row"] == "hold" and case["speed"] == 3.0 and case["seed"] == seeds[0]
            keys = ("E_xy", "E_z", "growth", "swing_growth")
            result = dict.fromkeys(keys, None if lost else error)
            result |= {
                "lost_at": 7.5 if lost else None,
                "lost": "",
                "solve_failures": int(lost),
                "at_limit": 0.1,
            }
            result |= {
                "at_limit_last": 1.0,
                "thrust": 0.5,
                "tilt": 0.3,
                "swing": None,
                "fallbacks": 0,
            }
            records.append({"case": case, "result": result, "seconds": 6.0})
        records[-1] = {"case": records[-1]["case"], "error": "its process died", "seconds": None}
        return [], records

    monkeypatch.setattr(robustness, "run_robustness", runs)


def test_the_verb_prints_limits_errors_and_lost_flights_and_draws(made_flights, tmp_path, capsys):
    files = [
        "--json",
        str(tmp_path / "m.json"),
        "--markdown",
        str(tmp_path / "m.md"),
        "--out",
        str(tmp_path / "o"),
    ]
    assert (
        run(["reproduce", "robustness", "--seed", "40", "--seeds", "2", "--only", "hold", *files])
        == 0
    ), capsys.readouterr().err
    said, page = capsys.readouterr().out, (tmp_path / "m.md").read_text()
    cells = [
        line.strip("| ").split(" | ") for line in page.splitlines() if line.startswith("| speed")
    ]
    assert cells[1][:5] == ["speed [m/s]", "hold", "0.5 … 2", "0.5 … 2", "3 (1 of 2)"]
    assert "| hold | 0.50 ± 0.00 | 1.00 ± 0.00 |" in page
    assert "lost 1 of 2" in page
    assert "hold, speed 3 m/s, seed 41: lost at 7.50 s" in said
    assert "failed: its process died" in said
    assert "seeds 41 … 42, 20 s, trained on seed 40, sqp" in said
    assert "mpc: {'horizon'" in said
    assert (tmp_path / "o" / "robustness.png").stat().st_size > 10000
    content = json.loads((tmp_path / "m.json").read_text())
    assert content["config"]["seeds"] == [41, 42]
    assert {line["axis"] for line in content["table"]} == {axis.name for axis in FLOWN}
    assert len(content["runs"]) == 2 * 2 * 40
    assert content["grid"] == {"points": [], "table": []}


def test_an_axis_that_is_named_is_flown_alone(made_flights, capsys):
    assert run(["reproduce", "robustness", "--seeds", "1", "--axis", "wind"]) == 0
    said = capsys.readouterr().out
    assert "wind: the largest rotor command" in said
    assert "speed: the largest" not in said
    assert run(["reproduce", "robustness", "--axis", "rain"]) == 2
    known = "mass, length, speed, wind, gust, noise, lag, delay, loss"
    assert f"--axis: must be one of {known}; got rain." in capsys.readouterr().err


def test_grid_values_without_a_grid_are_refused(made_flights, capsys):
    assert run(["reproduce", "robustness", "--grid-values", "3"]) == 2
    assert "--grid-values: must come with --grid." in capsys.readouterr().err


def test_a_lost_flight_leaves_no_mean(made_flights):
    _, records = robustness.run_robustness(Sweep(0, count=2), ROWS[:2])
    lines = robustness_table(records)
    speed = next(line for line in lines if (line["axis"], line["row"]) == ("speed", "hold"))
    assert [p["E_xy"] is None for p in speed["points"]] == [False] * 5 + [True]
    assert [p["lost"] for p in speed["points"]] == [0, 0, 0, 0, 0, 1]
    assert len(lost_lines(records)) == 2


def test_the_grid_is_tabled_and_drawn_for_every_neural_predictor(made_flights, tmp_path, capsys):
    thin = ["--axis", "mass", "--grid", "--grid-values", "2", "--only", "np", "--only", "hold"]
    assert (
        run(
            [
                "reproduce",
                "robustness",
                *thin,
                "--out",
                str(tmp_path),
                "--json",
                str(tmp_path / "m"),
            ]
        )
        == 0
    )
    grid = json.loads((tmp_path / "m").read_text())["grid"]
    assert len(grid["points"]) == 3 * (2 + 4)  # rows; points without and with payload
    assert [line["row"] for line in grid["table"]] == ["nominal", "hold", "np"]
    assert (tmp_path / "grid_np.png").stat().st_size > 10000
    assert not (tmp_path / "grid_hold.png").exists()
    assert "against" in capsys.readouterr().out.split()


@pytest.mark.parametrize("count", [1, 5, 6, len(FLOWN)])
def test_the_figure_has_two_panels_for_each_axis(made_flights, count):
    _, records = robustness.run_robustness(Sweep(0, count=1), ROWS[:1], FLOWN[:count])
    figure = robustness_figure(robustness_table(records, FLOWN[:count]))
    named = [ax.get_xlabel().split(" [")[0] for ax in figure.axes if ax.get_xlabel()]
    assert len(figure.axes) == 2 * count
    assert sorted(named) == sorted(axis.title for axis in FLOWN[:count])
