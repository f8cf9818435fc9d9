"""What a delay of commands costs that no training has shown."""

from functools import cache

import pytest

from diagrams.cli.main import run
from diagrams.loop.controller_config import ControllerConfig
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import LostVehicle, fly, simulate
from np_drake.references.config import ReferenceConfig


def late(delay, *, kind="payload_filter", speed=1.5, **controller):
    config = FlightConfig(duration=5.0)
    config.reference = ReferenceConfig(track="circle", radius=1.0, speed=speed, ramp=4.0)
    config.controller = ControllerConfig(kind=kind, solver="sqp", **controller)
    config.reality.command_delay = delay
    return config


@cache
def metrics(delay, **how):
    """Return the metrics of such a flight, which is flown once."""
    return fly(late(delay, **how), seed=0).metrics()


@pytest.mark.parametrize(
    "speed, delay, error", [(1.5, 0.06, 0.012), (1.5, 0.115, 0.02), (2.5, 0.03, 0.012)]
)
def test_the_payload_filter_finds_a_delay_in_flight_and_holds_the_circle(speed, delay, error):
    errors = metrics(delay, speed=speed)
    assert (
        errors["E_xy"] < error
    )  # a fifth of `nominal` without delay, 2.5 and 6.4 cm, with the first seconds [m]
    assert errors["solve_failures"] == 0
    assert errors["command_delay"] == pytest.approx(delay, abs=0.0051)  # a quarter period [s]


@pytest.mark.parametrize("kind", ["nominal", "hold"])
def test_a_controller_that_knows_or_finds_the_delay_holds_on(kind):
    with pytest.raises(LostVehicle):
        simulate(late(0.06, kind=kind), seed=0, tolerance=1.0)
    told = metrics(0.06, kind=kind, command_delay=0.06)
    found = metrics(0.06, kind=kind, track_delay=True)
    assert max(told["E_xy"], found["E_xy"]) < 0.05  # [m]
    assert told["command_delay"] == 0.06
    # The lag is not known to these kinds, so that their estimate is coarser [s].
    assert found["command_delay"] == pytest.approx(0.06, abs=0.01)


def test_a_known_delay_does_not_spoil_the_measure_of_prediction():
    without, delayed = (metrics(delay, speed=1.5)["wrench_rmse"] for delay in (0.0, 0.06))
    assert delayed["force"] < 1.5 * without["force"]


@pytest.mark.parametrize(
    "delay, said",
    [(0.0, None), (0.05, "act 50 ms late"), (0.12, "120 ms late or later, the latest")],
)
def test_fly_says_with_which_delay_its_controller_reckoned(delay, said, tmp_path, capsys):
    scenario = tmp_path / "late.yaml"
    scenario.write_text(
        "name: late\nduration: 0.5\nreference: {track: hover, ramp: 1.0}\n"
        f"controller: {{kind: hold, solver: sqp, command_delay: {delay}}}\nreality: "
        f"{{command_delay: {delay}}}\n"
    )
    assert run(["fly", str(scenario)]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert ("ms late" in printed) == (said is not None)
    assert (said or "") in printed


def test_under_a_delay_the_oracle_stays_the_limit():
    oracle, error = metrics(0.06, kind="oracle")["E_xy"], metrics(0.06, speed=1.5)["E_xy"]
    assert oracle < min(error, 0.004)  # [m]


def test_a_delay_that_no_controller_can_know_is_refused():
    with pytest.raises(ValueError, match="command_delay must be 0 to"):
        late(0.06, command_delay=0.5).check()
    with pytest.raises(ValueError, match="the oracle knows delays up to"):
        late(0.5, kind="oracle").check()
