"""Writing of a corrected simulator as a scenario file that a person can read."""

import dataclasses as dc
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from diagrams.loop.flight import FlightConfig
from np_drake.diagnosis.result import Diagnosis
from np_drake.effects.effect_entry import EffectEntry
from np_drake.effects.posterior import Posterior
from np_drake.files.atomic_file import write_text
from np_drake.files.yaml_text import quoted

FILE = "corrected.yaml"
HEAD = """\
# Corrected simulator: the vehicle file with the effects that the diagnosis found. Units are SI.
#   np-drake fly {file}                    fly it
#   np-drake fly {file} --sample 10        fly ten simulators drawn from the posterior
#   np-drake fly lemniscate --reality {file}
# verdict: {verdict}
"""


def write_corrected(config: FlightConfig, diagnosis: Diagnosis, path: Path) -> None:
    """Write the scenario with the 95 % interval of every parameter beside its value.

    Raises: OSError: if the file cannot be written.
    """
    verdict = ", ".join((diagnosis.refit or diagnosis).verdict) or "nothing is missing"
    head = HEAD.format(file=path.name, verdict=verdict)
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
        *(_entry(entry, posterior) for entry in reality.effects),
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


def _entry(entry: EffectEntry, posterior: Posterior) -> str:
    """Return the lines of an effect; numbers as Python writes them, so that reading gives the same ones."""
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
