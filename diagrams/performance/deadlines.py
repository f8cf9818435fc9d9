"""Deadlines of the control loop on this machine: a recorded flight, replayed at its own pace.

Every period the loop waits for its instant, takes in the reading, predicts and solves. The response
is the time from that instant to the command: late waking counts. A period whose response is longer
than the period is missed.
"""

import contextlib
import dataclasses as dc
import gc
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from matplotlib.figure import Figure
from typer import Option

from diagrams.batch.columns import fixed, tabulate
from diagrams.batch.run import Report, Run, Table
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import FlightResult, fly
from diagrams.performance.control_loop import ControlLoop, replayed
from diagrams.performance.timing import TRACK, TRAINING
from diagrams.prediction.learning import train_payload_filter_model
from np_drake.files.figure_file import DASHES, PALETTE, new_figure

RATES = (50, 100, 200)  # of the loop [1/s]
COLLECTORS = ("by itself", "after")  # when Python's garbage collector runs
PREDICTOR = "payload_filter"  # configuration that is flown
WARM_UP = 50  # periods that are not counted: compiled code is loaded, the solver starts cold [1]
# the loop sleeps until so long before its instant and then watches the clock; own choice [s]
SPIN = 3e-4
EDGES = np.geomspace(0.1, 100.0, 61)  # of the histogram of responses [ms]


@dc.dataclass(frozen=True)
class Paced:
    """Times of the periods of a paced replay, (n,) each [s].

    late: from a period's instant to waking.   response: from that instant to the command.
    """

    period: float
    late: np.ndarray
    response: np.ndarray

    @property
    def missed(self) -> int:
        """Periods whose command came after the next period's instant."""
        return int(np.sum(self.response > self.period))


def _flight_config(kind: str, experiment: str, rate: float, seconds: float) -> FlightConfig:
    """Return an experiment flown for `seconds` after its ramp, by a loop of `rate` [1/s], with
    SQP.
    """
    config = load_experiment(experiment)
    config.controller.kind, config.controller.solver = kind, "sqp"
    config.controller.period, config.duration = 1.0 / rate, seconds
    return config


def _record(rate: float, seconds: float, folder: Path, *, seed: int) -> FlightResult:
    """Train a predictor at this rate, and fly with it for `seconds` after the ramp.

    Training draws the seed, the flight the next one.
    """
    training = _flight_config("nominal", TRAINING, rate, load_experiment(TRAINING).duration)
    path = folder / f"{PREDICTOR}_{rate:g}.safetensors"
    train_payload_filter_model(fly(training.check(), seed=seed), path)
    config = _flight_config(PREDICTOR, TRACK, rate, seconds)
    config.controller.predictor = str(path)
    return fly(config.check(), seed=seed + 1)


def paced(
    flight: FlightResult,
    collector: str,
    *,
    clock: Callable[[], float] = time.perf_counter,
    sleep: Callable[[float], None] = time.sleep,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> Paced:
    """Replay a flight at its own pace and return the times of its periods.

    A loop that falls behind goes on at once and keeps its instants.

    Args:
        collector: one of `COLLECTORS`.
        clock: of the real time [s].
        sleep: waits for so long [s].
        on_progress: called with periods done and all, once a second.
    """
    loop, period = ControlLoop(flight), flight.config.controller.period

    def wait(k: int) -> None:
        while (left := begin + k * period - clock()) > 0:
            if left > SPIN:
                sleep(left - SPIN)

    def between(k: int) -> None:
        if collector == COLLECTORS[1]:
            gc.collect(0)
        if k % round(1 / period) == 0:
            on_progress(k, loop.periods)

    with _collection(collector):
        begin = clock()
        times, _ = replayed(loop, 1, clock, before=wait, after=between)
    instants = begin + period * np.arange(1, loop.periods)
    woke, _, commanded = (times - instants[:, None])[WARM_UP - 1 :].T
    return Paced(period, woke, commanded)


@contextlib.contextmanager
def _collection(collector: str) -> Iterator[None]:
    """Keep the garbage collector out of the periods, unless it runs by itself; afterwards it is as
    before.
    """
    if collector not in COLLECTORS:
        raise ValueError(
            f"deadlines: collector must be one of {', '.join(COLLECTORS)}; got {collector!r}."
        )
    if collector == COLLECTORS[0]:
        yield
        return
    enabled = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.unfreeze()
        if enabled:
            gc.enable()


def deadline_line(rate: float, collector: str, times: Paced) -> dict:
    """Return one line of the table, times in [ms].

    Args:
        rate: of the loop [1/s].
        collector: one of `COLLECTORS`.
    """
    response, late = 1e3 * times.response, 1e3 * times.late
    counts, _ = np.histogram(response, EDGES)
    return {
        "rate": rate,
        "collector": collector,
        "periods": len(response),
        "missed": times.missed,
        "response": float(np.median(response)),
        **{
            f"response_p{q:g}".replace(".", "_"): float(np.percentile(response, q))
            for q in (99, 99.9)
        },
        "response_max": float(response.max()),
        "late_p99": float(np.percentile(late, 99)),
        "late_max": float(late.max()),
        "histogram": counts.tolist(),
    }


@dc.dataclass(frozen=True)
class Options:
    """Options of the study."""

    minutes: Annotated[float, Option(min=0.05, max=60.0, help="Of flight at every rate [min].")] = (
        10.0
    )
    rates: Annotated[
        list[float] | None, Option("--rate", min=10.0, max=500.0, help="Of the loop [1/s].")
    ] = None


def run(run: Run, options: Options) -> Report:
    """Deadlines of the loop on this machine, at its own pace. --out DIR: a histogram."""
    chosen, lines = options.rates or list(RATES), []
    runs = [(rate, collector) for rate in chosen for collector in COLLECTORS]
    with run.progress("deadlines") as advance:
        for number, (rate, collector) in enumerate(runs):
            if collector == COLLECTORS[0]:
                advance(number / len(runs), f"{rate:g} Hz: training, flying")
                flight = _record(rate, 60 * options.minutes, run.folder, seed=run.seed)

            def tell(done: int, total: int, number=number, rate=rate, collector=collector) -> None:
                advance((number + done / total) / len(runs), f"{rate:g} Hz, {collector}")

            lines.append(deadline_line(rate, collector, paced(flight, collector, on_progress=tell)))
    title = (
        f"{options.minutes:g} min of the {TRACK} at every rate, np: {PREDICTOR}, sqp, seed "
        f"{run.seed + 1}"
    )
    config = {
        "track": TRACK,
        "minutes": options.minutes,
        "rates": chosen,
        "training_seed": run.seed,
    }
    return Report(
        [_printed(lines, title)],
        config=config | {"flight_seed": run.seed + 1},
        metrics={"table": lines, "histogram_edges_ms": EDGES.tolist()},
        notes=[
            (
                "response: from a period's instant to its command; late: to waking; missed: "
                "response longer than a period"
            ),
            "collector: Python's garbage collector runs by itself, or after each command",
        ],
        figures={"deadlines.png": lambda: response_histogram(lines)},
    )


def _printed(lines: list[dict], title: str) -> Table:
    """Return the table of the lines that `deadline_line` gives."""
    columns = (
        ("rate [Hz]", fixed("rate", 0)),
        ("collector", "collector"),
        ("periods", "periods"),
        ("missed", "missed"),
        ("response [ms]", fixed("response", 2)),
        ("99 %", fixed("response_p99", 2)),
        ("99.9 %", fixed("response_p99_9", 2)),
        ("max", fixed("response_max", 1)),
        ("late, 99 %", fixed("late_p99", 3)),
        ("max", fixed("late_max", 2)),
    )
    return tabulate(title, lines, columns)


def response_histogram(lines: Sequence[dict]) -> Figure:
    """Plot the number of periods by response, with the period as a line.

    Args:
        lines: of `deadline_line`.
    """
    rates = list(dict.fromkeys(line["rate"] for line in lines))
    figure, axes = new_figure(1, len(rates), width=1.2 + 2.6 * len(rates), height=2.8, sharey="row")
    for ax, rate in zip(axes.ravel(), rates, strict=True):
        for line in (line for line in lines if line["rate"] == rate):
            number = COLLECTORS.index(line["collector"])
            ax.stairs(
                [max(count, 0.1) for count in line["histogram"]],
                EDGES,
                color=PALETTE[number],
                linestyle=DASHES[number],
                label=f"collector {line['collector']}",
            )
        ax.axvline(1e3 / rate, color="0.4", linewidth=0.8, label="period")
        ax.set(
            xscale="log",
            yscale="log",
            xlabel="response [ms]",
            title=f"{rate:g} Hz",
            ylim=(0.5, None),
        )
    axes.ravel()[0].set_ylabel("periods")
    axes.ravel()[-1].legend(fontsize=7)
    return figure
