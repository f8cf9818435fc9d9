"""Next steps: what to measure, fly or change after a diagnosis."""

from np_drake.diagnosis.localisation.manoeuvres import manoeuvre
from np_drake.diagnosis.report.summary import main_remainder, named_causes
from np_drake.diagnosis.report.words import capital, described, listed, name_of
from np_drake.diagnosis.result import UNKNOWN, Cause, Diagnosis
from np_drake.effects.library import effect_of

LOOSE = 0.5  # half-width of an interval over the value, above which it is loose [1]; own choice


def next_steps(diagnosis: Diagnosis) -> list[str]:
    """Return what to do next, the most useful first."""
    if diagnosis.cannot_tell:
        tried = [item.manoeuvre for item in diagnosis.identifiability.not_identifiable if item.manoeuvre]
        return [
            f"Fly with more motion in every axis{f', such as: {tried[0]}' if tried else ''}. Diagnose again."
        ]
    causes = named_causes(diagnosis)
    out = [
        f"To check {name_of(c.identifier)}: {check}."
        for c in causes
        if (check := effect_of(c.identifier).bench_check)
    ]
    for cause in causes:
        others = cause.indistinguishable_from
        if others:
            between = f"{name_of(cause.identifier)} from {listed([name_of(o) for o in others], 'or')}"
            how = manoeuvre((cause.identifier, *others)).rstrip(".")
            out.append(f"To tell {between}, fly: {how}; or the flight of np-drake next-flight.")
        elif loose := _loose(cause):
            more = effect_of(cause.identifier).excited_by or "a longer one with more motion"
            out.append(
                f"Intervals of {cause.identifier} are wide ({listed(loose)}); a better flight: {more}."
            )
    if UNKNOWN in diagnosis.verdict and diagnosis.unexplained:
        out.append(
            f"Look for the source of what remains: {described(main_remainder(diagnosis.unexplained))}."
        )
    if any("not tested" in sentence for sentence in diagnosis.coverage):
        out.append("Hold out a flight that moves like the training flights.")
    if causes:
        them = "it" if len(causes) == 1 else "them"
        out.append(
            f"Add {them} to the simulator with the values of the table, and diagnose new flights with that."
        )
    return [capital(step) for step in out]


def _loose(cause: Cause) -> list[str]:
    """Return the parameters whose interval is wide, if the widest of the effect's values is one of them."""
    wide = {
        name: 0.5 * (p.ci95[1] - p.ci95[0]) > LOOSE * abs(p.value) > 0 for name, p in cause.parameters.items()
    }
    alike = max((abs(p.value) for p in cause.parameters.values()), default=0.0)
    main = [name for name, p in cause.parameters.items() if abs(p.value) == alike]
    return [name for name in wide if wide[name]] if any(wide[name] for name in main) else []
