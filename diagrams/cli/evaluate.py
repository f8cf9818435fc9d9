"""`np-drake evaluate`: prediction skill against the horizon, naive rows included."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from typer import Argument, Option

from diagrams.batch.failed_run import FailedRun
from diagrams.cli import options
from diagrams.cli.output import Table, say
from diagrams.cli.runner import Report, Run, reports
from diagrams.cli.train import (
    LOG_HELP,
    PAYLOAD_FILTER,
    Force,
    asked_configuration,
    behind_bar,
    configuration_for,
    open_flights,
    require_one_frame,
    train_reaction,
)
from diagrams.loop.controller_config import NP_MODEL
from diagrams.studies.columns import tabulate
from np_drake.files.number_text import number
from np_drake.lifting.model.model_file import load_model, schema_of
from np_drake.lifting.training.train import CONFIGURATIONS as KNOWN
from np_drake.lifting.training.train import make_config, train
from np_drake.logs.formats.neurobem_wrenches import RACE_TRACK, TRAINING
from np_drake.payload_filter.model_file import SCHEMAS, PayloadFilterModel
from np_drake.payload_filter.training import opened_logs, train_payload_filter
from np_drake.residual_model import ResidualModel
from np_drake.residual_models.linear_baselines import fit_all
from np_drake.residual_models.motion_model import REACTIONS
from np_drake.skill.flight_skill import (
    Model,
    diverged,
    flight_stability,
    label_distances,
    score_flights,
)
from np_drake.skill.skill import mean_interval
from np_drake.training_data.training_segments import Flight, require_motion
from np_drake.vehicle.scaling import sampling_period

AXES_CHOOSE = ""  # the configuration that suits the axes of the flights
CONFIGURATIONS = ("paper", AXES_CHOOSE)  # that are trained unless some are named
HORIZONS = "1,5,10,20,40"
FARTHEST = 10**6  # steps ahead, own choice; flights are shorter
MOTIONS = ("held", "known")  # what a forecast knows of the coming zeta


@reports("evaluate", seed=0, markdown=False)
def evaluate(
    run: Run,
    logs: Annotated[list[Path] | None, Argument(metavar="LOG…", help=LOG_HELP)] = None,
    predictor: Annotated[
        Path | None, Option(metavar="FILE", help="Model file; default: the one in the package.")
    ] = None,
    train: Annotated[
        list[Path] | None,
        Option(metavar="LOG", help="Train both configurations on it; repeatable."),
    ] = None,
    neurobem: options.Neurobem = None,
    leave_one_out: Annotated[
        bool, Option("--leave-one-out", help="Score every LOG by models trained on all the others.")
    ] = False,
    only: Annotated[
        list[str] | None,
        Option(help="Train only this one: a configuration of np, or payload_filter; repeatable."),
    ] = None,
    also: Annotated[
        list[str] | None,
        Option(help="Rows of these as well, trained likewise: gp | knode; repeatable."),
    ] = None,
    horizons: Annotated[str, Option(help="Steps ahead, comma-separated.")] = HORIZONS,
    epochs: options.Epochs = None,
    step: options.Step = None,
    vehicle: options.VehicleFile = None,
    force: Force = False,
) -> Report:
    """Score predictors on flights; without any: train on the paper's segment, score on race track
    1.

    Twice: with the coming motion (zeta) held at its last value, as a predictor alone would have to,
    and known.
    """
    steps = parse_horizons(horizons)
    known = (*KNOWN, PAYLOAD_FILTER)
    asked = [asked_configuration(name, "--only", known) for name in only or ()]
    names = list(dict.fromkeys(asked or CONFIGURATIONS))
    for name in also or ():
        asked_configuration(name, "--also", tuple(REACTIONS))
    if also and predictor:
        raise ValueError(
            "--also: gp and knode are trained beside the others; leave out --predictor."
        )
    if leave_one_out and (predictor or train or len(logs or ()) < 2):
        raise ValueError(
            "--leave-one-out: give two LOG or more, and neither --predictor nor --train."
        )
    train, logs = _choose_flights(list(train or ()), list(logs or ()), predictor, neurobem)
    if not train and not leave_one_out:
        predictor = predictor or NP_MODEL
    loaded = load(predictor) if predictor else {}
    tests = open_flights(logs, vehicle)
    training = open_flights(train, vehicle)
    require_one_frame([*training, *tests])
    step = step or sampling_period(tests[0].vehicle)
    folds = [([other for other in tests if other is not test], [test]) for test in tests]
    folds = folds if leave_one_out else [(training, tests)]
    for learned, _ in folds if not force else ():
        require_motion(learned)
    rows, windows, distances = list[dict](), list[dict](), list[dict]()
    for learned, held_out in folds:
        models = loaded or _train_all(learned, names, step=step, seed=run.seed, epochs=epochs)
        base = _train_baselines(learned, steps, step, also or (), run.seed)
        for zeta in MOTIONS:
            with run.counting(f"scoring, coming motion {zeta}") as on_model:
                rows += score_flights(models, held_out, steps, zeta=zeta, on_model=on_model, **base)
        windows += flight_stability(models, held_out)
        distances += label_distances(models, held_out)
    settings = {"configurations": list(models), "horizons": steps, "step": step}
    settings |= {
        "leave_one_out": leave_one_out,
        "training": [flight.data.name for flight in training],
    }
    said = tabulate(
        "stability of the forecasts; spectral radius above 1: unstable",
        windows,
        [(key, key) for key in ("model", "flight", "windows", "unstable", "pulled", "largest")],
    )
    unfiltered = [
        f"{line['model']} forecasts without low-pass; such labels of {line['flight']} are "
        f"{number(line['force'])} N and {number(line['torque'])} N·m from the target"
        for line in distances
    ]
    lost = diverged(rows) or [line["flight"] for line in windows if line["unstable"]]
    return Report(
        [*(t for zeta in MOTIONS for t in tables(rows, zeta, mean=leave_one_out)), said],
        config=settings,
        metrics={"rows": rows, "stability": windows, "label_distances": distances},
        notes=unfiltered,
        failure=FailedRun(f"a forecast diverged on {', '.join(sorted(set(lost)))}.")
        if lost
        else None,
    )


def parse_horizons(text: str) -> list[int]:
    """Return the steps ahead, ascending."""
    parts = [part.strip() for part in text.split(",")]
    if not all(part.isdecimal() and 0 < int(part) <= FARTHEST for part in parts):
        raise ValueError(
            f"--horizons: must be positive whole numbers of steps, at most {FARTHEST}, as "
            f"{HORIZONS}; got {text!r}."
        )
    return sorted({int(part) for part in parts})


def _choose_flights(
    train: list[Path], logs: list[Path], predictor: Path | None, neurobem: Path | None
) -> tuple[list[Path], list[Path]]:
    """Return the flights to train on and to score; the paper's where none are given."""
    if predictor and train:
        raise ValueError("--predictor is trained already; leave out --train.")
    if logs:
        named = [path.resolve() for path in (*train, *logs)]
        if twice := [path for path in (*train, *logs) if named.count(path.resolve()) > 1]:
            raise ValueError(
                f"{twice[0]}: must be given once; a flight to score must be held out of training."
            )
        return train, logs
    if predictor or train:
        raise ValueError("give the flights to score: np-drake evaluate LOG….")
    if neurobem is None:
        raise ValueError(
            "give flights, or the folder of the NeuroBEM flights as --neurobem DIR or "
            "NP_DRAKE_NEUROBEM."
        )
    say("the paper prints 0.057 N and 0.006 N·m for race track 1 (one step ahead).")
    return [neurobem / "npy" / f"{TRAINING}.npy"], [neurobem / "npy" / f"{RACE_TRACK}.npy"]


def _train_baselines(
    flights: list[Flight], horizons: list[int], step: float, also: Sequence[str], seed: int
) -> dict[str, Any]:
    """Train the baselines and return `baselines` and `mean` as `score_flights` takes them; empty
    without flights.
    """
    if not flights:
        if also:
            raise ValueError("--also: gp and knode need flights to train on; give --train LOG.")
        return {}
    segments = [segment for flight in flights for segment in flight.segments(step)]
    mean = np.concatenate([segment.goal for segment in segments]).mean(axis=0)
    models: dict[str, ResidualModel] = dict(fit_all(segments, np.unique([0, *horizons])))
    step = segments[0].step
    for name in also:
        models[name] = train_reaction(name, flights, step=step, settings={"seed": seed})[0]
    return {"baselines": models, "mean": mean}


def load(path: Path) -> dict[str, Model]:
    """Load the model of a file, lifted linear system or payload filter; return it by its
    configuration.
    """
    if schema_of(path) in SCHEMAS:
        return {PAYLOAD_FILTER: PayloadFilterModel.load(path)}
    model = load_model(path)
    return {model.configuration: model}


def _train_all(
    flights: list[Flight], names: Sequence[str], *, step: float, seed: int, epochs: int | None
) -> dict[str, Model]:
    """Train the configurations of these names on the same flights.

    Raises: ValueError: if `payload_filter` is among them and a flight is an array.
    """
    segments = [segment for flight in flights for segment in flight.segments(step)]
    models: dict[str, Model] = {}
    for asked in names:
        name = configuration_for(asked, flights[0].frame)
        if name == PAYLOAD_FILTER:
            models[name] = train_payload_filter(opened_logs(flights), step=step)
            continue
        config = make_config(name, frame=flights[0].frame, seed=seed, epochs=epochs)
        result, wall = behind_bar(f"training {name}", partial(train, segments, config))
        say(f"{name}: {wall:.1f} s, {result.model.summary.get('excitation', '')}")
        models[name] = result.model
    return models


def tables(rows: list[dict[str, Any]], zeta: str, *, mean: bool) -> list[Table]:
    """Return two tables, a column for every horizon, for every flight or, with `mean`, for all
    together.

    A flight's hold RMSE and, in brackets, skill; the mean over flights is that of the ratio to
    persistence with its 95 % interval and the worst skill.
    """
    rows = [row for row in rows if row["zeta"] == zeta]
    horizons = sorted({row["horizon"] for row in rows})
    found = []
    for flight in [None] if mean else dict.fromkeys(row["flight"] for row in rows):
        group = [row for row in rows if flight in (None, row["flight"])]
        for kind, unit in (("force", "N"), ("torque", "N·m")):
            lines = []
            for model in dict.fromkeys(row["model"] for row in group):
                own = [row for row in group if row["model"] == model]
                ahead = [[row for row in own if row["horizon"] == h] for h in horizons]
                lines.append((model, *(_cell(kind, cell, mean) for cell in ahead)))
            what = f" RMSE [{unit}] (skill: below 1 beats all naive)"
            what = ", ratio to persistence (worst skill)" if mean else what
            title = f"{flight or 'mean over flights'}: {kind}{what}, coming motion {zeta}"
            found.append((title, ["ahead", *(f"{h:.4g} s" for h in horizons)], lines))
    return found


def _cell(kind: str, rows: list[dict[str, Any]], mean: bool) -> str:
    """Return error and skill of a flight, or of several their mean ratio and worst skill."""
    if not mean:
        return f"{number(rows[-1][f'{kind}_rmse'])} ({rows[-1][f'{kind}_skill']:.2f})"
    middle, low, high = mean_interval(np.array([row[f"{kind}_ratio"] for row in rows]))
    worst = max(row[f"{kind}_skill"] for row in rows)
    return f"{_short(float(middle))} ±{_short(float(high - low) / 2)} ({_short(worst)})"


def _short(value: float) -> str:
    """Format with two digits behind the point, or two significant ones."""
    return f"{value:.2f}" if 0.1 <= value < 1000 or value != value else number(value, 2)
