"""Vehicles with withheld effects, the simulators that they fly in, and the flights that are
diagnosed.
"""

import dataclasses as dc
from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

from diagrams.challenge.generate.composition import compatible
from diagrams.challenge.generate.magnitudes import draw_effect
from diagrams.challenge.simulators.rotorpy import optional_import
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import fly
from diagrams.loop.reality import DRAKE, RealityConfig, RealVehicle
from np_drake.effects.effect_entry import EffectEntry
from np_drake.flight_log import FlightLog
from np_drake.vehicle import Vehicle

# Effects that a controller feels and that a flight of 20 s can hold; sensor errors are left to the
# challenge.
WITHHELD = (
    *("suspended_payload", "mass_error", "thrust_scale", "thrust_drift", "weak_rotor"),
    *(
        "center_of_mass_offset",
        "motor_lag",
        "command_delay",
        "linear_drag",
        "quadratic_drag",
        "constant_wind",
    ),
)
MOST = 3  # effects of a vehicle [1]
TRAINING = (
    ("training_circle", 20.0),
    ("lemniscate", 20.0),
)  # flights for the fit, and their scored time [s]
HELD_OUT = ("fast_lemniscate", 10.0)
DITHER = [0.08, 0.08, 0.04]  # RMS on every flight that is diagnosed, as on the training circle [m]
FLOWN_WITH = "hold"  # controller that needs no model, so that a vehicle as it came can be flown


SIMULATORS = ("drake", "rotorpy")


def real_vehicle(simulator: str) -> RealVehicle:
    """Return the maker of the real vehicle, in rotorpy with that simulator's own physics."""
    return optional_import.foreign_vehicle(own=True) if simulator == "rotorpy" else DRAKE


def simulator_settings(simulator: str) -> dict[str, Any]:
    """Return all of the simulator that results depend on.

    Raises: ValueError: where it is unknown, or its package is not installed.
    """
    if simulator not in SIMULATORS:
        raise ValueError(
            f"closing: simulator must be one of {', '.join(SIMULATORS)}; got {simulator!r}."
        )
    if simulator == "drake":
        return {"name": simulator}
    physics = optional_import.own_physics()  # first, for it says what to install
    return {"name": simulator, "version": version("rotorpy"), "own_physics": physics}


def withheld_reality(seed: int, vehicle: Vehicle) -> RealityConfig:
    """Draw one to `MOST` effects that act at different places and can be told apart."""
    rng = np.random.default_rng([seed, 40])
    count = int(rng.integers(1, MOST + 1))
    while True:
        names = tuple(rng.choice(WITHHELD, count, replace=False).tolist())
        if count == 1 or compatible(names):
            break
    effects = [
        effect for name in names for effect in draw_effect(name, rng, vehicle, sum(TRAINING[0][1:]))
    ]
    return dc.replace(
        RealityConfig().nominal(), effects=[EffectEntry.of(effect) for effect in effects]
    )


def experiment(
    name: str, reality: RealityConfig, vehicle: Vehicle, *, solver: str, seconds: float
) -> FlightConfig:
    """Return an experiment of the package in another reality.

    Args:
        seconds: length of the flight after the ramp [s].
    """
    config = load_experiment(name, vehicle)
    config.controller.solver = solver
    return dc.replace(config, reality=reality, duration=seconds).check_and_step()


def diagnosed_flights(
    reality: RealityConfig,
    vehicle: Vehicle,
    *,
    solver: str,
    seed: int,
    real: RealVehicle = DRAKE,
    training: Sequence[tuple[str, float]] = TRAINING,
    held_out: tuple[str, float] = HELD_OUT,
) -> tuple[list[FlightLog], list[FlightLog]]:
    """Fly training and held-out flights, and return their logs.

    Args:
        training: experiments for the fit, and their scored time [s].
        held_out: experiment that judges, and its scored time [s].

    Raises: LostVehicle: if one fails.
    """
    logs = []
    for k, (name, seconds) in enumerate((*training, held_out)):
        config = experiment(name, reality, vehicle, solver=solver, seconds=seconds)
        config.controller.kind, config.reference.dither = FLOWN_WITH, DITHER
        log = fly(config, seed=10 * seed + k, real=real).log()
        logs.append(dc.replace(log, name=f"{name}.csv"))
    return logs[: len(training)], logs[len(training) :]
