"""Theorem 1 on real flights: the bound, computed first, against the error that followed, in every
window.
"""

import dataclasses as dc
from typing import Annotated

import numpy as np
from typer import Option

from diagrams.batch.campaign import Case
from diagrams.batch.options import Neurobem
from diagrams.batch.run import Report, Run
from diagrams.batch.workers import failures, results
from diagrams.prediction.array_flights import Flight, arrays, trained
from np_drake.lifting.error_bound import BoundCheck, check_flight, largest_changes
from np_drake.lifting.model.lifted_model import LiftedModel

STEPS = (1, 10, 40)  # ahead, at which the tightness is shown [1]
FORESEEN_SPACING = 10  # samples between windows where the alphas come from the other flights [1]
OWN, FORESEEN = "own", "others"  # sources of the alphas


@dc.dataclass(frozen=True)
class _Task:
    """One check: a model, a flight, and the source of the alphas."""

    model: str
    flight: str
    alpha: str
    arguments: dict


def bound_table(
    run: Run, models: dict[str, LiftedModel], flown: list[Flight], *, spacing: int, config: dict
) -> list[dict]:
    """Return one line for every model, flight and source of the alphas, and one for every broken
    model.

    Lines without a result are missing; the records of the run's workers say why.

    Args:
        spacing: samples between windows; 1 is every window.
        config: what the models depend on, as of `run_campaign`.
    Raises: FailedRun: if no line has a result.
    """
    tasks = [task for name, model in models.items() for task in _tasks(name, model, flown, spacing)]
    cases = [{"model": task.model, "flight": task.flight, "alpha": task.alpha} for task in tasks]
    work, settings = _Checking(tuple(tasks)), {"spacing": spacing, **config}
    records = run.cases("every window", "", work, cases, config=settings)
    return [_read(line) for line in results(records)]


@dc.dataclass(frozen=True)
class _Checking:
    """Work of a case {"model", "flight", "alpha"} -> its line."""

    tasks: tuple[_Task, ...]

    def __call__(self, case: Case) -> dict:
        named = (case["model"], case["flight"], case["alpha"])
        return _line(
            next(task for task in self.tasks if (task.model, task.flight, task.alpha) == named)
        )


def _read(line: dict) -> dict:
    """Return a line as computed from a record: steps are numbers, and what has no value is NaN."""

    def number(value: float | None) -> float:
        return np.nan if value is None else value

    tightness = {
        kind: {int(step): [number(v) for v in values] for step, values in of.items()}
        for kind, of in line["tightness"].items()
    }
    plain = {name: number(value) for name, value in line.items() if name != "tightness"}
    return {**plain, "tightness": tightness}


def _tasks(name: str, model: LiftedModel, flown: list[Flight], spacing: int) -> list[_Task]:
    changes = [_changes(model, flight) for flight in flown]
    tasks = []
    for i, flight in enumerate(flown):
        others = [change for j, change in enumerate(changes) if j != i]
        foreseen = tuple(np.max([change[part] for change in others], axis=0) for part in (0, 1))
        sources = [(OWN, changes[i], spacing)]
        if others:
            sources.append((FORESEEN, foreseen, max(spacing, FORESEEN_SPACING)))
        for source, alpha, every in sources:
            arguments = {"model": model, "alpha": alpha, "spacing": every}
            tasks.append(_Task(name, flight.name, source, {**_arrays(flight), **arguments}))
    return tasks


def _changes(model: LiftedModel, flight: Flight) -> tuple[np.ndarray, np.ndarray]:
    return largest_changes(model, flight.segment.chi, flight.segment.zeta)


def _arrays(flight: Flight) -> dict[str, np.ndarray]:
    return {"chi": flight.segment.chi, "zeta": flight.segment.zeta}


def _line(task: _Task) -> dict:
    found: BoundCheck = check_flight(**task.arguments)
    line = {
        "model": task.model,
        "flight": task.flight,
        "alpha": task.alpha,
        "windows": found.windows,
        "holds": found.holds,
        "premise": found.premise,
        "holds_on_premise": found.holds_on_premise,
        "c": float(np.median(found.c)),
        "residual": float(np.median(found.residual)),
        "alpha_chi": found.alpha_chi,
        "alpha_zeta": found.alpha_zeta,
        "lipschitz": found.lipschitz,
        "spectral_radius": found.spectral_radius,
        "violated": found.violated,
    }
    return line | {
        "tightness": {kind: {n: found.tightness(kind, n) for n in STEPS} for kind in found.ratio}
    }


def assumption_lines(lines: list[dict]) -> list[str]:
    """Return what was verified, one line a model, and which assumption was violated where."""
    said = []
    for name in dict.fromkeys(line["model"] for line in lines):
        of = [line for line in lines if line["model"] == name]
        L, radius = (
            max(line["lipschitz"] for line in of),
            max(line["spectral_radius"] for line in of),
        )
        said.append(
            f"{name}: Lipschitz constant {L:.4g}, largest spectral radius of a window's A "
            f"{radius:.6f}."
        )
        for line in (line for line in of if line["violated"]):
            parts = ", ".join(
                f"{what} in {_percent(share)} %" for what, share in line["violated"].items()
            )
            said.append(f"  {line['flight']}, alphas {line['alpha']}: violated: {parts} of windows")
    return said


def printed(lines: list[dict]) -> tuple[str, list[str], list[tuple]]:
    """Return title, header and rows of the table; every model has a line before its flights."""

    def ratio(line: dict, kind: str, n: int) -> str:
        return " / ".join(
            f"{v:.3g}" if v < 1000 else f"{v:.0f}" for v in line["tightness"][kind][n]
        )

    rows: list[tuple] = []
    model = None
    for line in lines:
        if line["model"] != model:
            model = line["model"]
            rows.append((model, *("" for _ in range(7))))
        rows.append(
            (
                f"  {line['flight']}",
                line["alpha"],
                str(line["windows"]),
                f"{_percent(line['premise'])} / {_percent(line['holds_on_premise'])}",
                f"{line['c']:.3g}",
                ratio(line, "z", STEPS[0]),
                ratio(line, "z", STEPS[-1]),
                ratio(line, "chi", STEPS[-1]),
            )
        )
    ends = [f"E_{STEPS[0]}", f"E_{STEPS[-1]}", f"chi_{STEPS[-1]}"]
    header = ["model, flight", "alphas", "windows", "premise / holds %", "c", *ends]
    return "bound over error, median / 95 %", header, rows


def _percent(share: float) -> str:
    return f"{100 * share:.4g}" if share == share else "–"


@dc.dataclass(frozen=True)
class Options:
    """Options of the study."""

    neurobem: Neurobem = None
    spacing: Annotated[
        int, Option(min=1, max=1_000_000, help="Samples between windows; 1: all.")
    ] = 1


def run(run: Run, options: Options) -> Report:
    """Theorem 1, corrected: bound against error. In every window of the real flights."""
    flights = arrays("theorem", options.neurobem)
    models, settings = trained(run, flights[0])
    lines = bound_table(run, models, flights, spacing=options.spacing, config=settings)
    horizon = f"horizon {STEPS[-1]} steps, every {options.spacing}. window."
    return Report(
        [printed(lines)],
        config=settings,
        metrics={"table": lines},
        lines=[
            f"seed {run.seed}, trained on {flights[0].name}; {horizon}",
            *assumption_lines(lines),
        ],
        notes=failures(run.workers.finished),
    )
