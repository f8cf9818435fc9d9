"""Lag of a prediction behind the label in the aggressive parts of the real flights."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from diagrams.batch.campaign import Case
from diagrams.batch.options import Neurobem
from diagrams.batch.run import Report, Run
from diagrams.batch.workers import every_result
from diagrams.prediction.array_flights import (
    NAIVE,
    OURS,
    Flight,
    arrays,
    forecasts,
    settings_lines,
    trained,
)
from np_drake.lifting.model.lifted_model import BY_AXES, LiftedModel
from np_drake.lifting.training.train import Config, make_config, train
from np_drake.residual_model import FlightForecasts
from np_drake.skill.response import aggressive, lag
from np_drake.skill.skill import mean_interval, naive_predictions

HORIZONS = (20, 40)  # [steps]
UNSEEN = "np, other flights"  # trained on every flight but the evaluated one
FIRST = 87  # first origin: the longest window of a model [1]
GROUPS = {"force": slice(0, 3), "torque": slice(3, 6)}  # channels of chi


def response_lines(
    run: Run,
    models: dict[str, LiftedModel],
    training: Flight,
    tests: Sequence[Flight],
    *,
    config: Config,
    settings: dict,
    horizons: Sequence[int] = HORIZONS,
) -> list[dict]:
    """Return one line a flight, row and horizon.

    Its fields are force_lag and torque_lag [s] (NaN: none), force_correlation, torque_correlation
    [1].

    Args:
        settings: what the models depend on, as `config` of `run_campaign`.
        horizons: [steps].
    Raises: FailedRun: where a flight has no result.
    """
    work = Lagging(models, training, tuple(tests), config, tuple(horizons))
    cases = [{"flight": flight.name} for flight in tests]
    records = run.cases("flights", "", work, cases, config={"horizons": horizons, **settings})
    return [_read(line) for result in every_result(records) for line in result["lines"]]


@dc.dataclass(frozen=True)
class Lagging:
    """Work of a case {"flight"} -> its lines, see `response_lines`."""

    models: dict[str, LiftedModel]
    training: Flight
    tests: tuple[Flight, ...]
    config: Config
    horizons: tuple[int, ...]

    def __call__(self, case: Case) -> dict:
        """Forecast along the flight, and find the lag of every forecast."""
        flight = next(flight for flight in self.tests if flight.name == case["flight"])
        chi, horizons = flight.segment.chi, list(self.horizons)
        origins = np.arange(FIRST, len(chi) - max(horizons))
        predictions = {
            row: course.at(horizons, origins, flight.segment.zeta, zeta_known=False)
            for row, course in self._courses(flight).items()
        }
        naive = naive_predictions(chi, origins, horizons, np.zeros(6))
        predictions |= {row: naive[row] for row in NAIVE}
        wanted = aggressive(flight.jerk)
        lines = [
            {"flight": flight.name, "row": row, "horizon": h * flight.segment.step}
            | _lags(chi_hat[:, i], origins + h, flight, wanted, h)
            for row, chi_hat in predictions.items()
            for i, h in enumerate(horizons)
        ]
        return {"lines": lines}

    def _courses(self, flight: Flight) -> dict[str, FlightForecasts]:
        """Return the forecasts of every trained row, one of them trained on all other flights."""
        courses = {OURS[name]: forecasts(model, flight) for name, model in self.models.items()}
        others = [other.segment for other in (self.training, *self.tests) if other is not flight]
        return {**courses, UNSEEN: forecasts(train(others, self.config).model, flight)}


def _read(line: dict) -> dict:
    """Return a line as computed from a record: what has no value is NaN."""
    return {name: np.nan if value is None else value for name, value in line.items()}


def _lags(
    chi_hat: np.ndarray, instants: np.ndarray, flight: Flight, wanted: np.ndarray, h: int
) -> dict:
    """Return the lags of predictions (o, 6) for the `instants` (o,) among the `wanted` (n,) samples
    of a flight.
    """
    prediction = np.full_like(flight.segment.chi, np.nan)
    prediction[instants] = chi_hat
    rows = instants[wanted[instants]]
    found = {}
    for kind, group in GROUPS.items():
        answer = lag(prediction[:, group], flight.segment.chi[:, group], rows, reach=2 * h + 20)
        found[f"{kind}_lag"] = answer.steps * flight.segment.step
        found[f"{kind}_correlation"] = answer.correlation
    return found


def printed(lines: list[dict]) -> tuple[str, list[str], list[tuple]]:
    """Return title, header and rows of the table.

    They hold the mean over flights, its 95 % interval, and the number of flights where there is a
    lag at all.
    """
    rows, horizons = [], sorted({line["horizon"] for line in lines})
    for row in dict.fromkeys(line["row"] for line in lines):
        cells = []
        for kind in GROUPS:
            for horizon in horizons:
                of = [line for line in lines if (line["row"], line["horizon"]) == (row, horizon)]
                cells.append(_cell(of, kind))
        rows.append((row, *cells))
    header = ["", *(f"{kind}, {1e3 * h:.3g} ms ahead" for kind in GROUPS for h in horizons)]
    title = (
        "lag behind the label [ms] where jerk is in its top decile (correlation at that "
        "lag), mean over flights"
    )
    return title, header, rows


def _cell(lines: list[dict], kind: str) -> str:
    lags = 1e3 * np.array([line[f"{kind}_lag"] for line in lines])
    correlation = np.mean([line[f"{kind}_correlation"] for line in lines])
    found = lags[np.isfinite(lags)]
    if len(found) == 0:
        return f"none ({correlation:.2f})"
    mean, low, high = mean_interval(found)
    spread = f" ±{(high - low) / 2:.1f}" if len(found) > 1 else ""
    missing = f", {len(lags) - len(found)} without" if len(found) < len(lags) else ""
    return f"{mean:.1f}{spread} ({correlation:.2f}{missing})"


@dc.dataclass(frozen=True)
class Options:
    """Options of the study."""

    neurobem: Neurobem = None


def run(run: Run, options: Options) -> Report:
    """How late the prediction is. Its lag behind the label where jerk is largest."""
    training, *tests = arrays("response", options.neurobem)
    models, settings = trained(run, training)
    config = make_config(BY_AXES["body"], frame="body", seed=run.seed)
    lines = response_lines(run, models, training, tests, config=config, settings=settings)
    said = [f"seed {run.seed}", *settings_lines(settings)]
    return Report([printed(lines)], config=settings, metrics={"table": lines}, lines=said)
