"""Unit of outputs that a log does not state: pulses or DShot counts, by their range and by the
lift.
"""

import dataclasses as dc
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.logs.errors import LogError
from np_drake.logs.importing.interpolation import Signals
from np_drake.logs.importing.log_map import LogMap, Source
from np_drake.logs.importing.part import Part
from np_drake.logs.throttle_input import lift_fit
from np_drake.vehicle.vehicle import STRONGEST

Parts = tuple[LogMap, list[Part], list[str]]  # map, what was made of every part, lines
# Shortest pulse of an output that drives a motor [us]. Source: PX4, the least of PWM_MAIN_MINn. 0
# is no pulse.
SHORTEST_PULSE = 800.0
MOST_COUNTS = 2047.0  # of 11 bits, as DShot sends them; of these 48 to 2047 are throttle
FEW = 0.01  # share of samples outside that are glitches [1]; own choice
SURE = (
    10.0  # log likelihood ratio from which the lift tells the unit [nat]; own choice: 1 in 22,000
)
READ = {"us": "pulses of 1000 to 2000 us", "dshot": "DShot counts of 0 to 2000"}


def in_the_likely_unit(
    imported: Callable[[list[Signals], LogMap], Parts],
    parts: list[Signals],
    log_map: LogMap,
    path: str,
) -> Parts:
    """Return what is made of a log whose outputs are pulses or counts: as that with which range and
    lift agree.

    Args:
        log_map: with outputs whose unit the log does not state.
    Raises: LogError: that of both readings, or one that asks for the unit where neither range nor
        lift tells.
    """
    found: dict[str, Parts] = {}
    failure: LogError | None = None
    for unit in _in_range(np.concatenate([signals["throttle"].values for signals in parts])):
        try:
            found[unit] = imported(
                parts, dc.replace(log_map, throttle=dc.replace(log_map.throttle, unit=unit))
            )
        except LogError as error:
            failure = failure or error
    if failure is not None and not found:
        raise failure
    flown = {
        unit: [log for part in made[1] for log in part.flights if part.carried]
        for unit, made in found.items()
    }
    flown = {unit: logs for unit, logs in flown.items() if logs}
    if not flown:
        return next(iter(found.values()))
    unit, why = (
        _by_the_lift(flown)
        if len(flown) > 1
        else (next(iter(flown)), "read otherwise they carry nothing")
    )
    if not unit and all(log.rotor is not None for logs in flown.values() for log in logs):
        others: list[Signals] = [
            {name: own for name, own in signals.items() if name != "throttle"} for signals in parts
        ]
        log_map, made, told = imported(others, dc.replace(log_map, throttle=Source()))
        return (
            log_map,
            made,
            [
                *told,
                "outputs whose unit the log does not state are left out; rotor speed is measured",
            ],
        )
    if not unit:
        raise LogError(
            f"{path}, throttle ({log_map.throttle.columns[0]} …): must be "
            f"{' or '.join(READ.values())}; neither the "
            f"log nor its lift tells which ({why}). Write throttle: {{unit: us}} or "
            f"throttle: {{unit: dshot}} in a map."
        )
    log_map, made, told = found[unit]
    return (
        log_map,
        made,
        [*told, f"outputs are taken as {READ[unit]}: {why}"] if unit != "us" else told,
    )


def _in_range(values: np.ndarray) -> list[str]:
    """Return the units in which outputs can be by their range; both where neither fits."""
    short = np.mean((values > 0) & (values < SHORTEST_PULSE)) > FEW
    long = np.mean(values > MOST_COUNTS) > FEW
    return {(True, False): ["dshot"], (False, True): ["us"]}.get(
        (bool(short), bool(long)), list(READ)
    )


def _by_the_lift(flown: Mapping[str, Sequence[FlightLog]]) -> tuple[str, str]:
    """Return the unit with which the lift agrees, and why; empty where it does not tell.

    Full throttle gives no more than `STRONGEST` times the weight, and the lift goes with a power of
    the throttle.
    """
    fits = {}
    for unit, flights in flown.items():
        try:
            fits[unit] = lift_fit(flights)
        except LogError:
            continue  # a throttle that carries nothing
    able = {unit: fit for unit, fit in fits.items() if fit.strength <= STRONGEST}
    why = ", ".join(
        f"thrust goes with the power {fit.exponent:.2g} of {READ[unit]}"
        for unit, fit in fits.items()
    )
    ranked = sorted(able, key=lambda unit: able[unit].loss)
    told = len(ranked) == 1 or (
        len(ranked) > 1 and able[ranked[1]].loss - able[ranked[0]].loss > SURE
    )
    return (ranked[0] if told else ""), why
