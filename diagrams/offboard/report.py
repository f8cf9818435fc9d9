"""What a node tells of its flight and of its deadlines."""

from typing import Any

import numpy as np

from diagrams.batch.run import Table
from diagrams.offboard.flight_record import Flown
from diagrams.offboard.node import Node
from np_drake import metrics


def flight_metrics(node: Node, flown: Flown) -> dict[str, Any]:
    """Return time and errors of a flight, without the ramp where it lasted longer."""
    t = flown.log.t
    scored = t >= node.config.reference.lead
    scored = scored if scored.any() else ~scored
    errors = metrics.tracking_errors(flown.log.p[scored], flown.reference[scored])
    return {"flown": float(t[-1]), **errors}


def deadlines(node: Node) -> dict[str, Any]:
    """Return counts and times of a node: ticks, late solves, jitter, ages, messages that were not
    taken.
    """
    counts, ages = node.counts, np.array(node.readings.ages or [np.nan])
    solves, delays = np.array(counts.solves or [np.nan]), np.array(counts.delays or [np.nan])
    return {
        "ticks": counts.ticks,
        "skipped": counts.skipped,
        "periods": counts.periods,
        "late": counts.late,
        "solve_ms": metrics.solve_times_ms(solves),
        "jitter_ms": metrics.solve_times_ms(delays),
        "state_age_ms": metrics.solve_times_ms(ages),
        "refused": dict(node.readings.refused),
        "restarts": node.readings.restarts,
        "errors": counts.errors,
    }


def tables(node: Node) -> list[Table]:
    """Return the tables of a node: its flight, its phases, its deadlines."""
    flights = []
    if (flown := node.flown) is not None:
        own = flight_metrics(node, flown)
        flights = [(f"{own['flown']:.1f}", f"{100 * own['E_xy']:.2f}", f"{100 * own['E_z']:.2f}")]
    phases = [(f"{event.time:.2f}", event.phase.value, event.reason) for event in node.events]
    found = deadlines(node)
    times = [
        (name, *(f"{found[key][part]:.2f}" for part in ("median", "p95", "max")))
        for name, key in (
            ("solve", "solve_ms"),
            ("tick after its time", "jitter_ms"),
            ("age of the state", "state_age_ms"),
        )
    ]
    refused = found["refused"]
    counted = [
        ("ticks, of them skipped", f"{found['ticks']}, {found['skipped']}"),
        ("solves, of them late", f"{found['periods']}, {found['late']}"),
        ("messages out of turn, absurd", f"{refused['late']}, {refused['absurd']}"),
        ("restarts of the autopilot", str(found["restarts"])),
        ("ticks that failed", str(found["errors"])),
    ]
    shown = [("flight", ["flown [s]", "E_xy [cm]", "E_z [cm]"], flights)] if flights else []
    return [
        *shown,
        ("phases", ["at [s]", "phase", "why"], phases),
        ("times [ms]", ["of", "median", "p95", "max"], times),
        ("counts", ["of", "number"], counted),
    ]
