"""Trial of a corrected simulator: whether a plain controller keeps its vehicle in the air, and else
what to do.
"""

import dataclasses as dc

from diagrams.gap.corrected import corrected_simulator
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import LostVehicle, fly
from np_drake.diagnosis.report.words import listed
from np_drake.diagnosis.result import Diagnosis
from np_drake.vehicle import Vehicle

TRIED = ("nominal", "hold", "observer")  # controllers without training
SECONDS = 2.0  # of the trial behind its ramp [s]; own choice: what falls has fallen by then


def with_trial(diagnosis: Diagnosis, vehicle: Vehicle) -> Diagnosis:
    """Return the diagnosis, and its second answer, with why nothing flies in its corrected
    simulator, if so.
    """
    if diagnosis.cannot_tell:
        return diagnosis
    second = None if diagnosis.refit is None else with_trial(diagnosis.refit, vehicle)
    return dc.replace(diagnosis, refit=second, not_flyable=_why_not(diagnosis, vehicle))


def _why_not(diagnosis: Diagnosis, vehicle: Vehicle) -> str:
    try:
        config = corrected_simulator(diagnosis, vehicle)
    except ValueError as error:
        return (
            f"no simulator can be made of these causes: "
            f"{' '.join(str(error).split()).rstrip('.')}; check them by hand"
        )
    return not_flyable(config)


def not_flyable(config: FlightConfig) -> str:
    """Return why no plain controller flies a corrected simulator, and what to do; empty where one
    does.

    Args: config: the corrected simulator.
    """
    first = ""
    for kind in TRIED:
        loss = _loss(config, kind)
        if not loss:
            return ""
        first = first or loss
    effects = config.reality.effects
    guilty = [e.effect for k, e in enumerate(effects) if not _loss(_without(config, k), TRIED[0])]
    remedy = (
        f"without {listed(guilty, 'or')} it flies: check that by hand"
        if guilty
        else "check mass, thrust and the order of the rotors in the vehicle file"
    )
    why = first.partition(": ")[2] or first
    return f"{listed(TRIED)} lose the vehicle ({why.rstrip('.')}); {remedy}, and diagnose again"


def _loss(config: FlightConfig, kind: str) -> str:
    """Return why a kind of controller loses the vehicle; empty where it flies."""
    controller = dc.replace(config.controller, kind=kind)
    try:
        fly(dc.replace(config, duration=SECONDS, controller=controller).check_and_step(), seed=0)
    except (LostVehicle, ValueError) as error:  # it falls, or is none that a controller could carry
        return str(error)
    return ""


def _without(config: FlightConfig, k: int) -> FlightConfig:
    """Return the simulator without effect k, nor what is known of it."""
    reality = config.reality
    rest = [entry for i, entry in enumerate(reality.effects) if i != k]
    return dc.replace(
        config, reality=dc.replace(reality, effects=rest, posterior=type(reality.posterior)())
    )
