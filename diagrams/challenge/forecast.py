"""Study `payload-flights`: forecasts of the residual wrench on real flights with a payload, one
manoeuvre left out.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
from typer import Option

from diagrams.batch.run import Report, Run, every_result, require
from diagrams.challenge.real import block_name, campaign_of, numbered_blocks
from diagrams.challenge.score_tables import table
from diagrams.loop.controller_config import FILTER_MODEL
from diagrams.studies.options import REAL_FLIGHTS, RealFlights, chosen, required
from np_drake.flight_log import FlightLog
from np_drake.labels import ReadsLabels
from np_drake.lifting.model.lifted_model import PAPER
from np_drake.lifting.training.train import make_config, train
from np_drake.payload_filter.model_file import PAYLOAD_FILTER, PayloadFilterModel
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.payload_filter.training import train_payload_filter
from np_drake.residual_model import ResidualModel
from np_drake.residual_models.flight_forecasts import MOTIONS, flight_forecasts
from np_drake.residual_models.hold import Hold
from np_drake.residual_models.linear_baselines import fit_force_ridge
from np_drake.residual_models.motion_model import GP, MotionModel, fit_gaussian_process
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.training_data.segments import Segment, sampled_flight
from np_drake.vehicle import Vehicle

Opened = tuple[FlightLog, Vehicle]
PERSISTENCE = "persistence"
STEP = 0.02  # between samples, over which labels are averaged [s]
HORIZONS = (1, 5, 10, 20, 30, 40, 50)  # [steps]
HISTORY = 30  # labels that every window holds, and before the first origin [steps]
KINDS = {"lateral force": slice(0, 2), "force": slice(0, 3), "torque": slice(3, 6)}  # of chi
DRAWS = 2000  # of the flights, for the interval [1]


def _segments(flights: Sequence[Opened]) -> list[Segment]:
    """Return the flights as training input, with labels averaged over a step."""
    return [sampled_flight(log, vehicle, step=STEP).segment for log, vehicle in flights]


def _paper(flights: Sequence[Opened]) -> NeuralPredictor:
    """Return the predictor of the paper with its usual settings, but for the window."""
    model = train(_segments(flights), make_config(PAPER, window=HISTORY)).model
    return NeuralPredictor(model)


def _payload_filter(flights: Sequence[Opened]) -> PayloadFilter:
    """Return the packaged bank on the vehicle of these flights."""
    prior = PayloadFilterModel.load(FILTER_MODEL)
    return PayloadFilter(train_payload_filter(flights, step=STEP, prior=prior))


ROWS: Mapping[str, Callable[[Sequence[Opened]], ResidualModel]] = {
    PERSISTENCE: lambda flights: Hold(step=STEP),
    "ridge": lambda flights: fit_force_ridge(
        _segments(flights), span=STEP * HISTORY, horizon=STEP * HORIZONS[-1]
    ),
    GP: lambda flights: MotionModel(GP, fit_gaussian_process(_segments(flights)), STEP),
    PAPER: _paper,
    PAYLOAD_FILTER: _payload_filter,
}


def open_campaign(folder: Path) -> dict[str, list[Opened]]:
    """Return the flights with a payload in a folder as `reproduce real` takes, by manoeuvre.

    Raises: ValueError: if there are not two manoeuvres; LogError: if a log cannot be used.
    """
    campaign = campaign_of("payload")
    blocks = numbered_blocks(campaign.files(folder))
    require(
        len(blocks) >= 2,
        f"{folder / campaign.patterns[0]}: must be flights of two manoeuvres (runs of "
        f"numbers); got {len(blocks)}.",
    )
    return {
        block_name(block): [(log, campaign.nominal) for log in campaign.logs(block)]
        for block in blocks
    }


def square_errors(model: ResidualModel, opened: Opened, motion: str) -> dict[str, list]:
    """Return of forecasts on a flight the sum over origins of the squared error by kind and horizon
    [N², N²m²], and the number of origins by horizon.

    Every origin from `HISTORY` on counts whose target, the label averaged over a step, is there. A
    model that reads labels of its own low-pass gets these; the targets stay. motion: of `MOTIONS`.
    """
    flight = sampled_flight(*opened, step=STEP)
    label = model.label if isinstance(model, ReadsLabels) else None
    seen = sampled_flight(*opened, step=STEP, label=label)
    goal = np.full((len(flight) - HISTORY, len(HORIZONS), 6), np.nan)
    for i, h in enumerate(HORIZONS):
        goal[: max(len(flight) - HISTORY - h, 0), i] = flight.chi[HISTORY + h :]
    there = np.isfinite(goal).all(axis=-1)
    with np.errstate(over="ignore", invalid="ignore"):
        chi_hat = flight_forecasts(model, seen, list(HORIZONS), first=HISTORY, motion=motion)
        error = np.where(there[..., None], (chi_hat - goal) ** 2, 0.0)
    square = [error[..., part].sum(axis=(0, 2)).tolist() for part in KINDS.values()]
    return {"square": square, "count": there.sum(axis=0).tolist()}


def held_out_errors(
    case: Mapping[str, str], *, flights: Mapping[str, Sequence[Opened]]
) -> dict[str, Any]:
    """Return of a case {"manoeuvre", "row"} the errors on its flights, by coming motion and flight,
    of the row trained on the other manoeuvres.
    """
    held_out = case["manoeuvre"]
    learned = [own for name, some in flights.items() if name != held_out for own in some]
    model, shown = ROWS[case["row"]](learned), flights[held_out]
    return {m: {own[0].name: square_errors(model, own, m) for own in shown} for m in MOTIONS}


def pooled(found: Mapping[tuple[str, str], Mapping[str, Mapping]]) -> list[dict[str, Any]]:
    """Return a line for every row, coming motion, kind and horizon: RMSE, its ratio to persistence
    and its interval.

    found: (row, motion) -> flight -> `square_errors`.
    Pooled: root of all flights' squared errors over those of persistence. Interval: 95 %, from
    flights drawn with replacement (bootstrap).
    """
    flights, lines = list(next(iter(found.values()))), []
    even = [1 / len(flights)] * len(flights)
    drawn = np.random.default_rng(0).multinomial(len(flights), even, DRAWS)
    by_motion = sorted(found.items(), key=lambda item: MOTIONS.index(item[0][1]))
    for (row, motion), own in by_motion:
        square, base = (
            np.array([of[flight]["square"] for flight in flights])
            for of in (own, found[PERSISTENCE, motion])
        )
        count = np.sum([own[flight]["count"] for flight in flights], axis=0)
        with np.errstate(invalid="ignore", over="ignore"):
            drawn_ratio = np.sqrt(np.tensordot(drawn, square, 1) / np.tensordot(drawn, base, 1))
            interval = np.percentile(drawn_ratio, [2.5, 97.5], axis=0)
            ratio = np.sqrt(square.sum(axis=0) / base.sum(axis=0))
            rmse = np.sqrt(square.sum(axis=0) / count)
        lines += [
            {
                **{"row": row, "motion": motion, "kind": kind, "horizon": h * STEP},
                "rmse": float(rmse[k, i]),
                "ratio": float(ratio[k, i]),
                "interval": interval[:, k, i].tolist(),
            }
            for k, kind in enumerate(KINDS)
            for i, h in enumerate(HORIZONS)
        ]
    return lines


def run(
    run: Run,
    folder: RealFlights = None,
    only: Annotated[
        list[str] | None,
        Option("--only", metavar="ROW", help="Only this row and persistence; repeatable."),
    ] = None,
) -> Report:
    """Forecast of force and torque on real flights with a payload, one manoeuvre left out."""
    folder, wanted = required("payload-flights", folder, REAL_FLIGHTS), chosen("--only", only, ROWS)
    require(folder.is_dir(), f"{folder}: must be a folder of real flights; it is not there.")
    names = [name for name in ROWS if name in {PERSISTENCE, *wanted}]
    flights = open_campaign(folder)
    cases = [{"manoeuvre": manoeuvre, "row": name} for manoeuvre in flights for name in names]
    title, config = "training and scoring", {"folder": folder.name, "step": STEP}
    records = run.cases(
        title, "folds of a row", partial(held_out_errors, flights=flights), cases, config=config
    )
    found: dict[tuple[str, str], dict[str, Any]] = {}
    for case, result in zip(cases, every_result(records), strict=True):
        for motion, own in result.items():
            found.setdefault((case["row"], motion), {}).update(own)
    lines, flown = pooled(found), [log.name for some in flights.values() for log, _ in some]
    frame = pd.DataFrame(lines)
    half = frame["interval"].map(lambda bounds: 0.5 * (bounds[1] - bounds[0]))
    frame["cell"] = [f"{r:.3g}±{h:.2g}" for r, h in zip(frame["ratio"], half, strict=True)]
    frame["ahead"] = frame["horizon"].map("{:.3g} s".format)
    return Report(
        [
            made
            for (motion, kind), own in frame.groupby(["motion", "kind"], sort=False)
            for made in table(
                f"{kind}: RMSE over that of persistence (± half of the 95 % interval), coming "
                f"motion {motion}",
                own.pivot(index="row", columns="ahead", values="cell")
                .reindex(index=names)
                .reset_index()
                .to_dict("records"),
            )
        ],
        config={**config, "rows": names, "manoeuvres": list(flights), "flights": flown},
        metrics={"table": lines},
        summary=[
            f"{len(flown)} flights, {len(flights)} manoeuvres ({', '.join(flights)}), each held "
            "out in turn"
        ],
    )
