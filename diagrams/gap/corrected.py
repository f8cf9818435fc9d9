"""Corrected simulator of a diagnosis: a scenario with its causes, its file, and the trial whether
a plain controller keeps its vehicle in the air.
"""

import dataclasses as dc
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from jinja2 import Environment

from diagrams.loop.flight import FlightConfig, default_flight
from diagrams.loop.flight_result import LostVehicle, fly
from np_drake.diagnosis.report.words import headline, listed
from np_drake.diagnosis.result import Cause, Diagnosis, Localisation
from np_drake.effects.disturbance import DisturbanceConfig
from np_drake.effects.effect_entry import EffectEntry, Posterior
from np_drake.files.file_access import plain, write_text
from np_drake.files.number_text import NBSP
from np_drake.files.yaml_file import quoted
from np_drake.vehicle import Vehicle

# of a correlation time that a log can show [s]; own choice
SHORTEST = 0.02
LONGEST = 20.0
FILE = "corrected.yaml"
SECOND = "corrected_second.yaml"  # of the second answer
TEMPLATE = Path(__file__).with_name("corrected.yaml.j2")
TRIED = ("nominal", "hold", "observer")  # controllers without training
SECONDS = 2.0  # of the trial behind its ramp [s]; own choice: what falls has fallen by then


def corrected_simulator(diagnosis: Diagnosis, vehicle: Vehicle) -> FlightConfig:
    """Return the scenario of `vehicle` with the causes of a diagnosis and the disturbance that
    remains.

    They are the causes that its verdict names, but for a `downwash`: a flight to come has no
    neighbour. A second answer (`Diagnosis.refit`) has a simulator of its own. The reference is the
    default circle of the vehicle, the noise that of its sensors in the simulator.
    """
    config = default_flight(vehicle)
    reality = dc.replace(
        config.reality.nominal(),
        effects=[entry for cause in diagnosis.causes if (entry := _entry(cause)) is not None],
        disturbance=remaining_disturbance(diagnosis.localisation),
        posterior=diagnosis.posterior or Posterior(),
    )
    return dc.replace(config.in_reality(reality), name="corrected").check_and_step()


def _entry(cause: Cause) -> EffectEntry | None:
    """Return the entry of a cause; None for one that is absent from all flights, or needs a
    neighbour.

    In a flight to come it begins in mid-flight only if it did in every flight that shows it.
    """
    if cause.effect is None or cause.effect.lacking():
        return None
    onsets = {flight: 0.0 if t is None else float(t) for flight, t in cause.onset.items()}
    seen = [t for t in onsets.values() if np.isfinite(t)]
    if onsets and not seen:
        return None
    onset = float(np.median(seen)) if seen and min(seen) > 0 else None
    entry = EffectEntry.of(cause.effect, onset=onset, probability=cause.probability)
    return dc.replace(entry, onsets=onsets)


def remaining_disturbance(where: Localisation) -> DisturbanceConfig:
    """Return deviation and correlation time of the residual after the causes, less the noise floor,
    in body axes.
    """
    if len(where.channels) != 6:  # no channel was judged
        return DisturbanceConfig()
    squares = np.array([c.after**2 - c.noise_floor**2 for c in where.channels])
    size = np.sqrt(np.where(squares > 0, np.nan_to_num(squares, posinf=0.0), 0.0)).tolist()
    times = [_correlation_time(where, k) for k in range(6)]
    return DisturbanceConfig(size[:3], size[3:], times[:3], times[3:])


def _correlation_time(where: Localisation, channel: int) -> float:
    """Return the lag at which the autocovariance of a channel, mean of all flights, has fallen to
    1/e of that at the first lag [s].

    White noise of the sensors is in the variance alone, and so left out.
    """
    flights = []
    for flight, t in where.times.items():
        if flight in where.after and len(t) > 1:
            series = where.after[flight][:, channel]
            series = series[np.isfinite(series)]
            if len(series) > 20:
                flights.append((np.median(np.diff(t)), series - series.mean()))
    if not flights:
        return SHORTEST
    step = flights[0][0]
    lags = range(1, min(int(LONGEST / step), min(len(x) for _, x in flights) // 2))
    rows = [[x[:-k] @ x[k:] / (len(x) - k) for k in lags] for _, x in flights]
    covariance = np.mean(rows, axis=0)
    if not len(covariance) or covariance[0] <= 0:
        return SHORTEST
    below = np.flatnonzero(covariance < covariance[0] / np.e)
    lag = below[0] if len(below) else len(covariance) - 1
    return float(np.clip(lag * step, SHORTEST, LONGEST))


def write_corrected(config: FlightConfig, diagnosis: Diagnosis, path: Path) -> None:
    """Write the scenario with the 95 % interval of every parameter beside its value; numbers as
    Python writes them, so that reading gives the same ones.
    Raises: OSError: if the file cannot be written.
    """
    comments = [
        *textwrap.wrap(
            f"{headline(diagnosis)}.", 110, break_long_words=False, break_on_hyphens=False
        ),
        *(
            f"{cause.identifier} keeps its first mass here; its changes are in diagnosis.json."
            for cause in diagnosis.causes
            if cause.loads
        ),
        *(
            f"Left out: {cause.identifier}, which acts only beside a neighbour."
            for cause in diagnosis.causes
            if cause.effect is not None and cause.effect.lacking()
        ),
    ]
    reality = {
        "payload": {"tether": "none"},
        "rotor_drag": 0.0,
        "motor_lag": 0.0,
        "thrust_scale": 1.0,
        "disturbance": dc.asdict(config.reality.disturbance),
        "posterior": dc.asdict(config.reality.posterior),
    }
    blocks: list[dict[str, Any]] = [
        {"name": config.name, "vehicle": dc.asdict(config.vehicle)},
        {"simulator": {"max_step_size": float(config.simulator.max_step_size)}},
        {"reality": reality},
    ]
    environment = Environment(trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True)
    environment.filters |= {"repr": repr, "quoted": quoted}
    text = environment.from_string(TEMPLATE.read_text("utf-8")).render(
        not_flyable=diagnosis.not_flyable,
        file=path.name,
        comments=[line.replace(NBSP, " ") for line in comments],
        scenario="".join(
            yaml.safe_dump(
                stated(plain(block)), sort_keys=False, default_flow_style=None, width=110
            )
            for block in blocks
        ),
        effects=config.reality.effects,
        deviations=config.reality.posterior.deviations,
        infinity=np.inf,
    )
    write_text(path, text)


def stated(value: Any) -> Any:
    """Return a value without what is None in it."""
    if isinstance(value, dict):
        return {key: stated(inner) for key, inner in value.items() if inner is not None}
    return value


def with_trial(diagnosis: Diagnosis, vehicle: Vehicle) -> Diagnosis:
    """Return the diagnosis, and its second answer, with why nothing flies in its corrected
    simulator, if so.
    """
    if diagnosis.cannot_tell:
        return diagnosis
    second = None if diagnosis.refit is None else with_trial(diagnosis.refit, vehicle)
    try:
        why = not_flyable(corrected_simulator(diagnosis, vehicle))
    except ValueError as error:
        reason = " ".join(str(error).split()).rstrip(".")
        why = f"no simulator can be made of these causes: {reason}; check them by hand"
    return dc.replace(diagnosis, refit=second, not_flyable=why)


def not_flyable(config: FlightConfig) -> str:
    """Return why no plain controller flies a corrected simulator, and what to do; empty where one
    does.
    """
    losses = []
    for kind in TRIED:
        losses.append(_loss(config, kind))
        if not losses[-1]:
            return ""
    reality = config.reality
    guilty = []
    for k, entry in enumerate(reality.effects):
        rest = [*reality.effects[:k], *reality.effects[k + 1 :]]
        without = dc.replace(reality, effects=rest, posterior=Posterior())
        if not _loss(dc.replace(config, reality=without), TRIED[0]):
            guilty.append(entry.effect)
    remedy = (
        f"without {listed(guilty, 'or')} it flies: check that by hand"
        if guilty
        else "check mass, thrust and the order of the rotors in the vehicle file"
    )
    why = losses[0].partition(": ")[2] or losses[0]
    return f"{listed(TRIED)} lose the vehicle ({why.rstrip('.')}); {remedy}, and diagnose again"


def _loss(config: FlightConfig, kind: str) -> str:
    """Return why a kind of controller loses the vehicle; empty where it flies."""
    controller = dc.replace(config.controller, kind=kind)
    try:
        fly(dc.replace(config, duration=SECONDS, controller=controller).check_and_step(), seed=0)
    except (LostVehicle, ValueError) as error:  # it falls, or is none that a controller could carry
        return str(error)
    return ""
