"""Study `identification`: simulated vehicles identified from their logs, beside the truth."""

import dataclasses as dc
from typing import Annotated, Any

from typer import Option

from diagrams.batch.run import Report, Run, failures, require_result
from diagrams.identification.coverage import asked_lines, pooled_lines, printed, quantity_lines
from diagrams.identification.vehicle_case import VehicleCase, make_cases


@dc.dataclass(frozen=True)
class Options:
    """Options of the study."""

    vehicles: Annotated[
        int,
        Option(
            min=1, max=10_000, help="Vehicles; their input in turn: rotor speed, throttle, thrust."
        ),
    ] = 200
    flights: Annotated[int, Option(min=1, max=100, help="Flights of each vehicle.")] = 3
    seconds: Annotated[float, Option(min=5.0, max=600.0, help="Length of a flight [s].")] = 30.0


def run(run: Run, options: Options) -> Report:
    """Simulated vehicles of 30 g to 20 kg, identified from their logs. --out DIR: cases to resume
    from.
    """
    cases = make_cases(options.vehicles, run.seed)
    flown: dict[str, Any] = {"flights": options.flights, "seconds": options.seconds}
    work = VehicleCase(options.flights, options.seconds)
    records = run.cases("identifying", "vehicles", work, cases, config=flown)
    require_result(records)
    results = [{**r["case"], **r["result"]} for r in records if "result" in r]
    title = (
        f"{len(results)} vehicles, {options.flights} x {options.seconds:g} s, "
        f"seeds {run.seed} … {run.seed + options.vehicles - 1}"
    )
    return Report(
        printed(results, title),
        config={"vehicles": options.vehicles, **flown},
        metrics={
            "asked": asked_lines(results),
            "pooled": pooled_lines(results),
            "table": quantity_lines(results),
            "runs": records,
        },
        notes=failures(records),
    )
