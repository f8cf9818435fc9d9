"""Report of a diagnosis as the start of a design: the explanations that stand, and the corrected simulator."""

import dataclasses as dc
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from diagrams.gap.corrected_file import FILE as CORRECTED
from diagrams.gap.flown_design import FILE as TRACK
from diagrams.loop.flight import FlightConfig, load_flight
from np_drake.diagnosis.numerics import Readings
from np_drake.effects.explanation import Explanation
from np_drake.files.atomic_file import plain, write_text
from np_drake.files.input_file import read_json

REPORT = "diagnosis.json"
SCENARIO = "next_flight.yaml"
HEAD = """\
# Next flight: the track that best separates {explanations}.
#   np-drake fly {file} --reality {corrected}
"""


@dc.dataclass(frozen=True)
class DiagnosisReport:
    """What a diagnosis left in its folder.

    simulator: the corrected one.   explanations: that still stand, best first.   readings: how residuals are read.
    accelerations: whether its logs had them.
    """

    folder: Path
    simulator: FlightConfig
    explanations: tuple[Explanation, ...]
    readings: Readings

    @property
    def accelerations(self) -> bool:
        """Whether the logs of the diagnosis had accelerations."""
        return bool(self.readings.noise.active[9:12].any())


def read_report(folder: Path) -> DiagnosisReport:
    """Read `diagnosis.json` and `corrected.yaml` of a folder; a second answer counts where there is one.

    Raises: ValueError: if the folder holds none, or they do not tell what stands; one line with the remedy.
    """
    path = folder / REPORT
    if not path.is_file():
        raise ValueError(f"{folder}: must be the folder of np-drake diagnose --out; it holds no {REPORT}.")
    try:
        content = read_json(path)
    except ValueError as error:
        raise ValueError(f"{path}: must be JSON ({error}).") from error
    if not isinstance(content, dict) or not isinstance(content.get("refit") or {}, dict):
        raise ValueError(f"{path}: must be the report of np-drake diagnose; got other JSON.")
    answer = content.get("refit") or content
    if answer.get("cannot_tell"):
        raise ValueError(f"{path}: the logs excite nothing; fly with more motion and diagnose again.")
    if not answer.get("explanations") or not answer.get("readings"):
        raise ValueError(f"{path}: must tell the explanations that stand; diagnose again with this version.")
    try:
        explanations = tuple(Explanation.of_json(e) for e in answer["explanations"])
        readings = Readings.of_json(answer["readings"])
    except (AttributeError, KeyError, TypeError) as error:
        raise ValueError(f"{path}: explanations and readings must be whole ({error}).") from error
    return DiagnosisReport(folder, load_flight(str(folder / CORRECTED)), explanations, readings)


def write_scenario(
    config: FlightConfig, explanations: Sequence[Explanation], folder: Path, report: Path
) -> Path:
    """Write the scenario that flies the track `TRACK` of the same folder, and return its path.

    Raises: OSError: if it cannot be written.
    """
    labels = ", ".join(e.label for e in explanations)
    head = HEAD.format(explanations=labels, file=SCENARIO, corrected=report / CORRECTED)
    content: dict[str, Any] = {
        "name": config.name,
        "vehicle": _named(dc.asdict(config.vehicle)),
        "reference": {"track": TRACK},
        "controller": {"kind": config.controller.kind, "solver": config.controller.solver},
    }
    text = yaml.safe_dump(plain(content), sort_keys=False, default_flow_style=None, width=110)
    write_text(folder / SCENARIO, head + text)
    return folder / SCENARIO


def _named(values: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in values.items() if value is not None}
