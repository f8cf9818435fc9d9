"""The environment by name and by function."""

import dataclasses as dc
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np

from diagrams.gym.simulator import ActionConfig, Draw, SimulatorPool, TrackingSimulator
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig
from np_drake.control.tracking_task import TrackingTask, task_for
from np_drake.vehicle import load_vehicle

if TYPE_CHECKING:
    from diagrams.gym.environment import TrackingEnv

ID = "np_drake/Track-v0"


def installed() -> bool:
    """Return whether gymnasium is installed."""
    return find_spec("gymnasium") is not None


def _require_gymnasium() -> None:
    if not installed():
        raise ImportError("diagrams.gym: gymnasium must be installed; pip install 'np_drake[gym]'.")


def make_env(
    experiment: str | FlightConfig | Draw,
    *,
    vehicle: str | None = None,
    base: str = "hover",
    authority: float = 1.0,
    task: TrackingTask | None = None,
    period: float | None = None,
    duration: float | None = None,
    simulators: int = 8,
    draw_seed: int = 0,
) -> "TrackingEnv":
    """Return a tracking experiment as a Gymnasium environment.

    The action, four numbers in [-1, 1], is added to the command `base` as [f_u, tau_m] over `command_span`: it is the
    input that flight logs and diagnosis know, zero is the base alone, and thrust and torques are decoupled, where
    each of four rotor thrusts would move all of them.

    Args:
        experiment: name or scenario file, configuration, or function that draws one from a random generator.
        vehicle: vehicle file or preset that flies in place of the scenario's.
        base: hover (the nominal weight) | cascade (the cascaded controller, for which an action is a correction).
        authority: share of the span that an action of one adds [1].
        task: observation and reward; default: that of the paper's vehicle, scaled.
        period: between decisions, a whole multiple of the controller's; default: the controller's [s].
        duration: after the ramp, in place of the experiment's [s].
        simulators: number of configurations that a drawing function is asked for; each reset takes one of them.
        draw_seed: of these draws, another one for other simulators.
    Raises: ImportError: where gymnasium is not installed.   ValueError: on impossible values.
    """
    _require_gymnasium()
    from diagrams.gym.environment import TrackingEnv

    if vehicle is not None and not isinstance(experiment, str):
        raise ValueError("make_env: vehicle must go with the name of an experiment; set config.vehicle instead.")
    action = ActionConfig(base, authority).check()

    draw = experiment if callable(experiment) else _always(experiment, vehicle)

    def shortened(rng: np.random.Generator) -> FlightConfig:
        config = draw(rng)
        return config if duration is None else dc.replace(config, duration=duration)

    def make(config: FlightConfig) -> TrackingSimulator:
        return TrackingSimulator(config, (task or task_for(config.vehicle)).check(), action, period)

    size = simulators if callable(experiment) else 1
    return TrackingEnv(SimulatorPool(shortened, make, size=size, seed=draw_seed))


def _always(experiment: str | FlightConfig, vehicle: str | None) -> Draw:
    """Return the draw that always gives this experiment."""
    if isinstance(experiment, FlightConfig):
        return lambda rng: experiment
    config = load_experiment(experiment, None if vehicle is None else load_vehicle(vehicle))
    return lambda rng: config


def register() -> None:
    """Make `gymnasium.make("np_drake/Track-v0", experiment=…)` known; a second call changes nothing.

    Raises: ImportError: where gymnasium is not installed.
    """
    _require_gymnasium()
    import gymnasium

    if ID not in gymnasium.registry:
        gymnasium.register(ID, entry_point="diagrams.gym.registration:make_env")
