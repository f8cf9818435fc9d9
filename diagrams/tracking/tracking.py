"""Tracking comparison: every controller on circle and lemniscate, several seeds, one trained model
a row.
"""

import dataclasses as dc
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np

from diagrams.loop.controller_config import LEARNED
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import FlightResult, fly
from diagrams.prediction.learning import train_payload_filter_model, train_predictor, train_reaction
from np_drake.lifting.model.lifted_model import LIFTED, NEURAL
from np_drake.metrics import half_width
from np_drake.payload_filter.model_file import PAYLOAD_FILTER
from np_drake.residual_models.motion_model import GP, KNODE, REACTIONS
from np_drake.vehicle import Vehicle

TRACKS = ("circle", "lemniscate")  # experiments that are flown
PLAIN, DITHERED = "plain_circle", "training_circle"  # experiments that are trained on
# Training experiments by option.
PROTOCOLS = {"plain": (PLAIN,), "dithered": (DITHERED,), "both": (PLAIN, DITHERED)}
# The paper's Table II: (E_xy, E_z) [m], real flights. Source: Jin et al. 2025.
PAPER = {
    "nominal": {"circle": (0.1797, 0.2329), "lemniscate": (0.2029, 0.2539)},
    "gp": {"circle": (0.1414, 0.1692), "lemniscate": (0.1878, 0.1966)},
    "knode": {"circle": (0.0919, 0.1307), "lemniscate": (0.1503, 0.1406)},
    "np": {"circle": (0.0837, 0.0758), "lemniscate": (0.0849, 0.0591)},
}


@dc.dataclass(frozen=True)
class Row:
    """One row of the table: a controller, what it is given, and what its predictor was trained on.

    kind: see `ControllerConfig`.
    known_mass: whether controller and estimator know the payload's mass.
    """

    name: str  # of the row
    kind: str
    known_mass: bool = False
    hold_bandwidth: float = np.inf  # of kind hold [Hz]
    training: str = ""  # experiment that the predictor is trained on
    configuration: str = ""  # of the predictor; gp, knode: their own name

    @property
    def published(self) -> dict[str, tuple[float, float]]:
        """Errors of this controller in the paper by track, (E_xy, E_z) [m]; empty where it has
        none.
        """
        return {} if self.known_mass else PAPER.get(self.kind, {})


AnyRow = TypeVar("AnyRow", bound=Row)
ROWS = (
    Row("nominal", "nominal"),
    Row("nominal + total mass", "nominal", known_mass=True),
    Row("observer", "observer"),
    Row("observer + total mass", "observer", known_mass=True),
    Row("hold", "hold"),
    Row("hold + total mass", "hold", known_mass=True),
    Row("hold at 1 Hz + total mass", "hold", known_mass=True, hold_bandwidth=1.0),
    Row("gp: plain circle", "gp", training=PLAIN, configuration=GP),
    Row("gp", "gp", training=DITHERED, configuration=GP),
    Row("knode: plain circle", "knode", training=PLAIN, configuration=KNODE),
    Row("knode", "knode", training=DITHERED, configuration=KNODE),
    Row("np: paper, plain circle", "np", training=PLAIN, configuration="paper"),
    Row("np: plain circle", "np", training=PLAIN, configuration=NEURAL),
    Row(
        "payload_filter: plain circle", PAYLOAD_FILTER, training=PLAIN, configuration=PAYLOAD_FILTER
    ),
    Row("np: paper, dithered circle", "np", training=DITHERED, configuration="paper"),
    Row("np: lifted", "np", training=DITHERED, configuration=LIFTED),
    Row("np", "np", training=DITHERED, configuration=NEURAL),
    Row("payload_filter", PAYLOAD_FILTER, training=DITHERED, configuration=PAYLOAD_FILTER),
    Row("oracle", "oracle"),
)


def named(rows: Sequence[AnyRow], name: str) -> AnyRow:
    """Return the row of that name."""
    return next(row for row in rows if row.name == name)


def configure(
    track: str,
    row: Row,
    *,
    solver: str,
    model: str = "",
    vehicle: Vehicle | None = None,
    reality: Path | None = None,
) -> FlightConfig:
    """Return the experiment `track` with the controller of `row`.

    Args:
        vehicle: to which it is scaled; None: the paper's.
        reality: scenario file that it is flown in, see `load_experiment`.
    """
    config = load_experiment(track, vehicle, reality)
    controller = config.controller
    controller.kind, controller.solver = row.kind, solver
    controller.predictor = model if row.kind in LEARNED else ""
    controller.hold_bandwidth = row.hold_bandwidth
    if row.known_mass:
        controller.extra_mass = config.reality.hung.mass
    return config.check()


def training_flight(
    experiment: str,
    *,
    seed: int,
    solver: str,
    vehicle: Vehicle | None = None,
    reality: Path | None = None,
) -> FlightResult:
    """Fly the experiment that a predictor learns from with the nominal MPC: 60 s of any vehicle.

    Args:
        vehicle: to which it is scaled; None: the paper's.
        reality: scenario file that it is flown in, see `load_experiment`.
    """
    config = training_config(experiment, solver=solver, vehicle=vehicle, reality=reality)
    return fly(config, seed=seed)


def training_config(
    experiment: str, *, solver: str, vehicle: Vehicle | None = None, reality: Path | None = None
) -> FlightConfig:
    """Return the settings of `training_flight`.

    Args:
        vehicle: to which it is scaled; None: the paper's.
        reality: scenario file that it is flown in, see `load_experiment`.
    """
    config = load_experiment(experiment, vehicle, reality)
    config.duration = load_experiment(experiment).duration
    config.controller.kind, config.controller.solver = "nominal", solver
    return config


def train_models(
    rows: tuple[Row, ...],
    folder: Path,
    *,
    seed: int,
    solver: str,
    vehicle: Vehicle | None = None,
    reality: Path | None = None,
) -> dict[tuple[str, str], str]:
    """Train one model for every (training experiment, configuration) of `rows` and return their
    files.

    Args:
        vehicle: to which they are scaled; None: the paper's.
        reality: scenario file that they are flown in, see `load_experiment`.
    """
    files: dict[tuple[str, str], str] = {}
    flights: dict[str, FlightResult] = {}
    for row in rows:
        key = (row.training, row.configuration)
        if not row.training or key in files:
            continue
        if row.training not in flights:
            flights[row.training] = training_flight(
                row.training, seed=seed, solver=solver, vehicle=vehicle, reality=reality
            )
        path = folder / f"{row.configuration}_{row.training}.safetensors"
        if row.configuration in REACTIONS:
            train_reaction(flights[row.training], path, name=row.configuration, seed=seed)
        elif row.configuration == PAYLOAD_FILTER:
            train_payload_filter_model(flights[row.training], path)
        else:
            train_predictor(flights[row.training], path, configuration=row.configuration, seed=seed)
        files[key] = str(path)
    return files


def table(summaries: list[dict], rows: tuple[Row, ...] = ROWS) -> list[dict]:
    """Return E_xy and E_z [m] by row (in the order of `rows`) and track.

    They are means over seeds with 95 % interval (Student) and standard deviation, and the reduction
    relative to nominal.
    """
    order = {row.name: number for number, row in enumerate(rows)}
    lines = []
    for row in sorted({s["row"] for s in summaries}, key=lambda name: order.get(name, len(order))):
        for track in TRACKS:
            line: dict = {"row": row, "track": track}
            mine = [s["metrics"] for s in summaries if s["row"] == row and s["experiment"] == track]
            base = [
                s["metrics"]
                for s in summaries
                if s["row"] == "nominal" and s["experiment"] == track
            ]
            for key in ("E_xy", "E_z"):
                values = np.array([m[key] for m in mine])
                line[key], line[f"{key}_ci95"] = float(values.mean()), half_width(values)
                line[f"{key}_sd"] = _deviation(values)
                if base:
                    line[f"{key}_cut"] = 1.0 - line[key] / float(np.mean([m[key] for m in base]))
            line["growth"] = float(np.mean([m["growth"] for m in mine]))
            line["solve_failures"] = int(sum(m["solve_failures"] for m in mine))
            lines.append(line)
    return lines


def _deviation(values: np.ndarray) -> float:
    """Return the standard deviation over seeds; NaN for a single or a lost flight."""
    if len(values) < 2 or not np.isfinite(values).all():
        return float("nan")
    return float(values.std(ddof=1))


def frozen_weights() -> dict:
    """Return the MPC configuration of every row."""
    return dc.asdict(load_experiment("circle").controller.mpc)
