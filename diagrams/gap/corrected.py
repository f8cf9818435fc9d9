"""Corrected simulator of a diagnosis: a scenario with its causes, draws from their posterior, and
its file.
"""

import dataclasses as dc
import math
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from diagrams.loop.flight import FlightConfig, default_flight
from np_drake.diagnosis.report.answer import headline
from np_drake.diagnosis.result import Cause, Diagnosis, Localisation
from np_drake.effects.disturbance import DisturbanceConfig
from np_drake.effects.effect_entry import EffectEntry, Posterior
from np_drake.files.atomic_file import write_text
from np_drake.files.number_text import NBSP
from np_drake.files.yaml_file import quoted
from np_drake.vehicle import Vehicle

NAME = "corrected"
SHORTEST, LONGEST = 0.02, 20.0  # of a correlation time that a log can show [s]; own choice
FILE = "corrected.yaml"
SECOND = "corrected_second.yaml"  # of the second answer
HEAD = """\
# Corrected simulator: the vehicle file with the effects that the diagnosis found. Units are SI.
{use}
{headline}
"""
USE = """\
#   np-drake fly {file}                    fly it
#   np-drake fly {file} --sample 10        fly ten simulators drawn from the posterior
#   np-drake fly lemniscate --reality {file}"""


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
    return dc.replace(config, name=NAME, reality=reality).check_and_step()


def _entry(cause: Cause) -> EffectEntry | None:
    """Return the entry of a cause; None for one that is absent from all flights, or needs a
    neighbour.
    """
    if cause.effect is None or cause.effect.lacking():
        return None
    onsets = {flight: 0.0 if t is None else float(t) for flight, t in cause.onset.items()}
    seen = [t for t in onsets.values() if math.isfinite(t)]
    if onsets and not seen:
        return None
    entry = EffectEntry.of(cause.effect, onset=_onset(seen), probability=cause.probability)
    return dc.replace(entry, onsets=onsets)


def _onset(seen: list[float]) -> float | None:
    """Return when an effect begins in a flight to come: in mid-flight only if it did in every
    flight that shows it.
    """
    return float(np.median(seen)) if seen and min(seen) > 0 else None


def drawn(config: FlightConfig, count: int, seed: int) -> list[FlightConfig]:
    """Return simulators drawn from the posterior of a corrected one, each with a disturbance of its
    own.
    Raises: ValueError: if the scenario has no posterior and no uncertain effect, so that all draws
        were the same.
    """
    reality = config.reality
    if not reality.posterior.parameters and all(e.probability == 1.0 for e in reality.effects):
        raise ValueError(
            f"{config.name}: there must be a posterior to draw from; name "
            f"reality.posterior, or take the "
            "corrected.yaml of a diagnosis."
        )
    generator, found = np.random.default_rng(seed), []
    for k in range(count):
        effects = reality.posterior.draw(reality.effects, generator)
        disturbance = dc.replace(reality.disturbance, seed=int(generator.integers(2**31)))
        own = dc.replace(reality, effects=effects, disturbance=disturbance)
        found.append(
            dc.replace(config, name=f"{config.name}_{k + 1}", reality=own).check_and_step()
        )
    return found


def remaining_disturbance(where: Localisation) -> DisturbanceConfig:
    """Return deviation and correlation time of the residual after the causes, less the noise floor,
    in body axes.
    """
    size = [float(np.sqrt(max(c.after**2 - c.noise_floor**2, 0.0))) for c in where.channels]
    if len(size) != 6:  # no channel was judged
        return DisturbanceConfig()
    size = [value if np.isfinite(value) else 0.0 for value in size]
    times = [_correlation_time(where, k) for k in range(6)]
    return DisturbanceConfig(size[:3], size[3:], times[:3], times[3:])


def _correlation_time(where: Localisation, channel: int) -> float:
    """Return the lag at which the autocovariance of a channel has fallen to 1/e of that at the
    first lag [s].

    White noise of the sensors is in the variance alone, and so left out.
    """
    step, covariance = _autocovariance(where, channel)
    if not len(covariance) or covariance[0] <= 0:
        return SHORTEST
    below = np.flatnonzero(covariance < covariance[0] / np.e)
    lag = below[0] if len(below) else len(covariance) - 1
    return float(np.clip(lag * step, SHORTEST, LONGEST))


def _autocovariance(where: Localisation, channel: int) -> tuple[float, np.ndarray]:
    """Return the step [s] and the autocovariance at lags of one step on, mean of all flights."""
    flights = [(step, series[np.isfinite(series)]) for step, series in _series(where, channel)]
    flights = [(step, series - series.mean()) for step, series in flights if len(series) > 20]
    if not flights:
        return SHORTEST, np.zeros(0)
    step = flights[0][0]
    lags = min(int(LONGEST / step), min(len(series) for _, series in flights) // 2)
    total = sum(
        np.array([series[:-k] @ series[k:] / (len(series) - k) for k in range(1, lags)])
        for _, series in flights
    )
    return step, np.asarray(total) / len(flights)


def _series(where: Localisation, channel: int) -> Iterator[tuple[float, np.ndarray]]:
    for flight, t in where.times.items():
        if flight in where.after and len(t) > 1:
            yield float(np.median(np.diff(t))), where.after[flight][:, channel]


def write_corrected(config: FlightConfig, diagnosis: Diagnosis, path: Path) -> None:
    """Write the scenario with the 95 % interval of every parameter beside its value.
    Raises: OSError: if the file cannot be written.
    """
    said = textwrap.wrap(
        f"{headline(diagnosis)}.", 110, break_long_words=False, break_on_hyphens=False
    )
    for name in (
        c.identifier for c in diagnosis.causes if c.effect is not None and c.effect.lacking()
    ):
        said.append(f"Left out: {name}, which acts only beside a neighbour.")
    use = (
        f"# Do not fly it: {diagnosis.not_flyable}."
        if diagnosis.not_flyable
        else USE.format(file=path.name)
    )
    head = HEAD.format(use=use, headline="\n".join(f"# {line}" for line in said).replace(NBSP, " "))
    reality, posterior = config.reality, config.reality.posterior
    plain = {
        "payload": {"tether": "none"},
        "rotor_drag": 0.0,
        "motor_lag": 0.0,
        "thrust_scale": 1.0,
        "disturbance": dc.asdict(reality.disturbance),
        "posterior": dc.asdict(posterior),
    }
    text = [
        head,
        _block({"name": config.name, "vehicle": dc.asdict(config.vehicle)}),
        _block({"simulator": {"max_step_size": float(config.simulator.max_step_size)}}),
        _block({"reality": plain}),
        "  effects:" + ("" if reality.effects else " []") + "\n",
        *(_entry_text(entry, posterior) for entry in reality.effects),
    ]
    write_text(path, "".join(text))


def _block(content: dict[str, Any]) -> str:
    return yaml.safe_dump(_plain(content), sort_keys=False, default_flow_style=None, width=110)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items() if inner is not None}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(inner) for inner in value]
    return value.item() if isinstance(value, np.generic) else value


def _entry_text(entry: EffectEntry, posterior: Posterior) -> str:
    """Return the lines of an effect; numbers as Python writes them, so that reading gives the same
    ones.
    """
    deviations = posterior.deviations
    lines = [f"  - effect: {entry.effect}"]
    lines += [f"    probability: {entry.probability!r}"]
    lines += [f"    onset: {entry.onset!r}  # [s]"] if entry.onset is not None else []
    lines += ["    parameters:"]
    for p in entry.made.parameters:
        value, deviation = entry.made.values[p.name], deviations.get(f"{entry.effect}.{p.name}")
        half = None if deviation is None else 1.96 * deviation
        told = "" if half is None else f", 95 %: {value - half:.4g} to {value + half:.4g}"
        lines.append(f"      {p.name}: {value!r}  # [{p.unit}]{told}")
    if entry.onsets:
        onsets = ", ".join(f"{quoted(name)}: {_number(t)}" for name, t in entry.onsets.items())
        lines.append(f"    onsets: {{{onsets}}}  # by flight [s]")
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    return ".inf" if np.isinf(value) else repr(float(value))
