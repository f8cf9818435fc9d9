"""What scoring reads of truth.json and diagnosis.json (docs/files.md), and what each field must be."""

from collections.abc import Iterator
from typing import Any

from diagrams.challenge.form import (
    also,
    anything,
    list_of,
    misfit,
    number,
    or_null,
    record,
    spare,
    table_of,
    text,
    whole,
)
from np_drake.effects.library import LIBRARY

KINDS = ("single", "pair", "triple", "onset", "clean", "foreign")
SIZE = number(0.0)
INSTANTS = table_of(or_null(number()))  # by flight [s]
RESIDUAL = record({f"{kind}_{axis}": SIZE for kind in ("force", "torque") for axis in "xyz"})
FOREIGN, CLEAN = "foreign", "clean"


def _effects_and_classes_agree(truth: dict[str, Any], place: str) -> str | None:
    """Names are of the library, but for a foreign effect; every effect has its class."""
    return next(_disagreements(truth), None)


def _disagreements(truth: dict[str, Any]) -> Iterator[str]:
    kind, effects, classes = truth["kind"], truth["effects"], truth["class"]
    if (kind == CLEAN) != (not effects):
        must = "be empty" if kind == CLEAN else "name what acts"
        yield f"effects must {must} in a case of kind {kind}; got {len(effects)}."
    if len(classes) != len(effects):
        yield f"class must hold a list for each of {len(effects)} effects; got {len(classes)}."
    for i, (effect, names) in enumerate(zip(effects, classes, strict=False)):
        own = effect["effect"]
        if kind != FOREIGN:
            if own not in LIBRARY:
                yield f"effects[{i}].effect must be an effect of the library; got {own!r}."
            wrong = misfit(table_of(number()), effect["parameters"], f"effects[{i}].parameters")
            if wrong is not None:
                yield wrong
        for name in names:
            if name not in LIBRARY and name != own:
                yield f"class[{i}] must hold effects of the library; got {name!r}."


TRUTH = also(
    record(
        {
            "effects": list_of(
                record({"effect": text(), "parameters": table_of(anything()), "onset": spare(INSTANTS)})
            ),
            "class": list_of(list_of(text())),
            "true_model_residual": RESIDUAL,
            "parameters_residual": spare(or_null(RESIDUAL)),
            "best_onset": spare(table_of(number())),
            "visibility": SIZE,
            "visibility_in_training": spare(table_of(SIZE)),
            "simulator": text(),
            "quality": text(),
            "kind": text(*KINDS),
            "seed": whole(),
        }
    ),
    _effects_and_classes_agree,
)


def _as_many(replay: dict[str, Any], place: str) -> str | None:
    """Every horizon has its error."""
    for name in [name for name in ("before", "after") if replay.get(name) is not None]:
        given, asked = len(replay[name]["position"]), len(replay["horizon"])
        if given != asked:
            return f"{place}.{name}.position must hold an error for each of {asked} horizons; got {given}."
    return None


ESTIMATE = record({"value": or_null(number()), "ci95": list_of(or_null(number()), 2)})
CAUSE = record(
    {
        "effect": text(),
        "probability": spare(or_null(number(0.0, 1.0))),
        "parameters": table_of(ESTIMATE),
        "onset": spare(INSTANTS),
        "indistinguishable_from": spare(list_of(text())),
    }
)
CHANNEL = record({name: spare(or_null(SIZE)) for name in ("rms", "after")})
AXES = record({axis: spare(CHANNEL) for axis in "xyz"})
MEDIANS = spare(or_null(record({"position": list_of(or_null(number()))})))
REPLAY = also(record({"horizon": list_of(number()), "before": MEDIANS, "after": MEDIANS}), _as_many)
ANSWER = record(
    {
        "verdict": list_of(text()),
        "causes": list_of(CAUSE),
        "gap": record({kind: spare(AXES) for kind in ("force", "torque")}),
        "shrink": record({"replay": spare(or_null(REPLAY))}),
        "wall": spare(or_null(SIZE)),
    }
)
