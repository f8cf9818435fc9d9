"""Every controller on every track with vehicles of several sizes, each trained on 60 s of its own.

Payload, tether, track, air, motors, weights and time steps are those of the paper's vehicle in the
units of the one that flies (`scaled`); the noise of the sensors is the same for all.
"""

import dataclasses as dc
import itertools
from collections.abc import Collection, Sequence
from functools import partial
from typing import Annotated

from typer import Option

from diagrams.batch.campaign import Case, Record
from diagrams.batch.flown import FlownOptions, choose_rows
from diagrams.batch.options import Duration, Seeds
from diagrams.batch.run import Report, Run
from diagrams.batch.workers import require_result
from diagrams.loop.experiments import settings_of
from diagrams.loop.flight import FlightConfig
from diagrams.robustness.measures import LOST, SETTLING
from diagrams.robustness.robustness import SCORED, TRAINING, Sweep, configurations, flown, sweep_of
from diagrams.robustness.vehicles.fleet import ROWS, TRACKS, VEHICLES, fleet
from diagrams.robustness.vehicles.table import ORACLE, lost_flights, vehicle_table, vehicles_printed
from diagrams.tracking.model_files import Training, digest_of, model_of, training_case
from diagrams.tracking.tracking import Row, configure, named, training_config
from np_drake.vehicle.scaling import ratios

Models = dict[tuple[str, str], bytes]  # content of the model files by vehicle and configuration


def flight_config(
    case: Case, *, solver: str, model: str = "", duration: float = SCORED
) -> FlightConfig:
    """Return the track of the case with its vehicle and controller.

    Args:
        duration: after the ramp, of the paper's vehicle [s].
    """
    row, vehicle = named(ROWS, case["row"]), fleet()[case["vehicle"]]
    config = configure(case["track"], row, solver=solver, model=model, vehicle=vehicle)
    config.duration = duration * ratios(vehicle).time
    return config.check()


@dc.dataclass(frozen=True)
class Flying:
    """Work of a flight: case -> `measures`.

    duration: after the ramp, of the paper's vehicle [s].
    """

    models: Models
    solver: str
    duration: float = SCORED

    def __call__(self, case: Case) -> dict:
        """Fly the case and return its measures."""
        model = self.models.get((case["vehicle"], named(ROWS, case["row"]).configuration))
        configured = partial(flight_config, case, solver=self.solver, duration=self.duration)
        return flown(lambda path: configured(model=path), model, case["seed"])


def flight_cases(
    rows: Sequence[Row],
    seeds: Sequence[int],
    models: Models,
    vehicles: Sequence[str] = VEHICLES,
    tracks: Sequence[str] = TRACKS,
) -> list[Case]:
    """Return every row on every track with every vehicle and seed, where the row's model was
    trained.

    A case names its model by the digest of its file, so that no result of another one is taken for
    it.

    Args:
        models: content of the model files by vehicle and configuration.
    """
    cases = []
    for seed, vehicle, track, row in itertools.product(seeds, vehicles, tracks, rows):
        key = (vehicle, row.configuration)
        if not row.configuration or key in models:
            model = digest_of(models.get(key))
            cases.append(
                {"row": row.name, "model": model, "vehicle": vehicle, "track": track, "seed": seed}
            )
    return cases


def run_vehicles(
    sweep: Sweep, rows: Sequence[Row], vehicles: Sequence[str], tracks: Sequence[str]
) -> tuple[list[Record], list[Record]]:
    """Train what `rows` need for every vehicle, then fly every case.
    Returns: the records of the trainings and of the flights. Rows whose training failed do not fly.
    """
    config = campaign_config(sweep.seed, sweep.solver, sweep.duration)
    needed = [
        training_case(name, vehicle=vehicle)
        for vehicle in vehicles
        for name in configurations(rows)
    ]
    training = Training(sweep.seed, sweep.solver, vehicles=fleet())
    trainings = sweep.cases("training", "models", training, needed, config=config)
    models = {
        (r["case"]["vehicle"], r["case"]["model"]): model_of(r) for r in trainings if "result" in r
    }
    work = Flying(models, sweep.solver, sweep.duration)
    cases = flight_cases(rows, sweep.seeds, models, vehicles, tracks)
    return trainings, sweep.cases("vehicles", "flights", work, cases, config=config)


def campaign_config(training_seed: int, solver: str, duration: float = SCORED) -> dict:
    """Return all that the results depend on other than the case itself.

    Args:
        duration: of a flight, after the ramp, of the paper's vehicle [s].
    """
    return {
        "solver": solver,
        "training": TRAINING,
        "training_seed": training_seed,
        "scored": duration,
        "settling": SETTLING,
        "lost": LOST,
        "rows": {row.name: dc.asdict(row) for row in ROWS},
        "vehicles": {name: _settings(name, solver, duration) for name in VEHICLES},
    }


def _settings(vehicle: str, solver: str, duration: float) -> dict:
    """Return all settings of a vehicle's first flight, and those of its other flights and its
    training that differ.
    """
    flights = {
        track: settings_of(
            flight_config(
                {"row": "nominal", "vehicle": vehicle, "track": track},
                solver=solver,
                duration=duration,
            )
        )
        for track in TRACKS
    }
    first = flights[TRACKS[0]]
    training = settings_of(training_config(TRAINING, solver=solver, vehicle=fleet()[vehicle]))
    return {
        "flight": first,
        "tracks": {track: _differing(flight, first) for track, flight in flights.items()},
        "training": _differing(training, first),
    }


def _differing(settings: dict, base: dict) -> dict:
    """Return the settings that differ from those of `base`, which has the same names."""
    return {name: value for name, value in settings.items() if value != base[name]}


@dc.dataclass(frozen=True)
class Options(FlownOptions):
    """Options of the study."""

    seeds: Seeds = 3
    only: Annotated[
        list[str] | None,
        Option("--only", help="Only rows of these names (nominal and oracle are always flown)."),
    ] = None
    vehicle: Annotated[list[str] | None, Option(help="Only these vehicles: 35g | paper | 6kg.")] = (
        None
    )
    track: Annotated[
        list[str] | None,
        Option(help="Only these tracks: circle | fast_lemniscate | steps | vertical."),
    ] = None
    duration: Duration = 20.0


def run(run: Run, options: Options) -> Report:
    """35 g, 2 kg and 6 kg on four tracks, each trained on 60 s of its own. --out DIR: cases to
    resume from.

    Durations are those of the paper's vehicle and scale with the others.
    """
    run = sweep_of(run, options, options.duration)
    vehicles = _chosen("--vehicle", options.vehicle, VEHICLES)
    tracks = _chosen("--track", options.track, TRACKS)
    rows = choose_rows(ROWS, options.only, always=("nominal", ORACLE))
    trainings, flights = run_vehicles(run, rows, vehicles, tracks)
    require_result(flights)
    lines = vehicle_table(flights)
    config = campaign_config(run.seed, run.solver, options.duration) | {"seeds": run.seeds}
    return Report(
        vehicles_printed(lines, run.span),
        config=config,
        metrics={"table": lines, "runs": [*trainings, *flights]},
        notes=_notes(trainings, flights),
    )


def _chosen(option: str, names: Collection[str] | None, known: Sequence[str]) -> list[str]:
    """Return the known names that are asked for, all where none is.

    Raises: ValueError: on an unknown one.
    """
    if unknown := set(names or ()) - set(known):
        raise ValueError(
            f"{option}: must be one of {', '.join(known)}; got {', '.join(sorted(unknown))}."
        )
    return [name for name in known if not names or name in names]


def _notes(trainings: list[Record], flights: list[Record]) -> list[str]:
    """Return the lines under the tables: failed trainings, lost flights."""
    lost = lost_flights(flights)
    failed = sum(r["result"]["solve_failures"] for r in flights if "result" in r)
    return [
        f"{len(flights)} flights, lost or failed: {len(lost)}; failed solves: {failed}",
        *(
            f"training of {r['case']['model']}, {r['case']['vehicle']}: {r['error']}"
            for r in trainings
            if "error" in r
        ),
        *lost,
    ]
