"""The scenarios that the options of `fly` name: one a controller, with the common numbers
changed.
"""

import copy
import dataclasses as dc
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from diagrams.cli import options
from diagrams.cli.output import tell

if TYPE_CHECKING:
    from diagrams.loop.flight import FlightConfig


@dc.dataclass(frozen=True)
class Numbers:
    """Common numbers of a scenario; None: the scenario's own."""

    payload: float | None = None  # mass [kg]
    length: float | None = None  # of the cable [m]
    speed: float | None = None  # along the track [m/s]
    wind: str | None = None  # X, or X,Y,Z in W [m/s]
    duration: float | None = None  # after the ramp [s]

    def applied(self, config: "FlightConfig") -> "FlightConfig":
        """Return the scenario with these numbers.

        Raises: ValueError: on an impossible one.
        """
        from diagrams.loop.experiments import with_payload, with_speed, with_wind

        config = (
            config if self.duration is None else dc.replace(config, duration=self.duration).check()
        )
        if self.payload is not None or self.length is not None:
            config = with_payload(config, mass=self.payload, length=self.length)
            config = config.check_and_step()
        if self.wind is not None:
            config = with_wind(config, _vector(self.wind))
        if self.speed is not None:
            config = with_speed(config, self.speed)
        return config


def _vector(text: str) -> tuple[float, float, float]:
    """Return the wind that a text names.

    Raises: ValueError: where it names none.
    """
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in (1, 3):
        raise ValueError(
            f"--wind: must be a speed along x, as 2, or three, as 2,0,-1 [m/s]; got {text!r}."
        )
    x, y, z = values if len(values) == 3 else [*values, 0.0, 0.0]
    return x, y, z


def scenarios(
    experiment: str,
    controllers: Sequence[str],
    *,
    vehicle: Path | None,
    reality: Path | None,
    solver: str | None,
    predictor: Path | None,
    told_mass: bool,
    autopilot: str | None = None,
    numbers: Numbers,
) -> "list[FlightConfig]":
    """Return a checked scenario for every controller; what cannot be flown is refused before any
    work.

    Args:
        vehicle: file or preset; None: the scenario's.
        solver: None: the scenario's, or the default.
        autopilot: that stands before the rotors; None: the scenario's.
    Raises: ValueError: on bad input.
    """
    from diagrams.loop.experiments import EXPERIMENTS, load_experiment
    from np_drake.vehicle import load_vehicle

    if reality is not None and vehicle is not None:
        raise ValueError("give either --reality, which has a vehicle of its own, or --vehicle.")
    if twice := [kind for kind in controllers if list(controllers).count(kind) > 1]:
        raise ValueError(
            f"--controller: must name each once; {twice[0]} stands {len(twice)} times."
        )
    first = load_experiment(experiment, None if vehicle is None else load_vehicle(vehicle), reality)
    first = numbers.applied(first)
    if autopilot is not None:
        first = _with_autopilot(first, autopilot)
    first.controller.solver = solver or named_solver(experiment) or options.DEFAULT_SOLVER
    if told_mass:
        first.controller.extra_mass = (
            0.0 if first.reality.hung.tether == "none" else first.reality.hung.mass
        )
    kinds = list(controllers)
    if not kinds:
        kinds = (
            [_default_controller(first, predictor)]
            if experiment in EXPERIMENTS
            else [first.controller.kind]
        )
    configs = [_flown_with(first, kind) for kind in kinds]
    if predictor is not None:
        _give(predictor, configs)
    for config in configs:
        _require(config)
    names = [config.controller.name for config in configs]
    if twice := [name for name in names if names.count(name) > 1]:
        raise ValueError(
            f"--controller: two are called {twice[0]}, and so would their files be. Rename one."
        )
    return configs


def _with_autopilot(config: "FlightConfig", kind: str) -> "FlightConfig":
    """Return the scenario with an autopilot, by the loop of a usual tune where the vehicle's file
    names none.
    """
    from np_drake.vehicle.scaling import usual_rate_loop

    config = config.with_autopilot(kind)
    config.autopilot.check()
    if config.autopilot.flies and config.vehicle.rate_loop is None:
        loop = usual_rate_loop(config.vehicle)
        lags = ", ".join(f"{1e3 * lag:.0f}" for lag in loop.lag)
        tell(
            f"vehicle {config.vehicle.name!r} names no rate_loop; lags of {lags} ms are "
            f"taken. identify LOG tells them."
        )
        config = dc.replace(config, vehicle=dc.replace(config.vehicle, rate_loop=loop))
    return config


def _flown_with(config: "FlightConfig", kind: str) -> "FlightConfig":
    """Return a copy of the scenario with a controller; one of another kind has not the parameters
    of the scenario's.
    """
    config = copy.deepcopy(config)
    if kind != config.controller.kind:
        config.controller.parameters, config.controller.predictor = {}, ""
    config.controller.kind = kind
    return config


def _give(predictor: Path, configs: "Sequence[FlightConfig]") -> None:
    """Give a model file to the controller that it is for; others fly the packaged model.

    Raises: ValueError: where none of them flies a model, or this one.
    """
    from diagrams.loop.controller_config import LEARNED
    from diagrams.loop.controllers import kind_of_model

    controllers = [config.controller for config in configs if config.controller.kind in LEARNED]
    if not controllers:
        raise ValueError(f"--predictor: is for {', '.join(LEARNED)}; none of them flies.")
    kind = kind_of_model(str(predictor))
    fits = [one for one in controllers if one.kind == kind]
    if not fits:
        kinds = " and ".join(one.kind for one in controllers)
        raise ValueError(
            f"--predictor: {predictor} is for {kind}; {kinds} cannot fly it. Name "
            f"--controller {kind}."
        )
    fits[0].predictor = str(predictor)


def _require(config: "FlightConfig") -> None:
    """Check the scenario, its model file and a controller of one's own.

    Raises: ValueError: where one does not fit.
    """
    from diagrams.loop.controllers import make_residual_model
    from diagrams.loop.flight_diagram import make_flight_diagram
    from diagrams.loop.own_controller import is_own
    from np_drake.autopilot.betaflight import find_firmware

    config.check()
    if config.autopilot.kind == "betaflight":
        find_firmware()
    make_residual_model(config.controller, config.controller.believed(config.vehicle))
    if is_own(config.controller.kind):
        make_flight_diagram(config)


def _default_controller(config: "FlightConfig", predictor: Path | None) -> str:
    """Return the kind of the model file; without one `np`, or `hold`, which needs no model, and say
    so.

    The packaged model knows the paper's vehicle.
    """
    from diagrams.loop.controllers import kind_of_model, make_residual_model

    if predictor is not None:
        return kind_of_model(str(predictor))
    try:
        make_residual_model(dc.replace(config.controller, kind="np"), config.vehicle)
    except ValueError:
        tell(
            f"controller: hold, as the packaged predictor is for the paper's vehicle and not for "
            f"{config.vehicle.name}; np-drake train LOG makes one of its own."
        )
        return "hold"
    return "np"


def named_solver(experiment: str) -> str | None:
    """Return the solver that a scenario names; None where it names none."""
    from diagrams.loop.experiments import scenario_file
    from np_drake.files.yaml_file import read_yaml

    return (read_yaml(scenario_file(experiment)).get("controller") or {}).get("solver")
