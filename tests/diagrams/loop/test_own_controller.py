"""Laws of a controller of the user's own."""

import dataclasses as dc
import functools
import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator
from pydrake.systems.framework import LeafSystem

from diagrams.batch.failed_run import FailedRun
from diagrams.cli.main import run
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import load_flight
from diagrams.loop.flight_diagram import make_flight_diagram, recorded, set_initial_state
from diagrams.loop.flight_result import LostVehicle, fly
from diagrams.loop.own_controller import load_factory
from np_drake.vehicle.vehicle import RateLoop

EXAMPLE = Path(__file__).parents[3] / "docs" / "examples" / "own_controller.py"
HOVER = """\
from pydrake.systems.framework import LeafSystem


class Hover(LeafSystem):
    def __init__(self, vehicle, height=1.6):
        super().__init__()
        self._vehicle, self._height = vehicle, height
        self._x = self.DeclareVectorInputPort("x", 13)
        self.DeclareVectorOutputPort("u", 4, self._calc_u)

    def _calc_u(self, context, output):
        x = self._x.Eval(context)
        lift = self._vehicle.mass * (9.81 + 4.0 * (self._height - x[2]) - 4.0 * x[9])
        output.SetFromVector([lift, *(-self._vehicle.J @ (100.0 * x[4:7] + 14.0 * x[10:13]))])


def lean(vehicle):
    return Hover(vehicle, 1.0)


def wrong():
    return 3


text = "no controller"
"""


@pytest.fixture
def hover(tmp_path):
    """The class `Hover`, of a file beside a scenario without payload."""
    (tmp_path / "mine.py").write_text(HOVER)
    (tmp_path / "mine.yaml").write_text(
        "name: mine\nduration: 0.6\nreference: {track: hover, ramp: 0.2}\n"
        "reality: {payload: {tether: none}, thrust_scale: 1.0}\n"
        "controller: {kind: 'mine:Hover', parameters: {height: 1.7}}\n"
    )
    spec = importlib.util.spec_from_file_location("mine", tmp_path / "mine.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Hover


def test_a_flight_by_a_factory_is_that_of_the_scenario_that_names_it(hover, tmp_path):
    named = load_flight(str(tmp_path / "mine.yaml"))
    given = load_flight(str(tmp_path / "mine.yaml"))
    given.controller.kind, given.controller.parameters = "nominal", {}
    flights = [
        fly(named, seed=2),
        fly(given, seed=2, controller=functools.partial(hover, height=1.7)),
    ]
    assert [flight.label for flight in flights] == ["Hover", "Hover"]
    assert flights[0].signals["u"][-1, 0] > 5.0  # [N]
    np.testing.assert_array_equal(*(flight.signals["x_true"] for flight in flights))


def test_the_diagram_of_a_factory_is_the_flight(hover, tmp_path):
    config = load_flight(str(tmp_path / "mine.yaml"))
    config.controller.parameters = {}
    diagram = make_flight_diagram(config, controller=hover)
    simulator = Simulator(diagram)
    ApplySimulatorConfig(config.simulator, simulator)
    set_initial_state(diagram, simulator.get_mutable_context(), config, seed=1)
    simulator.AdvanceTo(config.end + 0.01)
    plain = recorded(diagram, simulator.get_context())
    np.testing.assert_allclose(
        plain["u"], fly(config, seed=1, controller=hover).signals["u"], atol=1e-9, rtol=0
    )


def test_the_parameters_of_the_scenario_reach_the_controller(hover, tmp_path):
    config = load_flight(str(tmp_path / "mine.yaml"))
    config.duration = 4.0
    assert abs(fly(config, seed=0).signals["x_true"][-1, 2] - 1.7) < 0.02  # [m]; the sensors' noise


def test_the_command_is_held_from_row_to_row(hover, tmp_path):
    config = load_flight(str(tmp_path / "mine.yaml"))
    signals = fly(config, seed=0).signals
    vehicle, x = config.vehicle, signals["x"]
    lift = vehicle.mass * (9.81 + 4.0 * (1.7 - x[:, 2]) - 4.0 * x[:, 9])
    np.testing.assert_allclose(signals["u"][:, 0], lift, atol=1e-4)  # [N]; a microsecond of motion


class Discrete(LeafSystem):
    """Hovering thrust in a discrete state, which counts its updates."""

    def __init__(self, vehicle, reference, period):
        super().__init__()
        self.vehicle = vehicle
        self.DeclareDiscreteState(vehicle.hover_input)
        self.DeclarePeriodicDiscreteUpdateEvent(0.25 * period, 0.0, self._update)
        self.DeclareVectorInputPort("flat", 15 * 5)
        self.DeclareVectorOutputPort("u", 4, self._calc_u, {self.xd_ticket()})
        self.height = float(reference.sample(np.zeros(1))[0, 0, 2])

    def _update(self, context, state):
        points = self.GetInputPort("flat").Eval(context).reshape(5, 5, 3)
        assert np.allclose(points[0, :, 2], self.height)
        state.set_value(0, context.get_discrete_state(0).value() + [1e-3, 0, 0, 0])

    def _calc_u(self, context, output):
        output.SetFromVector(context.get_discrete_state(0).value())


def test_a_discrete_controller_runs_at_its_own_rate_over_a_horizon():
    config = load_experiment("hover")
    config.duration, config.reference.ramp = 0.4, 0.0
    u = fly(config, seed=0, controller=Discrete).signals["u"][:, 0]
    np.testing.assert_allclose(np.diff(u), 4e-3, atol=1e-9)  # [N]


@pytest.mark.parametrize("crash", [ZeroDivisionError("by nothing"), None])
def test_a_controller_that_fails_in_flight_ends_it_in_one_line(crash):
    class Bad(Discrete):
        def _calc_u(self, context, output):
            if crash is not None:
                raise crash
            output.SetFromVector(np.full(4, np.nan))

    config = load_experiment("hover")
    said = (
        "Bad failed at 0.0.* s: ZeroDivisionError: by nothing"
        if crash
        else "Bad commanded what is not a number"
    )
    with pytest.raises(FailedRun if crash else LostVehicle, match=said):
        fly(config, seed=0, controller=Bad)


def ports(inputs, outputs):
    """A factory of a system with these ports."""

    def make():
        system = LeafSystem()
        for name, size in inputs.items():
            system.DeclareVectorInputPort(name, size)
        for name, size in outputs.items():
            system.DeclareVectorOutputPort(name, size, lambda context, output: None)
        return system

    return make


@pytest.mark.parametrize(
    "factory, said",
    [
        (ports({}, {}), "must have an output port u of 4"),
        (ports({}, {"u": 3}), "output port u must have size 4; got 3"),
        (ports({"state": 13}, {"u": 4}), "has an input port state; known are x, acceleration"),
        (ports({"x": 12}, {"u": 4}), "input port x must have size 13; got 12"),
        (
            ports({"flat": 16}, {"u": 4}),
            "input port flat must have size 15 times the points of a horizon; got 16",
        ),
        (ports({}, {"u": 4})(), "must be a class or function that makes a new system each flight"),
        ("np", "must be a class or function; got 'np'. Name it in config.controller.kind"),
        (lambda: 3, "must make a Drake system; it made a int"),
        (lambda: {}["gain"], "cannot be made: KeyError: 'gain'"),
    ],
)
def test_a_controller_that_does_not_fit_is_refused_in_one_line(factory, said):
    with pytest.raises(ValueError, match=said) as refused:
        fly(load_experiment("hover"), controller=factory)
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize(
    "kind, said",
    [
        ("mine:Hoover", "mine.py has no Hoover; did you mean Hover"),
        ("mine.py:wrong", "controller wrong: must make a Drake system"),
        ("mine.py:text", "mine.py:text must be a class or a function; got str"),
        ("nowhere:Hover", "there is no nowhere.py beside the scenario or in the current folder"),
        ("nowhere.py:Hover", "there is no file nowhere.py"),
        ("broken.py:Hover", "broken.py cannot be imported: SyntaxError"),
        (
            "lacks.py:Hover",
            "lacks.py cannot be imported: ModuleNotFoundError: No module named 'there'",
        ),
        (":Hover", "must be MODULE:NAME or FILE.py:NAME"),
    ],
)
def test_a_name_that_leads_nowhere_is_one_line(kind, said, hover, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("broken.py").write_text("class Hover(:\n")
    Path("lacks.py").write_text("from .there import Hover\n")
    assert run(["fly", "circle", "--controller", kind, "--out", "out"]) == 2
    assert said in capsys.readouterr().err
    assert not Path("out").exists()


@pytest.mark.parametrize(
    "kind", ["systems.flown.mine:Up", "systems/flown/mine.py:Up", "systems:Up", "bare.mine:Up"]
)
def test_a_class_in_a_package_with_relative_imports_loads(kind, hover, tmp_path, monkeypatch):
    files = {  # the package has the name of an installed one, and `bare` is none
        "systems/__init__.py": "from .flown import Up\n",
        "systems/flown/__init__.py": "from .mine import Up\n",
        "systems/flown/mine.py": (
            "from ..base import Hover\nfrom . import gain\n\n\nclass Up(Hover):\n    pass\n"
        ),
        "systems/flown/gain.py": "",
        "systems/base.py": HOVER,
        "bare/mine.py": "from .base import Hover as Up\n",
        "bare/base.py": HOVER,
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    scenario = tmp_path / "mine.yaml"
    scenario.write_text(scenario.read_text().replace("mine:Hover", kind))
    assert fly(load_flight(str(scenario))).label == "Up"
    monkeypatch.chdir(tmp_path)
    assert load_factory(kind).__name__ in ("Up", "Hover")


def test_an_unknown_parameter_is_refused_with_those_there_are(hover, tmp_path, capsys):
    scenario = tmp_path / "mine.yaml"
    scenario.write_text(scenario.read_text().replace("height: 1.7", "hight: 1.7"))
    assert run(["fly", str(scenario)]) == 2
    assert "controller Hover: has no parameter hight; it has height." in capsys.readouterr().err


def test_parameters_are_for_controllers_of_ones_own(tmp_path, capsys):
    (tmp_path / "np.yaml").write_text("controller: {kind: np, parameters: {gain: 1.0}}\n")
    assert run(["fly", str(tmp_path / "np.yaml")]) == 2
    assert "parameters are of one of your own" in capsys.readouterr().err


def test_an_own_controller_has_row_log_figures_and_replay_in_any_reality(
    hover, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    words = [
        "--controller",
        "mine:lean",
        "--reality",
        "mine.yaml",
        "--duration",
        "0.3",
        "--out",
        "o",
        "--json",
        "j.json",
    ]
    assert run(["fly", "mine.yaml", *words]) == 0
    names = {path.name.removeprefix("mine_lean") for path in Path("o").iterdir()}
    assert names == {".csv", "_track.png", "_errors.png", "_wrench.png", "_replay.html"}
    assert "lean" in capsys.readouterr().out
    assert json.loads(Path("j.json").read_text())["metrics"]["solve_failures"] == 0


def test_the_example_flies_the_height_better_than_nominal_mpc():
    config = load_experiment("circle")
    config.duration = 1.0
    config.controller.kind = f"{EXAMPLE}:Feedback"
    own = fly(config, seed=1)
    assert own.metrics()["E_z"] < 0.01  # [m]; nominal MPC has 0.035
    assert own.metrics()["E_xy"] < 0.15
    assert own.wrench_label is not None


class Rates(LeafSystem):
    """Holds a height by collective thrust, and turns level."""

    def __init__(self, vehicle, period):
        super().__init__()
        self._vehicle = vehicle
        self._x = self.DeclareVectorInputPort("x", 13)
        self.DeclareVectorOutputPort("rates_thrust", 4, self._calc_rates_thrust)

    def _calc_rates_thrust(self, context, output):
        x = self._x.Eval(context)
        lift = self._vehicle.mass * (9.81 + 4.0 * (1.6 - x[2]) - 4.0 * x[9])
        output.SetFromVector([lift, *(-6.0 * x[4:7])])


def with_rate_loop():
    config = load_experiment("hover")
    config = dc.replace(
        config, duration=2.0, vehicle=dc.replace(config.vehicle, rate_loop=RateLoop())
    )
    return config.with_autopilot("rate_loop")


def test_one_that_commands_body_rates_flies_an_autopilot():
    flown = fly(with_rate_loop(), seed=1, controller=Rates)
    assert flown.metrics()["E_z"] < 1.0  # of a payload that it does not know
    np.testing.assert_allclose(flown.log().commanded_rates, -6.0 * flown.log().q[:, 1:], atol=0.05)


def test_one_that_commands_torque_is_refused_by_an_autopilot(hover):
    with pytest.raises(ValueError, match="must have an output port rates_thrust"):
        fly(with_rate_loop(), seed=1, controller=hover)
