"""What the causes leave of the held-out gap: by kind of force and torque, above the noise."""

import math

from np_drake.diagnosis.report.words import percent_interval, suited
from np_drake.diagnosis.residuals.residual_parts import SHOWN_GAP, Localisation, gap_kinds
from np_drake.diagnosis.result import Diagnosis, GapReduction
from np_drake.files.number_text import NOTHING, measure, number, percent, probability

GAP_HEADER = ["held-out residual, RMS", "nominal", "with causes", "noise", "left"]


def gap_rows(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """Return (kind, before, after, noise, left) of each kind of gap, and of all channels in noise units."""
    rows = []
    for part in gap_kinds(diagnosis.localisation.channels):
        factor, unit = suited(part.before, part.unit)
        sizes = [number(factor * value, 2) for value in (part.before, part.after, part.noise)]
        rows.append((f"{part.kind} [{unit}]", *sizes, percent(part.left)))
    total = diagnosis.gap_reduction
    sizes = [number(value, 2) for value in (total.before, total.after, total.floor)]
    bounds = (1 - total.ci95[1], 1 - total.ci95[0])
    share = f"{percent(share_left(total))} ({percent_interval(bounds)})" if has_gap(total) else NOTHING
    return [*rows, ("all, over noise [1]", *sizes, share)]


def has_gap(reduction: GapReduction) -> bool:
    """Return whether the held-out residual exceeds the noise enough for a closed fraction to have meaning."""
    return reduction.before > SHOWN_GAP * reduction.floor


def share_left(reduction: GapReduction) -> float:
    """Return the share of the held-out gap that the causes leave [1]."""
    return max(1 - reduction.fraction, 0.0)


def sizes_left(localisation: Localisation) -> str:
    """Return the force and torque above the noise that the causes leave, as in '1.5 mN and 20 µN·m'; empty: none."""
    total: dict[str, float] = {}
    for part in gap_kinds(localisation.channels):
        if part.grows or not math.isnan(part.left):
            total[part.unit] = math.hypot(total.get(part.unit, 0.0), part.above_noise)
    return " and ".join(measure(size, unit) for unit, size in total.items() if size > 0)


def remains(diagnosis: Diagnosis) -> str:
    """Return how much of the held-out gap is left, and then the probability that no effect explains it."""
    sizes = sizes_left(diagnosis.localisation)
    if sizes and has_gap(diagnosis.gap_reduction):
        said = f"{percent(share_left(diagnosis.gap_reduction))} of the held-out gap is left: {sizes} above the noise."
    else:
        said = "Nothing above the noise is left on the held-out flights."
    unknown = probability(diagnosis.unknown_probability)
    return f"{said} Probability that something material is left which no effect explains: {unknown}."


def calibration_share(reduction: GapReduction) -> str:
    """Return how much of the held-out gap the calibration of the vehicle explains by itself, in a sentence."""
    after = {rung.name: rung.residual for rung in reduction.ladder}.get("+ calibration")
    if after is None or not has_gap(reduction):
        return ""
    before, floor = reduction.before, reduction.floor
    share = 1 - (after**2 - floor**2) / (before**2 - floor**2)
    if share >= 0:
        return f"By itself it explains {percent(min(share, 1.0))} of the held-out gap."
    return f"By itself it does not help on held-out flights: {number(before, 2)} to {number(after, 2)} times the noise."
