"""Laws of a controller of the user's own."""

import functools
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.framework import LeafSystem

from diagrams.batch.run import FailedRun
from diagrams.cli.main import run
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import load_flight
from diagrams.loop.flight_result import LostVehicle, fly
from diagrams.loop.own_controller import load_factory
from tests.diagrams.loop.conftest import short

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
"""


@pytest.fixture
def mine(tmp_path, monkeypatch):
    """Scenario without payload, beside the file of the class `Hover`."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(HOVER)
    (tmp_path / "mine.yaml").write_text(
        "name: mine\nduration: 0.3\nreference: {track: hover, ramp: 0.2}\n"
        "reality: {payload: {tether: none}, thrust_scale: 1.0}\n"
        "controller: {kind: 'mine:Hover', parameters: {height: 1.7}}\n"
    )
    return str(tmp_path / "mine.yaml")


def test_a_factory_flies_as_the_scenario_that_names_it(mine):
    named, given = load_flight(mine), load_flight(mine)
    given.controller.kind, given.controller.parameters = "nominal", {}
    factory = functools.partial(load_factory("mine:Hover"), height=1.7)
    flights = [fly(named, seed=2), fly(given, seed=2, controller=factory)]
    assert [flight.label for flight in flights] == ["Hover", "Hover"]
    np.testing.assert_array_equal(*(flight.signals["x_true"] for flight in flights))
    x, mass = flights[0].signals["x"], named.vehicle.mass
    lift = mass * (9.81 + 4.0 * (1.7 - x[:, 2]) - 4.0 * x[:, 9])
    # [N]; a microsecond of motion
    np.testing.assert_allclose(flights[0].signals["u"][:, 0], lift, atol=1e-4)


class Discrete(LeafSystem):
    """Hovering thrust in a discrete state, which counts its updates."""

    def __init__(self, vehicle, reference, period):
        super().__init__()
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
    u = fly(short("hover", ramp=0.0, duration=0.4), controller=Discrete).signals["u"][:, 0]
    np.testing.assert_allclose(np.diff(u), 4e-3, atol=1e-9)  # [N]


@pytest.mark.parametrize("crash", [ZeroDivisionError("by nothing"), SystemExit("by nothing"), None])
def test_a_controller_that_fails_in_flight_ends_it_in_one_line(crash):
    class Bad(Discrete):
        def _calc_u(self, context, output):
            if crash is not None:
                raise crash
            output.SetFromVector(np.full(4, np.nan))

    said = f"failed at 0.0.* s: {type(crash).__name__}: by nothing" if crash else "is not a number"
    with pytest.raises(FailedRun if crash else LostVehicle, match=f"Bad .*{said}"):
        fly(load_experiment("hover"), controller=Bad)


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
        (ports({"state": 13}, {"u": 4}), "has an input port state; known are x, acceleration"),
        (ports({"x": 12}, {"u": 4}), "input port x must have size 13; got 12"),
        (ports({}, {"u": 4})(), "must be a class or function that makes a new system each flight"),
        (lambda: 3, "must make a Drake system; it made a int"),
        (lambda: {}["gain"], "cannot be made: KeyError: 'gain'"),
        (lambda: sys.exit(0), "cannot be made: SystemExit: 0"),
    ],
)
def test_a_controller_that_does_not_fit_is_refused_in_one_line(factory, said):
    with pytest.raises(ValueError, match=said) as refused:
        fly(load_experiment("hover"), controller=factory)
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize(
    "kind, said",
    [
        ("mine:Hoover", "mine.py has no Hoover"),
        ("mine.py:wrong", "controller wrong: must make a Drake system"),
        ("broken.py:Hover", "broken.py cannot be imported: SyntaxError"),
        ("leaves.py:Hover", "leaves.py cannot be imported: SystemExit: 0"),
        (":Hover", "must be MODULE:NAME or FILE.py:NAME"),
    ],
)
def test_a_name_that_leads_nowhere_is_one_line(kind, said, mine, capsys):
    Path("broken.py").write_text("class Hover(:\n")
    Path("leaves.py").write_text("raise SystemExit(0)\n")
    assert run(["fly", "circle", "--controller", kind, "--out", "out"]) == 2
    assert said in capsys.readouterr().err
    assert not Path("out").exists()
    Path(mine).write_text(Path(mine).read_text().replace("height: 1.7", "hight: 1.7"))
    with pytest.raises(ValueError, match="controller Hover: has no parameter hight; it has height"):
        fly(load_flight(mine))


def test_an_own_controller_has_row_log_figures_and_replay_in_any_reality(mine, capsys):
    files = ["--reality", "mine.yaml", "--out", "o", "--json", "j.json"]
    assert run(["fly", "mine.yaml", "--controller", "mine:lean", *files]) == 0
    names = {path.name.removeprefix("mine_lean") for path in Path("o").iterdir()}
    assert names == {".csv", "_track.png", "_errors.png", "_wrench.png", "_replay.html"}
    assert "lean" in capsys.readouterr().out
    assert json.loads(Path("j.json").read_text())["metrics"]["solve_failures"] == 0
