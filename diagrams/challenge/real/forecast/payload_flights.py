"""Study `payload-flights`: forecasts of the residual wrench on real flights with a payload."""

import dataclasses as dc
from typing import Annotated

from typer import Option

from diagrams.batch.run import Report, Run
from diagrams.challenge.real.forecast.figure import ratio_figure
from diagrams.challenge.real.forecast.folds import DAMPINGS, open_campaign, true_estimate
from diagrams.challenge.real.forecast.rows import choose
from diagrams.challenge.real.forecast.study import run_study
from diagrams.challenge.real.forecast.tables import (
    divergence_table,
    payload_table,
    persistence_rmse,
    ratio_tables,
)
from diagrams.studies.options import RealFlights, required


@dc.dataclass(frozen=True)
class Options:
    """Options of the study."""

    folder: RealFlights = None
    step: Annotated[
        float,
        Option(
            "--step",
            min=0.01,
            max=0.02,
            help="Between samples, over which labels are averaged [s].",
        ),
    ] = 0.02
    only: Annotated[
        list[str] | None,
        Option("--only", metavar="ROW", help="Only this row and persistence; repeatable."),
    ] = None


def run(run: Run, options: Options) -> Report:
    """Forecast of force and torque on real flights with a payload, one manoeuvre left out. --out
    DIR: figure.
    """
    missing = "payload-flights: give the folder of the real flights as DIR or NP_DRAKE_REAL."
    folder = required(options.folder, missing)
    names, flights = choose(options.only or ()), open_campaign(folder)
    with run.counting("training and scoring", "folds of a row") as on_progress:
        study = run_study(
            flights,
            names,
            step=options.step,
            folder=folder.name,
            workers=run.workers,
            on_progress=on_progress,
        )
    lines, models = study.lines(), study.models()
    manoeuvres = list(dict.fromkeys(flight.manoeuvre for flight in flights))
    rmse = [
        f"persistence, {kind}, RMSE: {', '.join(f'{1e3 * value:.3g}' for value in values)} "
        f"m{'N·m' if kind == 'torque' else 'N'}"
        for kind, values in persistence_rmse(lines).items()
    ]
    walls = {row: sum(each) for row, each in study.walls.items()}
    tables = [*ratio_tables(lines), divergence_table(models)]
    if study.payloads:
        tables.append(payload_table(study.payloads, true_estimate(), DAMPINGS))
    return Report(
        tables,
        config={
            "folder": folder,
            "step": options.step,
            "rows": names,
            "manoeuvres": manoeuvres,
            "flights": [flight.log.name for flight in flights],
        },
        metrics={
            "table": lines,
            "models": models,
            "payloads": [
                {**flown._asdict(), "estimate": flown.estimate._asdict()}
                for flown in study.payloads
            ],
        },
        summary=[
            (
                f"{len(flights)} flights, {len(manoeuvres)} manoeuvres "
                f"({', '.join(manoeuvres)}), each held out in turn"
            ),
            "*: told the payload and its position: an upper limit, no predictor",
            *rmse,
        ],
        notes=[f"{row}: trained in {wall:.0f} s" for row, wall in walls.items() if wall > 1],
        figures={"payload_flights.png": lambda: ratio_figure(lines)},
    )
