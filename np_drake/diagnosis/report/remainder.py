"""What the causes leave of the held-out gap: by kind of force and torque, above the noise."""

from np_drake.diagnosis.report.words import listed, percent_interval, suited
from np_drake.diagnosis.residuals.residual_parts import gap_kinds
from np_drake.diagnosis.result import Diagnosis, GapReduction, Remainder
from np_drake.files.number_text import NBSP, NOTHING, measure, number, percent, probability

GAP_HEADER = ["held-out residual, RMS", "nominal", "with causes", "noise", "left"]


def gap_rows(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """Return (kind, before, after, noise, left) of each kind of gap, and of all channels in noise
    units.
    """
    rows = []
    for part in gap_kinds(diagnosis.localisation.channels):
        factor, unit = suited(part.before, part.unit)
        sizes = [number(factor * value, 2) for value in (part.before, part.after, part.noise)]
        rows.append((f"{part.kind} [{unit}]", *sizes, percent(part.left)))
    total = diagnosis.gap_reduction
    sizes = [number(value, 2) for value in (total.before, total.after, total.floor)]
    bounds = (1 - total.ci95[1], 1 - total.ci95[0])
    share = (
        f"{percent(share_left(total))} ({percent_interval(bounds)})" if total.material else NOTHING
    )
    return [*rows, ("all, over noise [1]", *sizes, share)]


def share_left(reduction: GapReduction) -> float:
    """Return the share of the held-out gap that causes and calibration leave [1]."""
    return max(reduction.left.share, 0.0)


def sizes_left(left: Remainder) -> str:
    """Return the remainder's force, torque and position error, as in '1.5 mN, 20 µN·m and 3 cm
    after 1 s'.
    """
    sizes = [
        measure(size, unit) for size, unit in ((left.force, "N"), (left.torque, "N·m")) if size > 0
    ]
    return listed([*sizes, f"{measure(left.position, 'm')} after 1{NBSP}s"])


def remains(diagnosis: Diagnosis) -> str:
    """Return how much of the held-out gap is left, and the probability that it is material."""
    left = diagnosis.gap_reduction.left
    if not diagnosis.gap_reduction.material:
        return (
            f"The held-out gap is immaterial: {measure(left.position_before, 'm')} after "
            f"1{NBSP}s, beyond the noise."
        )
    said = (
        f"{percent(share_left(diagnosis.gap_reduction))} of the held-out gap is left beyond "
        f"the noise"
    )
    return (
        f"{said}: {sizes_left(left)}. Probability that this is material: "
        f"{probability(left.probability)}."
    )


def calibration_share(reduction: GapReduction) -> str:
    """Return how much of the held-out gap the calibration of the vehicle explains by itself, in a
    sentence.
    """
    after = {rung.name: rung.residual for rung in reduction.ladder}.get("+ calibration")
    if after is None or not reduction.material:
        return ""
    before, floor = reduction.before, reduction.floor
    share = 1 - (after**2 - floor**2) / (before**2 - floor**2)
    if share >= 0:
        return f"By itself it explains {percent(min(share, 1.0))} of the held-out gap."
    return (
        f"By itself it does not help on held-out flights: {number(before, 2)} to "
        f"{number(after, 2)} times the noise."
    )
