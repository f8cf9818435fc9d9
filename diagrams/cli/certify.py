"""`np-drake certify`: where a vehicle may be flown, from draws of what is known of it."""

import dataclasses as dc
from math import inf
from pathlib import Path

from diagrams.certify.certificate import YES, Accepted, Certificate
from diagrams.certify.certificate import certify as certificate_of
from diagrams.certify.ranges import Range
from diagrams.cli.fly import Experiment, Fields, Predictor, scenario
from diagrams.cli.verb import OUT_OF_CASES, Report, Run, Table, VehicleFile, option, reports, say
from diagrams.evidence.studies.options import Reality, tabulate
from diagrams.loop.experiments import settings_of
from np_drake.files.number_text import measure, percent


@dc.dataclass(frozen=True)
class CertifyOptions:
    """Options of `certify`."""

    experiment: Experiment
    over: list[str] = option(
        "Draw payload [kg], tether [m], speed or wind [m/s], or a field of the scenario, from a "
        "range; repeatable. The first two make the map.",
        default=(),
        metavar="NAME=LOW:HIGH",
    )
    flights: int = option("Flights in all.", default=1000, min=20, max=1_000_000)
    within: float | None = option(
        "Corridor about the reference [m].", min=1e-3, max=50.0, metavar="METRES"
    )
    limit: float = option(
        "Largest rate of failures to accept [1].", default=0.01, min=1e-5, max=0.5
    )
    confidence: float = option("Of the bound [1].", default=0.95, min=0.5, max=0.9999)
    cells: int = option("Of the map along each range.", default=6, min=2, max=8)
    controller: str | None = option("As of `fly`, with its default.", metavar="KIND")
    predictor: Predictor = None
    duration: float | None = option("Scored time after the ramp [s].")
    fields: Fields = None
    vehicle: VehicleFile = None
    reality: Reality = None


@reports("certify", seed=0, out=OUT_OF_CASES, many=True)
def certify(run: Run, asked: CertifyOptions) -> Report:
    """Bound how often a vehicle is lost, or leaves a corridor, over ranges of payload, speed, wind.

    Flights are drawn from the ranges, the intervals of the vehicle file and the posterior of a
    diagnosis (`--reality corrected.yaml`).
    """
    ranges = [Range.parse(text) for text in asked.over]
    config = scenario(asked, reality=asked.reality)
    certificate = certificate_of(
        config,
        ranges,
        flights=asked.flights,
        within=inf if asked.within is None else asked.within,
        cells=asked.cells,
        accepted=Accepted(asked.limit, asked.confidence),
        run=run,
    )

    def write(folder: Path) -> None:
        written = certificate.write_failed(folder / "failed", run.seed)
        if written:
            say(f"failed flights: {folder / 'failed'}, {len(written)} scenario files")

    return Report(
        tables(certificate),
        config={
            "scenario": settings_of(config),
            "over": asked.over,
            "limit": asked.limit,
            "confidence": asked.confidence,
            "within": asked.within,
            "cells": asked.cells,
        },
        metrics={
            "holds": certificate.answer == YES,
            "cells": certificate.cells.tolist(),
            "lacking": certificate.lacking,
            "asked": certificate.asked,
            "flown": int((certificate.flights["refused"] == "").sum()),
            "bounds": {
                of: {"failures": b.failures, "flights": b.flights, "upper": b.upper}
                for of in BOUNDED
                for b in [certificate.bound(of)]
            },
            "drivers": certificate.drivers(),
            "flights": certificate.flights.to_dict("records"),
        },
        summary=[certificate.flown_of_asked()],
        figures={"map.png": certificate.figure} if len(ranges) > 1 else {},
        write=write,
    )


BOUNDED = {
    "failed": "fails",
    "lost": "is lost",
    "outside": "leaves the corridor",
    "grounded": "lowers its payload below the ground",
}


OTHERWISE = "A narrower range or a wider corridor may do."


def sentence(certificate: Certificate) -> str:
    """Return the answer in a sentence or two."""
    bound = certificate.bound()
    who = f"{certificate.config.name} with {certificate.config.controller.name}"
    if not bound.flights:
        return f"{who}: nothing may be flown: flights fail in every part of the ranges."
    failures = f"it fails in {bound}, {100 * certificate.confidence:g} % sure."
    where = "in the part below" if certificate.over else "as drawn"
    less = f"{100 * certificate.limit:g} %"
    more = certificate.lacking
    if more is None:
        return f"{who} fails {where} more often than {less}: {failures} {OTHERWISE}"
    if not more:
        return f"{who} may be flown {where}: {failures}"
    flights = (bound.flights + more) * (2 if certificate.over else 1)  # half of them explore
    return (
        f"{who} is not shown to fail in less than {less} {where}: {failures} {more} more flights "
        f"without a failure would show it (--flights {flights}). {OTHERWISE}"
    )


def tables(certificate: Certificate) -> list[Table]:
    """Return bounds and errors, the part that may be flown, and what the deviation goes with."""
    title = sentence(certificate)
    flights = certificate.flights
    if len(certificate.confirming):
        sizes = (
            certificate.quantile(*of) for of in (("E_xy", 0.5), ("E_xy", 0.95), ("peak", 0.95))
        )
        median, most, peak = (measure(v, "m") if v < inf else "unbounded" for v in sizes)
        title += (
            f" E_xy there: {median}, of 95 % of flights at most {most}; largest deviation of 95 % "
            f"of flights: {peak}."
        )
        flights = certificate.confirming
    bounds = [
        (text, f"{int(flights[of].sum())} of {len(flights)}", certificate.bound(of).at_most)
        for of, text in BOUNDED.items()
    ]
    result: list[Table] = [(title, ["the vehicle", "flights", "at most"], bounds)]
    if certificate.over:
        header = [one.name for one in certificate.over[:2]]
        header += ["may be flown"] if len(header) == 1 else []
        result.append(("what may be flown", header, certificate.allowed()))
    drivers = certificate.drivers()
    columns = (
        ("quantity", "name"),
        ("rank correlation", lambda line: f"{line['rho']:+.2f}"),
        (
            "failed, low / middle / high third",
            lambda line: " / ".join(map(percent, line["thirds"])),
        ),
        ("told by", "told_by"),
    )
    if drivers:
        result.append(tabulate("what the largest deviation goes with", drivers, columns))
    return result
