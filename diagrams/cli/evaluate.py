"""`np-drake evaluate`: prediction skill against the horizon, naive rows included."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from diagrams.batch.failed_run import FailedRun
from diagrams.cli import options
from diagrams.cli.output import say
from diagrams.cli.runner import Report, Run, reports
from diagrams.cli.train import (
    LOG_HELP,
    PAYLOAD_FILTER,
    Force,
    asked_configuration,
    behind_bar,
    configuration_for,
    train_reaction,
)

if TYPE_CHECKING:
    from np_drake.residual_model import ResidualModel
    from np_drake.skill.flight_skill import Model
    from np_drake.training_data.training_segments import Flight

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
    repair: options.Repair = False,
    force: Force = False,
) -> Report:
    """Score predictors on flights; without any: train on the paper's segment, score on race track
    1.

    Twice: with the coming motion (zeta) held at its last value, as a predictor alone would have to,
    and known.
    """
    steps = parse_horizons(horizons)
    names = _choose_configurations(only)
    _require_reactions(also or (), predictor)
    if leave_one_out and (predictor or train or len(logs or ()) < 2):
        raise ValueError(
            "--leave-one-out: give two LOG or more, and neither --predictor nor --train."
        )
    train, logs = _choose_flights(list(train or ()), list(logs or ()), predictor, neurobem)
    if not train and not leave_one_out:
        predictor = predictor or _packaged_model()
    loaded = load(predictor) if predictor else {}
    from diagrams.cli.flights import open_flights, require_one_frame

    tests = open_flights(logs, vehicle, repair=repair)
    training = open_flights(train, vehicle, repair=repair)
    require_one_frame([*training, *tests])
    from diagrams.cli.scoring import distance_text, ending, stability_text, tables
    from np_drake.skill.flight_skill import (
        diverged,
        flight_stability,
        label_distances,
        score_flights,
    )
    from np_drake.training_data.training_segments import require_motion
    from np_drake.vehicle.scaling import sampling_period

    step = step or sampling_period(tests[0].vehicle)
    folds = [([other for other in tests if other is not test], [test]) for test in tests]
    folds = folds if leave_one_out else [(training, tests)]
    for learned, _ in folds if not force else ():
        require_motion(learned)
    rows, windows, distances = list[dict](), list[dict](), list[dict]()
    for learned, held_out in folds:
        models = loaded or _train_all(learned, names, step=step, seed=run.seed, epochs=epochs)
        known = _train_baselines(learned, steps, step, also or (), run.seed)
        for zeta in MOTIONS:
            with run.counting(f"scoring, coming motion {zeta}") as on_model:
                rows += score_flights(
                    models, held_out, steps, zeta=zeta, on_model=on_model, **known
                )
        windows += flight_stability(models, held_out)
        distances += label_distances(models, held_out)
    settings = {"configurations": list(models), "horizons": steps, "step": step}
    settings |= {
        "leave_one_out": leave_one_out,
        "training": [flight.data.name for flight in training],
    }
    lost = diverged(rows) or [line["flight"] for line in windows if line["unstable"]]
    return Report(
        [table for zeta in MOTIONS for table in tables(rows, zeta, mean=leave_one_out)],
        config=settings,
        metrics={"rows": rows, "stability": windows, "label_distances": distances},
        notes=[*stability_text(windows, rows), *distance_text(distances), ending(rows, models)],
        failure=FailedRun(f"a forecast diverged on {', '.join(sorted(set(lost)))}.")
        if lost
        else None,
    )


def parse_horizons(text: str) -> list[int]:
    """Return the steps ahead, ascending.

    Raises: ValueError: if one is no positive whole number, or beyond any flight.
    """
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
    """Return the flights to train on and to score; the paper's where none are given.

    Raises: ValueError: if what is given does not fit together.
    """
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
    from np_drake.logs.formats.neurobem_wrenches import RACE_TRACK, TRAINING

    say("the paper prints 0.057 N and 0.006 N·m for race track 1 (one step ahead).")
    return [neurobem / "npy" / f"{TRAINING}.npy"], [neurobem / "npy" / f"{RACE_TRACK}.npy"]


def _choose_configurations(only: list[str] | None) -> list[str]:
    """Return the configurations to train.

    Raises: ValueError: on an unknown name.
    """
    from np_drake.lifting.training.train import CONFIGURATIONS as KNOWN

    asked = [asked_configuration(name, "--only", (*KNOWN, PAYLOAD_FILTER)) for name in only or ()]
    return list(dict.fromkeys(asked or CONFIGURATIONS))


def _require_reactions(names: Sequence[str], predictor: Path | None) -> None:
    """Check the names of `--also`.

    Raises: ValueError: on an unknown name, or if nothing is trained.
    """
    from np_drake.residual_models.motion_model import REACTIONS

    if unknown := set(names) - set(REACTIONS):
        raise ValueError(
            f"--also: must be {' | '.join(REACTIONS)}; got {', '.join(sorted(unknown))}."
        )
    if names and predictor:
        raise ValueError(
            "--also: gp and knode are trained beside the others; leave out --predictor."
        )


def _train_baselines(
    flights: list["Flight"], horizons: list[int], step: float, also: Sequence[str], seed: int
) -> dict[str, Any]:
    """Train the baselines.

    Returns: `baselines` and `mean` as `score_flights` takes them; empty without flights.
    Raises: ValueError: if one of `also` is not gp or knode, or cannot learn from these flights.
    """
    if not flights:
        if also:
            raise ValueError("--also: gp and knode need flights to train on; give --train LOG.")
        return {}
    import numpy as np

    from np_drake.residual_models.linear_baselines import fit_all

    segments = [segment for flight in flights for segment in flight.segments(step)]
    mean = np.concatenate([segment.goal for segment in segments]).mean(axis=0)
    models: dict[str, ResidualModel] = dict(fit_all(segments, np.unique([0, *horizons])))
    step = segments[0].step
    for name in also:
        models[name] = train_reaction(name, flights, step=step, settings={"seed": seed})[0]
    return {"baselines": models, "mean": mean}


def _packaged_model() -> Path:
    """Return the model file of the package.

    Raises: ValueError: if there is none.
    """
    from diagrams.loop.controller_config import NP_MODEL

    if not NP_MODEL.is_file():
        raise ValueError(
            "the package holds no model; give --predictor FILE, or --train LOG to train on."
        )
    return NP_MODEL


def load(path: Path) -> dict[str, "Model"]:
    """Load the model of a file, lifted linear system or payload filter; return it by its
    configuration.

    Raises: ValueError: on a bad file.
    """
    from np_drake.lifting.model.model_file import load_model, schema_of
    from np_drake.payload_filter.model_file import SCHEMAS, PayloadFilterModel

    if schema_of(path) in SCHEMAS:
        return {PAYLOAD_FILTER: PayloadFilterModel.load(path)}
    model = load_model(path)
    return {model.configuration: model}


def _train_all(
    flights: list["Flight"], names: Sequence[str], *, step: float, seed: int, epochs: int | None
) -> dict[str, "Model"]:
    """Train the configurations of these names on the same flights.

    Raises: ValueError: if `payload_filter` is among them and a flight is an array.
    """
    from np_drake.lifting.training.train import make_config, train
    from np_drake.payload_filter.training import opened_logs, train_payload_filter

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
