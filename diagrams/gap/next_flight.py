"""Files of the next flight: the report of a diagnosis that it starts from, its scenario and its
figure.
"""

import dataclasses as dc
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from matplotlib.figure import Figure

from diagrams.gap.corrected import FILE, SECOND
from diagrams.loop.flight import FlightConfig, load_flight
from np_drake.diagnosis.numerics import Readings
from np_drake.diagnosis.report.figures import legend
from np_drake.effects.explanation import Explanation
from np_drake.files.atomic_file import plain, write_text
from np_drake.files.figure_file import DASHES, PALETTE, new_figure
from np_drake.files.input_file import read_json
from np_drake.flight_design.limits import Limits
from np_drake.flight_design.multisine import FadedMultisine
from np_drake.flight_design.prediction import Prediction, nominal_residuals, predict

REPORT = "diagnosis.json"
SCENARIO = "next_flight.yaml"
TRACK = "next_flight.csv"
# of a report; a diagnosis leaves those within a factor of 20 of the best, at most a few dozen
MOST_EXPLANATIONS = 100
RATE = 100.0  # of the trajectory file [Hz]
HEAD = """\
# Next flight, to separate {explanations}.
#   np-drake fly {file} --reality {corrected}
"""


@dc.dataclass(frozen=True)
class DiagnosisReport:
    """What a diagnosis left in its folder.

    corrected, simulator: file and content of the corrected one.
    explanations: that still stand, best first. readings: how residuals are read. accelerations:
        whether its logs had them.
    """

    corrected: Path
    simulator: FlightConfig
    explanations: tuple[Explanation, ...]
    readings: Readings

    @property
    def accelerations(self) -> bool:
        """Whether the logs of the diagnosis had accelerations."""
        return bool(self.readings.noise.active[9:12].any())

    def predicted(self, motion: FadedMultisine, limits: Limits) -> Prediction:
        """Return what a flight would tell of the explanations."""
        step = self.readings.noise.step
        t = step * np.arange(round(motion.end / step) + 1)
        planned = nominal_residuals(
            limits.vehicle, t, motion.sample(t), accelerations=self.accelerations
        )
        return predict(planned, self.explanations, self.readings)


def read_report(folder: Path) -> DiagnosisReport:
    """Read `diagnosis.json` and `corrected.yaml` of a folder; a second answer counts where there is
    one.

    Raises: ValueError: if the folder holds none, or they do not tell what stands; one line with the
    remedy.
    """
    path = folder / REPORT
    if not path.is_file():
        raise ValueError(
            f"{folder}: must be the folder of np-drake diagnose --out; it holds no {REPORT}."
        )
    try:
        content = read_json(path)
    except ValueError as error:
        raise ValueError(f"{path}: must be JSON ({error}).") from error
    if not isinstance(content, dict) or not isinstance(content.get("refit") or {}, dict):
        raise ValueError(f"{path}: must be the report of np-drake diagnose; got other JSON.")
    answer = content.get("refit") or content
    if answer.get("cannot_tell"):
        raise ValueError(
            f"{path}: the logs excite nothing; fly with more motion and diagnose again."
        )
    if not answer.get("explanations") or not answer.get("readings"):
        raise ValueError(
            f"{path}: must tell the explanations that stand; diagnose again with this version."
        )
    if len(answer["explanations"]) > MOST_EXPLANATIONS:
        raise ValueError(
            f"{path}: must hold at most {MOST_EXPLANATIONS} explanations. Is it damaged?"
        )
    try:
        explanations = tuple(Explanation.of_json(e) for e in answer["explanations"])
        readings = Readings.of_json(answer["readings"])
    except (AttributeError, KeyError, TypeError) as error:
        raise ValueError(f"{path}: explanations and readings must be whole ({error}).") from error
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    second = folder / SECOND
    corrected = second if content.get("refit") and second.is_file() else folder / FILE
    return DiagnosisReport(corrected, load_flight(str(corrected)), explanations, readings)


def write_scenario(
    config: FlightConfig, explanations: Sequence[Explanation], folder: Path, corrected: Path
) -> Path:
    """Write the scenario that flies the track `TRACK` of the same folder, and return its path.

    Args:
        corrected: file of the corrected simulator, in which it flies.
    Raises: OSError: if it cannot be written.
    """
    labels = ", ".join(e.label for e in explanations)
    head = HEAD.format(explanations=labels, file=SCENARIO, corrected=corrected)
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


def track_figure(motion: FadedMultisine, limits: Limits) -> Figure:
    """Return the figure of a flight: from above in its room, and position and speed over time."""
    t = np.linspace(0.0, motion.end, round(motion.end * RATE) + 1)
    flat = motion.sample(t)
    figure, ((above, moved, fast),) = new_figure(1, 3, width=11.0, height=4.0)
    above.plot(flat[0, :, 0], flat[0, :, 1], color=PALETTE[0], linewidth=0.8)
    (x, y, _), (x_, y_, _) = limits.lower, limits.upper
    above.plot([x, x_, x_, x, x], [y, y, y_, y_, y], "k--", linewidth=0.8, label="limit")
    above.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    for axis, colour, dash in zip("xyz", PALETTE, DASHES, strict=False):
        moved.plot(
            t,
            flat[0, :, "xyz".index(axis)],
            color=colour,
            linestyle=dash,
            linewidth=0.9,
            label=axis,
        )
    moved.set(xlabel="time [s]", ylabel="position [m]")
    fast.plot(t, np.linalg.norm(flat[1], axis=1), color=PALETTE[0], linewidth=0.8)
    fast.axhline(limits.speed, color="k", linestyle="--", linewidth=0.8, label="limit")
    fast.set(xlabel="time [s]", ylabel="speed [m/s]", ylim=(0.0, None))
    legend(figure)
    return figure
