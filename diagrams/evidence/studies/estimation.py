"""Studies `estimation`, the paper's Table I, one step ahead on unseen real flights, and
`sample-efficiency`, its error against training samples; our rows beside the published ones.

Source of the published rows: Jin et al. 2025, table of estimation errors on 6 held-out flights
(label MRFsum), as printed; the NeuroMHE and NeuroBEM rows, of 13 flights, are those of Wang et al.
2024, as the evaluation script in the authors' repository (NPU-RCIR/Neural-Predictor) has them.
RMSE [N, N·m].
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from diagrams.batch.run import Case, Report, Run, every_result, require
from diagrams.evidence.studies.options import NEUROBEM_FLIGHTS, Neurobem, required, tabulate
from np_drake.files.number_text import NOTHING
from np_drake.lifting.model.lifted_model import MODE_DICTIONARY, PAPER, Predictor
from np_drake.lifting.training.train import Config, make_config, train
from np_drake.logs.formats.neurobem import read_training, read_wrenches, table_files
from np_drake.residual_models.flight_forecasts import CONSTANT, flight_forecasts
from np_drake.residual_models.lifted_predictor import LiftedLinearPredictor
from np_drake.skill.skill import naive_predictions
from np_drake.training_data.segments import Segment, WrenchSequence, of_wrenches

CHANNELS = {  # of chi, in each column, in the order of the table
    "F_x": [0],
    "F_y": [1],
    "F_z": [2],
    "tau_x": [3],
    "tau_y": [4],
    "tau_z": [5],
    "F_xy": [0, 1],
    "tau_xy": [3, 4],
    "F": [0, 1, 2],
    "tau": [3, 4, 5],
}
PUBLISHED = pd.read_csv(Path(__file__).with_suffix(".csv"), index_col=["flight", "method"])
OURS = {PAPER: "np: paper", MODE_DICTIONARY: MODE_DICTIONARY}  # configuration: row
NAIVE = ("persistence", "linear")  # rows without training
UNPUBLISHED = (*OURS.values(), *NAIVE)
ROWS = ("NeuroBEM", "NeuroMHE", "NP", *UNPUBLISHED)  # in the order of the table
KEYS = {"paper": "NP", "ours": OURS[MODE_DICTIONARY], "ours_paper": OURS[PAPER]}  # of `--json`: row
KEYS |= {name: name for name in ("NeuroMHE", "NeuroBEM", *NAIVE)}
LEARNED = 4000  # samples that are trained on, ten seconds as in the paper [1]


def column_rmse(error: np.ndarray) -> dict[str, float]:
    """Return the ten columns of the table from errors (n, 6) [N, N·m].

    F_xy, F, tau_xy, tau are RMS lengths of the error vector. Rows with NaN do not count.
    Raises: ValueError: if no row without NaN is left.
    """
    error = error[np.isfinite(error).all(axis=1)]
    require(len(error) > 0, "column_rmse: the flight must have a row with a label and an estimate.")
    square = np.mean(error**2, axis=0)
    return {name: np.sqrt(square[channels].sum()) for name, channels in CHANNELS.items()}


def flights(folder: Path) -> tuple[Segment, dict[str, Segment]]:
    """Return the training segment and all other flights in the folder by their names in the paper's
    table, or of their files, see `table_files`.

    Raises: OSError, LogError: where none is there or one cannot be read.
    """

    def segment(sequence: WrenchSequence) -> Segment:
        return Segment(sequence.chi, sequence.zeta, sequence.step)

    tests = {name: segment(read_wrenches(path)) for name, path in table_files(folder).items()}
    return segment(read_training(folder)), tests


def configs(seed: int) -> dict[str, Config]:
    """Return the configurations of our rows with their usual settings for these arrays."""
    return {name: make_config(name, frame="body", seed=seed) for name in OURS}


def part(segment: Segment, start: int, stop: int) -> Segment:
    """Return the samples from `start` up to `stop`."""
    return Segment(segment.chi[start:stop], segment.zeta[start:stop], segment.step)


def forecast_errors(model: Predictor, flight: Segment, origins: np.ndarray) -> dict[str, float]:
    """Return the errors by column of forecasts of the label one step ahead, force and torque
    predicted and zeta held; ValueError if the flight is too short.
    """
    least = model.window + 2
    require(len(flight) >= least, f"at least {least} samples are needed; got {len(flight)}.")
    seen = of_wrenches(flight.chi, flight.zeta, model.step)
    first = origins[0]
    chi_hat = flight_forecasts(
        LiftedLinearPredictor.of(model), seen, [1], first=first, motion=CONSTANT, averaged=False
    )
    return column_rmse(chi_hat[origins - first, 0] - flight.chi[origins + 1])


def naive_errors(flight: Segment, origins: np.ndarray) -> dict[str, dict[str, float]]:
    """Return the same of the rows without training, by their name."""
    naive = naive_predictions(flight.chi, origins, [1], np.zeros(6))
    return {name: column_rmse(naive[name][:, 0] - flight.chi[origins + 1]) for name in NAIVE}


def flight_errors(
    case: Case, *, models: Mapping[str, Predictor], flown: Mapping[str, Segment], first: int
) -> dict:
    """Return of a case {"flight", "model": configuration} the errors by column of forecasts one
    step ahead, from every origin of the flight from the first on.
    """
    flight = flown[case["flight"]]
    model = models[case["model"]]
    return forecast_errors(model, flight, np.arange(first, len(flight) - 1))


def estimation_table(
    run: Run, models: Mapping[str, Predictor], flown: Mapping[str, Segment], config: dict
) -> pd.DataFrame:
    """Return the errors by (flight, row) and column [N, N·m], over every origin from where all
    models forecast on; NaN where a row is not published.

    Args:
        config: what the models depend on, as of `Workers.run`.
    Raises: FailedRun: where a model has no result on a flight, as when it is too short.
    """
    first = max(model.window for model in models.values())
    cases = [{"flight": flight, "model": name} for flight in flown for name in models]
    work = partial(flight_errors, models=models, flown=flown, first=first)
    results = every_result(run.cases("every origin", "", work, cases, config=config))
    errors = {
        (case["flight"], OURS[case["model"]]): result
        for case, result in zip(cases, results, strict=True)
    }
    for flight, segment in flown.items():
        naive = naive_errors(segment, np.arange(first, len(segment) - 1))
        errors |= {(flight, row): error for row, error in naive.items()}
    table = pd.concat([PUBLISHED, pd.DataFrame.from_dict(errors, "index")])
    return table.reindex(pd.MultiIndex.from_product([flown, ROWS]))


def ratios(table: pd.DataFrame, row: str) -> np.ndarray:
    """Return the ratio of a row to the published NP, in every cell that has one [1]."""
    return (table.xs(row, level=1) / table.xs("NP", level=1)).dropna().to_numpy().ravel()


def run(run: Run, neurobem: Neurobem = None) -> Report:
    """The paper's table, one step ahead. On all real flights in DIR."""
    training, tests = flights(required("estimation", neurobem, NEUROBEM_FLIGHTS))
    segments = [part(training, 0, LEARNED)]
    ours = configs(run.seed)
    with run.bar("training", 1.0):
        models = {name: train(segments, config).model for name, config in ours.items()}
    settings = {name: dc.asdict(config) for name, config in ours.items()}
    table = estimation_table(run, models, tests, settings)
    below = {row: (ratios(table, row) <= 1.0).sum() for row in UNPUBLISHED}
    shown: list[tuple] = []
    for flight in tests:
        shown.append((flight, *[""] * len(CHANNELS)))
        for row, errors in table.loc[flight].dropna().iterrows():
            shown.append((row, *(f"{1e3 * error:.3g}" for error in errors)))
    title = (
        "One step (2.5 ms) ahead on real flights, RMSE [mN, mN·m]; NeuroBEM, NeuroMHE, NP "
        "as published"
    )
    lines = [
        {"row": flight, "column": column}
        | {key: table.at[(flight, row), column] for key, row in KEYS.items()}
        for flight in tests
        for column in CHANNELS
    ]
    count = len(ratios(table, NAIVE[0]))
    return Report(
        [(title, ["", *CHANNELS], shown)],
        config={"training": "training segment", **settings},
        metrics={"table": lines, "at_or_below_the_paper": below},
        lines=[
            f"seed {run.seed}, trained on the training segment; every origin.",
            *(
                f"{row}: at or below the paper's NP in {n} of {count} cells"
                for row, n in below.items()
            ),
        ],
    )


SIZES = (1000, 2000, 3000, 4000, 5000, 6000)  # samples, as far as the segment goes [1]
# origins that are tested: behind the longest window of a model [1]
FIRST = 87
LAST = -100
KINDS = ("force", "torque")
FLIGHT = "race track 1"
# One step ahead on race track 1 [N, N·m]. The paper shows a curve without numbers; these are the
# ones that the plotting script in its authors' repository (NPU-RCIR/Neural-Predictor) draws. Its
# estimation table has 0.057 and 0.006 at 4000.
CURVE = pd.DataFrame(
    [
        ("NP", 1000, 0.357, 0.094),
        ("NP", 2000, 0.156, 0.022),
        ("NP", 3000, 0.127, 0.011),
        ("NP", 4000, 0.076, 0.007),
        ("NP", 5000, 0.078, 0.007),
        ("NP", 6000, 0.082, 0.006),
        ("NeuroMHE", 4000, 0.204, 0.009),
    ],
    columns=["row", "samples", *KINDS],
).to_dict("records")


def pieces(segment: Segment, samples: int) -> list[Segment]:
    """Return all disjoint pieces of so many samples, from the start of the segment on."""
    starts = range(0, len(segment) - samples + 1, samples)
    return [part(segment, k, k + samples) for k in starts]


def piece_errors(
    case: Case, *, training: Segment, test: Segment, configs: Mapping[str, Config]
) -> dict:
    """Return of a case {"row": configuration, "samples", "piece"} the errors of the model of that
    piece, one step ahead.
    """
    segment = pieces(training, case["samples"])[case["piece"]]
    model = train([segment], configs[case["row"]]).model
    return _lengths(forecast_errors(model, test, np.arange(FIRST, len(test) + LAST)))


def _lengths(errors: dict[str, float]) -> dict[str, float]:
    """Return the RMSE of force and torque, of errors by column."""
    return {"force": errors["F"], "torque": errors["tau"]}


def sample_efficiency(
    run: Run,
    training: Segment,
    test: Segment,
    configs: dict[str, Config],
    *,
    sizes: Sequence[int] = SIZES,
) -> list[dict]:
    """Train and test every kind of model at every size that the segment has.

    Returns: {"row", "samples": 0 for a row without training, "pieces", "force" [N], "torque"
        [N·m]: (mean, smallest, largest) over disjoint training pieces}.
    Raises: ValueError: if the training segment is shorter than all sizes; FailedRun: where a model
        has no result.
    """
    require(
        len(training) >= min(sizes),
        f"training segment: must have {min(sizes)} samples; got {len(training)}.",
    )
    cases: list[Case] = [
        {"row": name, "samples": size, "piece": piece}
        for name in configs
        for size in sizes
        for piece in range(len(pieces(training, size)))
    ]
    settings = {name: dc.asdict(config) for name, config in configs.items()}
    work = partial(piece_errors, training=training, test=test, configs=configs)
    records = run.cases("models", "", work, cases, config=settings)
    tested = [
        {"row": OURS[case["row"]], "samples": case["samples"], **result}
        for case, result in zip(cases, every_result(records), strict=True)
    ]
    naive = naive_errors(test, np.arange(FIRST, len(test) + LAST))
    tested += [{"row": row, "samples": 0, **_lengths(of)} for row, of in naive.items()]
    points = []
    for (row, samples), group in pd.DataFrame(tested).groupby(["row", "samples"], sort=False):
        spread = {kind: group[kind].agg(["mean", "min", "max"]).tolist() for kind in KINDS}
        points.append({"row": row, "samples": samples, "pieces": len(group), **spread})
    return points


def sample_study(run: Run, neurobem: Neurobem = None) -> Report:
    """Error against training samples. On race track 1."""
    training, tests = flights(required("sample-efficiency", neurobem, NEUROBEM_FLIGHTS))
    require(FLIGHT in tests, f"sample-efficiency: the folder must hold {FLIGHT}.")
    settings = configs(run.seed)
    points = sample_efficiency(run, training, tests[FLIGHT], settings)
    shown = [{**p, "row": f"{p['row']} (published)"} for p in CURVE]
    columns = (
        ("", "row"),
        ("samples", lambda line: line["samples"] or NOTHING),
        ("force [N]", lambda line: f"{np.atleast_1d(line['force'])[0]:.3g}"),
        ("torque [N·m]", lambda line: f"{np.atleast_1d(line['torque'])[0]:.3g}"),
    )
    title = f"RMSE on {FLIGHT} one step ahead, mean over disjoint pieces of the training segment"
    return Report(
        [tabulate(title, [*shown, *points], columns)],
        config={name: dc.asdict(one) for name, one in settings.items()},
        metrics={"table": points, "published": CURVE},
        lines=[f"seed {run.seed}"],
    )
