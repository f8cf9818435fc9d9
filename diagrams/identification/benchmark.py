"""Open-loop prediction on the flights of IDSIA by the protocol of their benchmark.

Random, square and multisine flights are fitted, those called melon judge: mean errors after 1, 10
and 50 steps of 10 ms, from every row on, with rotor speed known. Source: arXiv 2512.14450, and
results/model_comparison.ipynb of github.com/idsia-robotics/nanodrone-sysid-benchmark at commit
d2b5f8a, whose figures stand in `PUBLISHED`.
"""

import dataclasses as dc
from typing import Any

import numpy as np

from diagrams.batch.campaign import Case
from diagrams.batch.run import Table
from diagrams.identification.real_sets import BENCHMARK, SETS, Folders, open_set, stated_mass
from diagrams.studies.columns import tabulate
from np_drake import attitude
from np_drake.files.number_text import NOTHING
from np_drake.flight_log import FlightLog
from np_drake.identification.identify import identify
from np_drake.identification.model import FlightModel
from np_drake.identification.prediction import ERRORS, Prediction, predict
from np_drake.identification.signals import signals
from np_drake.identification.validation import plain_least_squares, values_of_file

STEPS = (1, 10, 50)
STEP = 0.01  # [s]
JUDGING = "melon"  # how the names of the flights begin that judge
THRUST_COEFFICIENT = (
    3.72e-8  # of their physics model, whose body rates stay what they are [N/(rad/s)²]
)
MASS, G = 0.045, 9.81  # of their physics model [kg, m/s²]
# position [m], velocity [m/s], attitude [rad], rates [rad/s]; each after 1, 10, 50 steps
PUBLISHED = {
    "naive": (
        (0.0143, 0.1430, 0.6797),
        (0.0329, 0.3182, 1.4749),
        (0.0071, 0.0692, 0.3041),
        (0.0796, 0.3596, 0.8837),
    ),
    "physics": (
        (0.0013, 0.0126, 0.1269),
        (0.0080, 0.0570, 0.5781),
        (0.0011, 0.0205, 0.2544),
        (0.0796, 0.3596, 0.8837),
    ),
    "hybrid": (
        (0.0016, 0.0166, 0.1119),
        (0.0092, 0.0613, 0.5556),
        (0.0027, 0.0376, 0.2306),
        (0.0912, 0.4880, 0.5979),
    ),
    "LSTM": (
        (0.0079, 0.0390, 0.2572),
        (0.0247, 0.1175, 0.7407),
        (0.0066, 0.0372, 0.2325),
        (0.1021, 0.4292, 1.2407),
    ),
}


@dc.dataclass(frozen=True)
class BenchmarkCase:
    """Work of the case of the benchmark."""

    folders: Folders

    def __call__(self, case: Case) -> dict[str, Any]:
        """Return the mean errors (horizon, quantity) of each model over all starts of the flights
        that judge.

        Raises: LogError: if a log cannot be used.
        """
        files = self.folders.files(BENCHMARK)
        train = open_set(BENCHMARK, [f for f in files if not f.name.startswith(JUDGING)])
        judging = open_set(BENCHMARK, [f for f in files if f.name.startswith(JUDGING)])
        found = identify(train, SETS[BENCHMARK].nominal, mass=stated_mass(BENCHMARK))
        models = {
            "vehicle file": values_of_file(found),
            "least squares": plain_least_squares(found),
            "identified": found.estimate.layout.values(found.estimate.z),
        }
        errors: dict[str, list[np.ndarray]] = {}
        for log in judging:
            flight, frame = signals(log, found.prior.unmixer, found.basis.drive), found.basis.frame
            model = FlightModel(flight, frame)
            made = {
                name: predict(model, log, v, seconds=STEPS[-1] * STEP, every=STEP)
                for name, v in models.items()
            }
            some = made["identified"]
            made |= {"naive, here": stays(some, log), "physics, here": published_physics(some, log)}
            for name, prediction in made.items():
                errors.setdefault(name, []).append(prediction.errors(log)[list(STEPS)])
        pooled = {name: np.concatenate(e, axis=1).mean(axis=1) for name, e in errors.items()}
        return {
            "fitted": [log.name for log in train],
            "judging": [log.name for log in judging],
            "starts": sum(e.shape[1] for e in errors["identified"]),
            "errors": {name: e.tolist() for name, e in pooled.items()},
        }


def stays(like: Prediction, log: FlightLog) -> Prediction:
    """Return predictions that nothing moves."""
    x = np.broadcast_to(log.x[like.rows[0]], like.x.shape)
    return dc.replace(like, x=x)


def published_physics(like: Prediction, log: FlightLog) -> Prediction:
    """Return predictions of the authors' physics model: thrust from rotor speed, no drag, constant
    body rates.
    Raises: ValueError: if it has none.
    """
    if log.rotor is None:
        raise ValueError(f"{log.name}: must have rotor speed.")
    lift = THRUST_COEFFICIENT / MASS * np.sum(log.rotor**2, axis=1)
    x = log.x[like.rows[0]].copy()
    out = [x]
    for k, step in enumerate(np.diff(like.t)):
        p, q, v, w = x[:, 0:3], x[:, 3:7], x[:, 7:10], x[:, 10:13]
        half = attitude.multiply(q, attitude.from_rotation_vector(0.5 * step * w))
        a = attitude.rotate(
            half, np.stack([0 * lift[like.rows[k]]] * 2 + [lift[like.rows[k]]], axis=1)
        ) - [0.0, 0.0, G]
        turned = attitude.multiply(q, attitude.from_rotation_vector(step * w))
        x = np.concatenate([p + step * v + 0.5 * step**2 * a, turned, v + step * a, w], axis=1)
        out.append(x)
    return dc.replace(like, x=np.array(out))


def printed(result: dict[str, Any]) -> Table:
    """Return the table: a row a model, the published ones first.

    Args: result: of `BenchmarkCase`.
    """
    published = {f"{name}, published": np.array(e).T for name, e in PUBLISHED.items()}
    rows = published | {name: np.array(e) for name, e in result["errors"].items()}
    units = dict(zip(ERRORS, ("cm", "cm/s", "deg", "deg/s"), strict=True))
    factors = np.array([100.0, 100.0, 180 / np.pi, 180 / np.pi])
    lines = [{"model": name, "errors": factors * e} for name, e in rows.items()]

    def cell(i: int, j: int):
        return lambda line: (
            NOTHING if not np.isfinite(line["errors"][i, j]) else f"{line['errors'][i, j]:.3g}"
        )

    columns = [("model", "model")]
    columns += [
        (f"{STEPS[i] * STEP:g} s: {name} [{units[name]}]", cell(i, j))
        for i in (1, 2)
        for j, name in enumerate(ERRORS)
    ]
    title = (
        f"open-loop prediction by the protocol of IDSIA: mean errors from {result['starts']} starts"
    )
    return tabulate(title, lines, columns)
