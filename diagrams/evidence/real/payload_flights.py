"""Study `payload-flights`: forecasts of the residual wrench on real flights with a payload, one
manoeuvre left out.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
from numpy.lib.stride_tricks import sliding_window_view
from sklearn.linear_model import Ridge
from sklearn.preprocessing import StandardScaler
from typer import Option

from diagrams.batch.run import Report, Run, every_result, require
from diagrams.evidence.real.campaigns import block_name, campaign_of, numbered_blocks
from diagrams.evidence.scoring import table
from diagrams.evidence.studies.options import REAL_FLIGHTS, RealFlights, chosen, required
from diagrams.loop.controller_config import FILTER_MODEL, NP_MODEL
from np_drake import rigid_body
from np_drake.flight_log import FlightLog
from np_drake.labels import LabelConfig, ReadsLabels, labels, raw_labels
from np_drake.lifting.model.lifted_model import PAPER, load_model
from np_drake.lifting.training.neural_lpv import fine_tuned
from np_drake.lifting.training.train import make_config, train
from np_drake.payload_filter.model_file import PAYLOAD_FILTER, PayloadFilterModel
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.payload_filter.training import train_payload_filter
from np_drake.residual_model import Memory, ResidualModel, Sample, WrenchForecast, constant_forecast
from np_drake.residual_models.flight_forecasts import MOTIONS, flight_forecasts
from np_drake.residual_models.hold import Hold
from np_drake.residual_models.lifted_predictor import LiftedLinearPredictor
from np_drake.residual_models.motion_model import GP, MotionModel, fit_gaussian_process
from np_drake.residual_models.predictor_training import fitted_lpv
from np_drake.rotor_input import acting_command
from np_drake.training_data.accelerations import with_accelerations
from np_drake.training_data.segments import Flight, SampledFlight, Segment, check_segments
from np_drake.vehicle import Vehicle

Opened = tuple[FlightLog, Vehicle]
PERSISTENCE = "persistence"
STEP = 0.02  # between samples, over which labels are averaged [s]
HORIZONS = (1, 5, 10, 20, 30, 40, 50)  # [steps]
HISTORY = 30  # labels that every window holds, and before the first origin [steps]
KINDS = {"lateral force": slice(0, 2), "force": slice(0, 3), "torque": slice(3, 6)}  # of chi
EPOCHS = 600  # gradient steps on real flights; own choice
DRAWS = 2000  # of the flights, for the interval [1]


def sampled_flight(
    log: FlightLog, vehicle: Vehicle, label: LabelConfig | None = None
) -> SampledFlight:
    """Return the flight with labels of eq. (1) averaged over each step, which uses nothing later
    than the sample.

    Accelerations that the log lacks are differentiated first, see `with_accelerations`.

    Raises: ValueError: if the log's own step is longer, or the flight shorter than the history.
    """
    log = with_accelerations(log)
    t = log.t - log.t[0]
    count = int(t[-1] / STEP + 1e-6) + 1
    require(
        0.999 * log.step < STEP and count > HISTORY + 1,
        f"{log.name}: must have a row every {STEP:g} s and last {STEP * (HISTORY + 2):g} s; "
        f"got {log.step:.4g} s and {t[-1]:.3g} s.",
    )
    # row of time t belongs to the sample that ends its step
    samples = np.ceil(t / STEP - 1e-6).astype(int)
    last = np.searchsorted(t, STEP * np.arange(count) + 1e-6 * STEP, side="right") - 1

    def means(values: np.ndarray) -> pd.DataFrame:
        """Return the mean of the finite rows of each sample; NaN where it has none."""
        return pd.DataFrame(values, samples).dropna().groupby(level=0).mean().reindex(range(count))

    chi = means(raw_labels(log, vehicle)).to_numpy()
    u = means(acting_command(log, vehicle)).ffill().bfill().to_numpy()
    if label is not None:
        chi = np.where(np.isfinite(chi), labels(log, vehicle, label)[last], np.nan)
    return SampledFlight(STEP, log.x[last], u, chi, log.name)


# Standard deviation of noise in the features of the ridge, over that of the features [1]
NOISE = 0.1
# Channels of chi that are forecast together, and of a sample [chi, zeta] that they are forecast
# from: lateral force from itself and the lateral velocity, vertical force from force and velocity,
# torque from itself and the body rates
GROUPS = (((0, 1), (0, 1, 6, 7)), ((2,), (0, 1, 2, 6, 7, 8)), ((3, 4, 5), (3, 4, 5, 9, 10, 11)))


class RidgeBaseline:
    """Separate linear map chi_hat_h = W_h [w; 1] for each of `HORIZONS`; it ignores the coming
    zeta.

    Between them it is interpolated linearly. Until its window is full, it holds the label.

    Args:
        weights: (H, 6, 12 D + 1) of the window, oldest sample first, and of 1, in physical units.
    """

    name = "ridge"
    step = STEP

    def __init__(self, weights: np.ndarray):
        self._W = weights

    def initial_memory(self) -> Memory:
        """Return the memory before any sample: window (W, 12) of [chi, zeta], oldest first, and the
        count in it.
        """
        return {"window": np.zeros((HISTORY, 12)), "count": np.zeros(1)}

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return the memory after one more sample; one with a NaN repeats the sample before."""
        row = np.concatenate([sample.chi, rigid_body.zeta(np.asarray(sample.x, float))])
        row = np.where(np.isfinite(row), row, memory["window"][-1])
        window = np.concatenate([memory["window"][1:], row[None]])
        return {"window": window, "count": memory["count"] + 1.0}

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the forecast; until the window is full, the last label, held."""
        window = memory["window"]
        if memory["count"][0] < HISTORY:
            return constant_forecast(window[-1, :6], horizon)
        steps = stride * np.arange(horizon)
        course = self._W @ np.append(window.ravel(), 1.0)
        between = [np.interp(steps, HORIZONS, channel) for channel in course.T]
        return constant_forecast(np.stack(between, axis=1), horizon)


def fit_ridge(segments: list[Segment]) -> RidgeBaseline:
    """Fit a ridge to every origin of the segments, by groups of channels, each of which sees its
    own inputs.

    Raises: ValueError: if no segment is longer than history and horizon.
    """
    segments = check_segments(segments, HISTORY + HORIZONS[-1] + 1)
    weights = np.zeros((len(HORIZONS), 6, HISTORY, 12))
    constant = np.zeros((len(HORIZONS), 6, 1))
    for outputs, inputs in GROUPS:
        windows = []
        goals = []
        for segment in segments:
            samples = np.hstack([segment.chi, segment.zeta])[:, inputs]
            origins = np.arange(HISTORY - 1, len(samples) - HORIZONS[-1])
            window = sliding_window_view(samples, HISTORY, axis=0).transpose(0, 2, 1)
            windows.append(window[: len(origins)].reshape(len(origins), -1))
            goals.append(segment.goal[origins[:, None] + HORIZONS][..., outputs])
        goal = np.concatenate(goals)
        features = np.concatenate(windows)
        scaler = StandardScaler().fit(features)
        ridge = Ridge(NOISE**2 * len(goal)).fit(
            scaler.transform(features), goal.reshape(len(goal), -1)
        )
        W = ridge.coef_ / scaler.scale_
        level = ridge.intercept_ - W @ scaler.mean_
        size = (len(HORIZONS), len(outputs), HISTORY, len(inputs))
        weights[np.ix_(range(len(HORIZONS)), outputs, range(HISTORY), inputs)] = W.reshape(size)
        constant[:, outputs, 0] = level.reshape(len(HORIZONS), -1)
    return RidgeBaseline(np.dstack([weights.reshape(len(HORIZONS), 6, -1), constant]))


def _segments(flights: Sequence[Opened]) -> list[Segment]:
    """Return the flights as training input: labels averaged over a step, gaps of the label bridged
    by a line.
    """
    sampled = [sampled_flight(*flight) for flight in flights]
    return [
        Segment(pd.DataFrame(f.chi).interpolate(limit_direction="both").to_numpy(), f.zeta, STEP)
        for f in sampled
    ]


def _paper(flights: Sequence[Opened]) -> LiftedLinearPredictor:
    """Return the predictor of the paper with its usual settings, but for the window."""
    model = train(_segments(flights), make_config(PAPER, window=HISTORY)).model
    return LiftedLinearPredictor.of(model)


def _network(flights: Sequence[Opened]) -> LiftedLinearPredictor:
    """Return the packaged network on the vehicle of these flights."""
    opened = [Flight(log, vehicle) for log, vehicle in flights]
    return LiftedLinearPredictor.of(fitted_lpv(load_model(NP_MODEL), opened, STEP))


def _tuned_network(flights: Sequence[Opened]) -> LiftedLinearPredictor:
    """Return the packaged network after more training on these flights."""
    model = fine_tuned(_network(flights).model, _segments(flights), epochs=EPOCHS)
    return LiftedLinearPredictor.of(model)


def _payload_filter(flights: Sequence[Opened]) -> PayloadFilter:
    """Return the packaged bank on the vehicle of these flights."""
    prior = PayloadFilterModel.load(FILTER_MODEL)
    return PayloadFilter(train_payload_filter(flights, step=STEP, prior=prior))


ROWS: Mapping[str, Callable[[Sequence[Opened]], ResidualModel]] = {
    PERSISTENCE: lambda flights: Hold(step=STEP),
    "ridge": lambda flights: fit_ridge(_segments(flights)),
    GP: lambda flights: MotionModel(GP, fit_gaussian_process(_segments(flights)), STEP),
    PAPER: _paper,
    "np": _network,
    "np fine-tuned": _tuned_network,
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


def square_errors(model: ResidualModel, opened: Opened, motion: str) -> dict[str, Any]:
    """Return of forecasts on a flight the sum over origins of the squared error by kind and horizon
    [N², N²m²], and the number of origins by horizon.

    Every origin from `HISTORY` on counts whose target, the label averaged over a step, is there. A
    model that reads labels of its own low-pass gets these; the targets stay. motion: of `MOTIONS`.
    """
    flight = sampled_flight(*opened)
    label = model.label if isinstance(model, ReadsLabels) else None
    seen = sampled_flight(*opened, label)
    chi = pd.DataFrame(flight.chi)
    goal = np.stack([chi.shift(-h)[HISTORY:] for h in HORIZONS], axis=1)
    there = np.isfinite(goal).all(axis=-1)
    with np.errstate(over="ignore", invalid="ignore"):
        chi_hat = flight_forecasts(model, seen, list(HORIZONS), first=HISTORY, motion=motion)
        error = np.where(there[..., None], (chi_hat - goal) ** 2, 0.0)
    square = [error[..., part].sum(axis=(0, 2)) for part in KINDS.values()]
    return {"square": square, "count": there.sum(axis=0)}


def held_out_errors(
    case: Mapping[str, str], *, flights: Mapping[str, Sequence[Opened]]
) -> dict[str, Any]:
    """Return of a case {"manoeuvre", "row"} the errors on its flights, by coming motion and flight,
    of the row trained on the other manoeuvres.
    """
    held_out = case["manoeuvre"]
    training = [flight for name in flights if name != held_out for flight in flights[name]]
    model = ROWS[case["row"]](training)
    return {
        motion: {
            log.name: square_errors(model, (log, vehicle), motion)
            for log, vehicle in flights[held_out]
        }
        for motion in MOTIONS
    }


def pooled(errors: Mapping[tuple[str, str], Mapping[str, Mapping]]) -> list[dict[str, Any]]:
    """Return a line for every row, coming motion, kind and horizon: RMSE, its ratio to persistence
    and its interval.

    errors: (row, motion) -> flight -> `square_errors`.
    Pooled: root of all flights' squared errors over those of persistence. Interval: 95 %, from
    flights drawn with replacement (bootstrap).
    """
    names = list(next(iter(errors.values())))
    square = {key: np.array([of[name]["square"] for name in names]) for key, of in errors.items()}
    count = {key: sum(np.array(of[name]["count"]) for name in names) for key, of in errors.items()}
    times = np.random.default_rng(0).multinomial(len(names), [1 / len(names)] * len(names), DRAWS)

    def ratio(row: str, motion: str, times: np.ndarray) -> np.ndarray:
        """Return the ratio (draws, kinds, horizons) with every flight so many times."""
        drawn = np.tensordot(times, square[row, motion], 1)
        return np.sqrt(drawn / np.tensordot(times, square[PERSISTENCE, motion], 1))

    lines = []
    for row, motion in sorted(errors, key=lambda key: MOTIONS.index(key[1])):
        with np.errstate(invalid="ignore", over="ignore"):
            interval = np.percentile(ratio(row, motion, times), [2.5, 97.5], axis=0)
            (once,) = ratio(row, motion, np.ones((1, len(names))))
            rmse = np.sqrt(square[row, motion].sum(axis=0) / count[row, motion])
        lines += [
            {
                "row": row,
                "motion": motion,
                "kind": kind,
                "horizon": h * STEP,
                "rmse": rmse[k, i],
                "ratio": once[k, i],
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
    folder = required("payload-flights", folder, REAL_FLIGHTS)
    wanted = chosen("--only", only, ROWS)
    require(folder.is_dir(), f"{folder}: must be a folder of real flights; it is not there.")
    names = [name for name in ROWS if name in {PERSISTENCE, *wanted}]
    flights = open_campaign(folder)
    cases = [{"manoeuvre": manoeuvre, "row": name} for manoeuvre in flights for name in names]
    config = {"folder": folder.name, "step": STEP}
    records = run.cases(
        "training and scoring",
        "folds of a row",
        partial(held_out_errors, flights=flights),
        cases,
        config=config,
    )
    errors: dict[tuple[str, str], dict[str, Any]] = {}
    for case, result in zip(cases, every_result(records), strict=True):
        for motion, by_flight in result.items():
            errors.setdefault((case["row"], motion), {}).update(by_flight)
    lines = pooled(errors)
    flown = [log.name for of in flights.values() for log, _ in of]
    frame = pd.DataFrame(lines)
    half = frame["interval"].map(lambda bounds: 0.5 * (bounds[1] - bounds[0]))
    frame["cell"] = [f"{r:.3g}±{h:.2g}" for r, h in zip(frame["ratio"], half, strict=True)]
    frame["ahead"] = frame["horizon"].map("{:.3g} s".format)
    return Report(
        [
            shown
            for (motion, kind), part in frame.groupby(["motion", "kind"], sort=False)
            for shown in table(
                f"{kind}: RMSE over that of persistence (± half of the 95 % interval), coming "
                f"motion {motion}",
                part.pivot(index="row", columns="ahead", values="cell").loc[names].reset_index(),
            )
        ],
        config={**config, "rows": names, "manoeuvres": list(flights), "flights": flown},
        metrics={"table": lines},
        summary=[
            f"{len(flown)} flights, {len(flights)} manoeuvres ({', '.join(flights)}), each held "
            "out in turn"
        ],
    )
