"""`np-drake reproduce payload-flights`: forecasts of the residual wrench on real flights with a payload."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from diagrams.cli import options
from diagrams.cli.runner import Report, Run, counting, reports


@reports("reproduce", seed=None, out=options.OutOfCases, many=True)
def payload_flights(
    run: Run,
    folder: Annotated[
        Path | None,
        Argument(
            metavar="DIR",
            envvar="NP_DRAKE_REAL",
            show_envvar=False,
            help="Folder with imrc/payload; or NP_DRAKE_REAL.",
        ),
    ] = None,
    step: Annotated[
        float,
        Option("--step", min=0.01, max=0.02, help="Between samples, over which labels are averaged [s]."),
    ] = 0.02,
    only: Annotated[
        list[str] | None, Option("--only", metavar="ROW", help="Only this row and persistence; repeatable.")
    ] = None,
) -> Report:
    """Forecast of force and torque on real flights with a payload, one manoeuvre left out. --out DIR: figure."""
    if folder is None:
        raise ValueError("payload-flights: give the folder of the real flights as DIR or NP_DRAKE_REAL.")
    from diagrams.challenge.real.forecast.rows import choose

    names = choose(only or ())
    from diagrams.challenge.real.forecast.bound import bound_lines
    from diagrams.challenge.real.forecast.figure import ratio_figure
    from diagrams.challenge.real.forecast.folds import DAMPINGS, open_campaign, true_estimate, true_payload
    from diagrams.challenge.real.forecast.study import persistence_rmse, run_study
    from diagrams.challenge.real.forecast.tables import bound_table, model_table, payload_table, ratio_tables

    flights = open_campaign(folder)
    with counting("training and scoring", "folds of a row") as on_progress:
        study = run_study(
            *(flights, names),
            step=step,
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
    slow = {model["row"]: sum(model["training"]) for model in models}
    tables = [*ratio_tables(lines), model_table(models, DAMPINGS, true_payload().length)]
    if study.payloads:
        tables.append(payload_table(study.payloads, true_estimate(), DAMPINGS))
    bounds = bound_lines(study.bounds, study.horizons, step) if study.bounds else []
    if bounds:
        tables.append(bound_table(bounds))
    return Report(
        tables,
        config={
            "folder": folder, "step": step, "rows": names, "manoeuvres": manoeuvres,
            "flights": [flight.log.name for flight in flights],
        },
        metrics={
            "table": lines, "models": models, "bound": bounds,
            "payloads": [{**flown._asdict(), "estimate": flown.estimate._asdict()} for flown in study.payloads],
        },
        summary=[
            f"{len(flights)} flights, {len(manoeuvres)} manoeuvres ({', '.join(manoeuvres)}), each held out in turn",
            "*: told the payload and its position: an upper limit, no predictor",
            *rmse,
        ],
        notes=[f"{row}: trained in {wall:.0f} s" for row, wall in slow.items() if wall > 1],
        figures={"payload_flights.png": lambda: ratio_figure(lines)},
    )  # fmt: skip
