"""Study `identification-flights`: real vehicles identified from two halves of their flights."""

from typing import Any

from diagrams.batch.run import Report, Run, failures, require_result
from diagrams.identification import benchmark
from diagrams.identification.agreement import agreement_lines, held_out_lines, printed
from diagrams.identification.benchmark import JUDGING, BenchmarkCase
from diagrams.identification.half_case import HalfCase
from diagrams.identification.real_sets import BENCHMARK, Folders, present_sets
from diagrams.studies.options import RealFlightOptions

Options = RealFlightOptions


def run(run: Run, options: Options) -> Report:
    """Real vehicles, each identified from two halves of its flights. --out DIR: cases to resume
    from.
    """
    real = options.given("identification-flights")
    folders = Folders(real.resolve(), options.neurobem and options.neurobem.resolve())
    names = present_sets(folders, options.only or ())
    config: dict[str, Any] = {
        "folder": real.name,
        "neurobem": options.neurobem and options.neurobem.name,
    }
    cases = [{"set": name, "half": half} for name in names for half in (0, 1)]
    records = run.cases("identifying", "halves", HalfCase(folders), cases, config=config)
    require_result(records)
    of_set = {
        name: [r["result"] for r in records if r["case"]["set"] == name and "result" in r]
        for name in names
    }
    sets = {name: two for name, two in of_set.items() if len(two) == 2}
    judged = _benchmark(run, folders, names, config)
    return Report(
        [*printed(sets), *(benchmark.printed(result) for result in judged)],
        config=config | {"sets": names},
        metrics={
            "agreement": agreement_lines(sets),
            "held_out": held_out_lines(sets),
            "benchmark": judged,
            "runs": records,
        },
        notes=failures(run.workers.finished),
    )


def _benchmark(
    run: Run, folders: Folders, names: list[str], config: dict[str, Any]
) -> list[dict[str, Any]]:
    """Return the result of the benchmark, in a list; none where its flights are not there."""
    judging = [f.name.startswith(JUDGING) for f in folders.files(BENCHMARK)]
    if BENCHMARK not in names or not any(judging) or all(judging):
        return []
    cases = [{"set": BENCHMARK, "judging": JUDGING}]
    records = run.cases("predicting", "", BenchmarkCase(folders), cases, config=config)
    return [r["result"] for r in records if "result" in r]
