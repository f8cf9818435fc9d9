"""The paper's estimation table: one step ahead on unseen real flights, our rows beside the
published ones.
"""

import dataclasses as dc
from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from diagrams.batch.campaign import Case
from diagrams.batch.columns import grouped
from diagrams.batch.options import Neurobem
from diagrams.batch.run import Report, Run
from diagrams.batch.workers import every_result
from diagrams.prediction import estimation_figures as figures
from diagrams.prediction.array_flights import (
    NAIVE,
    OURS,
    Flight,
    arrays,
    forecasts,
    settings_lines,
    trained,
)
from np_drake.estimation.wrench_table import COLUMNS, PUBLISHED, column_rmse
from np_drake.lifting.model.lifted_model import BY_AXES, PAPER, LiftedModel
from np_drake.skill.flight_skill import WindowStability, stability_of
from np_drake.skill.skill import naive_predictions

METHODS = ("NeuroBEM", "NeuroMHE", "NP")  # as published
ROWS = (*METHODS, *OURS.values(), *NAIVE)  # in the order of the table
KEYS = {  # of `--json`: row
    "paper": "NP",
    "ours": OURS[BY_AXES["body"]],
    "ours_paper": OURS[PAPER],
    **{name: name for name in ("NeuroMHE", "NeuroBEM", *NAIVE)},
}


@dc.dataclass(frozen=True)
class EstimationTable:
    """Errors of all rows on all flights.

    cells: flight -> row -> column -> RMSE [N, N·m].
    stability: configuration -> flight.
    origins: number of a flight.
    """

    cells: dict[str, dict[str, dict[str, float]]]
    stability: dict[str, dict[str, WindowStability]]
    origins: dict[str, int]

    def ratios(self, row: str) -> np.ndarray:
        """Return the ratio of a row to the published NP, of every cell in which that is published
        [1].
        """
        return np.array(
            [
                rows[row][c] / rows["NP"][c]
                for rows in self.cells.values()
                if "NP" in rows
                for c in COLUMNS
            ]
        )

    def at_or_below(self, row: str) -> int:
        """Return the number of cells in which a row is at or below the published NP."""
        return int((self.ratios(row) <= 1.0).sum())

    def lines(self) -> list[dict]:
        """Return one line a flight and column, as `--json` has them.

        `paper` is its NP, `ours` the configuration that suits these arrays; None: not published.
        """
        return [
            {
                "row": flight,
                "column": column,
                **{key: rows[name][column] if name in rows else None for key, name in KEYS.items()},
            }
            for flight, rows in self.cells.items()
            for column in COLUMNS
        ]


def estimation_table(
    run: Run, models: dict[str, LiftedModel], flown: Sequence[Flight], config: dict
) -> EstimationTable:
    """Return the errors of every flight, row and column, over every origin from where all models
    forecast on.

    Args:
        config: what the models depend on, as of `run_campaign`.
    Raises: FailedRun: where a model has no result on a flight, as when it is too short.
    """
    first = max(model.warm_up for model in models.values())
    cases = [{"flight": flight.name, "model": name} for flight in flown for name in models]
    records = run.cases(
        "every origin", "", Forecasting(models, tuple(flown), first), cases, config=config
    )
    results = {
        (case["flight"], case["model"]): result
        for case, result in zip(cases, every_result(records), strict=True)
    }
    cells, origins_of = {}, {}
    for flight in flown:
        origins_of[flight.name] = len(_origins(flight, first))
        published = PUBLISHED.get(flight.name, {})
        rows = {
            method: dict(zip(COLUMNS, values, strict=True)) for method, values in published.items()
        }
        rows |= _naive(flight, first)
        rows |= {OURS[name]: results[flight.name, name]["errors"] for name in models}
        cells[flight.name] = {name: rows[name] for name in ROWS if name in rows}
    stability = {
        name: {
            flight.name: WindowStability(**results[flight.name, name]["stability"])
            for flight in flown
        }
        for name in models
    }
    return EstimationTable(cells, stability, origins_of)


@dc.dataclass(frozen=True)
class Forecasting:
    """Work of a case {"flight", "model": configuration} -> errors by column, and the stability of
    its windows.

    first: origin [1].
    """

    models: dict[str, LiftedModel]
    flown: tuple[Flight, ...]
    first: int

    def __call__(self, case: Case) -> dict:
        """Forecast one step ahead from every origin of the flight.

        Raises: ValueError: if it is too short.
        """
        flight = next(flight for flight in self.flown if flight.name == case["flight"])
        chi, origins = flight.segment.chi, _origins(flight, self.first)
        course = forecasts(self.models[case["model"]], flight)
        chi_hat = course.at([1], origins, flight.segment.zeta, zeta_known=False)
        errors = column_rmse(chi_hat[:, 0] - chi[origins + 1])
        return {"errors": errors, "stability": dc.asdict(stability_of(course))}


def _origins(flight: Flight, first: int) -> np.ndarray:
    return np.arange(first, len(flight.segment.chi) - 1)


def _naive(flight: Flight, first: int) -> dict[str, dict[str, float]]:
    """Return the errors of predictors without training, by column."""
    chi, origins = flight.segment.chi, _origins(flight, first)
    chi_hat = naive_predictions(chi, origins, [1], np.zeros(6))
    return {name: column_rmse(chi_hat[name][:, 0] - chi[origins + 1]) for name in NAIVE}


MILLI = 1e3  # small errors in mN and mN·m, three digits each
SHOWN = "random points"  # the flight of which the paper shows ten seconds


@dc.dataclass(frozen=True)
class Options:
    """Options of the study."""

    neurobem: Neurobem = None


def run(run: Run, options: Options) -> Report:
    """The paper's table, one step ahead. On all real flights in DIR; --out DIR: ten seconds as a
    figure.
    """
    training, *tests = arrays("estimation", options.neurobem)
    shown = [
        flight for flight in tests if flight.name == SHOWN
    ]  # one, or none where it is not in the folder
    if run.out is not None:
        for flight in shown:
            figures.rows_of(flight)  # before the long work
    models, settings = trained(run, training)
    table = estimation_table(run, models, tests, settings)
    of_flight = {
        flight: [
            (name, *(f"{MILLI * values[c]:.3g}" for c in COLUMNS)) for name, values in cells.items()
        ]
        for flight, cells in table.cells.items()
    }
    title = (
        "One step (2.5 ms) ahead on real flights, RMSE [mN, mN·m]; NeuroBEM, NeuroMHE, NP "
        "as published"
    )
    return Report(
        [grouped(title, ["", *COLUMNS], of_flight)],
        config={"training": training.name, **settings},
        metrics={
            "table": table.lines(),
            "at_or_below_the_paper": {row: table.at_or_below(row) for row in _own_rows()},
            "stability": {
                name: {flight: dc.asdict(found) for flight, found in of.items()}
                for name, of in table.stability.items()
            },
        },
        lines=[*_lines(table, training.name, run.seed), *settings_lines(settings)],
        figures={
            f"{flight.name.replace(' ', '_')}.png": partial(_figure, models, flight, run.seed)
            for flight in shown
        },
    )


def _figure(models: dict[str, LiftedModel], flight: Flight, seed: int) -> Figure:
    span = f"{flight.name}, {figures.SPAN[0]:g} to {figures.SPAN[1]:g} s"
    window = figures.window({OURS[name]: model for name, model in models.items()}, flight)
    return figures.window_figure(
        window, f"{span} · trained on ten seconds of circling, seed {seed}"
    )


def _own_rows() -> list[str]:
    return [*OURS.values(), *NAIVE]


def _lines(table: EstimationTable, training: str, seed: int) -> list[str]:
    """Return the lines above the table."""
    said = [
        f"seed {seed}, trained on the {training}; {sum(table.origins.values())} origins, every one."
    ]
    for row in _own_rows():
        ratios = table.ratios(row)
        said.append(
            f"{row}: at or below the paper's NP in {table.at_or_below(row)} of {len(ratios)} cells"
            + (f", at most {ratios.max():.3f} of it" if len(ratios) else "")
        )
    for name, of in table.stability.items():
        windows, unstable = (
            sum(getattr(s, key) for s in of.values()) for key in ("windows", "unstable")
        )
        largest, pulled = max(s.largest for s in of.values()), sum(s.pulled for s in of.values())
        said.append(
            (
                f"{name}: {unstable} of {windows} windows with a spectral radius above 1, "
                f"largest {largest:.6f}"
            )
            + (f"; the refit of {pulled} was made stable" if pulled else "")
        )
    return said
