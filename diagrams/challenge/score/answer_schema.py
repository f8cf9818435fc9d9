"""What scoring reads of truth.json and diagnosis.json (docs/reference/files.md), and what each field must be."""

from collections.abc import Iterator
from typing import Any

from diagrams.challenge.score.schema import Form, list_of, misfit, or_null, record, table_of
from np_drake.effects.library import LIBRARY

FOREIGN, CLEAN = "foreign", "clean"
KINDS = ("single", "pair", "triple", "onset", CLEAN, FOREIGN)
ANYTHING = {"description": "of any kind"}
TEXT = {"description": "text", "type": "string"}
KIND = {"description": f"one of {', '.join(KINDS)}", "enum": list(KINDS)}
WHOLE = {"description": "a whole number", "type": "integer"}
NUMBER = {"description": "a finite number", "type": "number"}
SIZE = {"description": "a finite number, at least 0", "type": "number", "minimum": 0}
SHARE = {**SIZE, "description": "a finite number, at least 0 and at most 1", "maximum": 1}
BOUNDS = {
    **list_of(or_null(NUMBER)),
    "description": "a list of 2, each a finite number, or null",
    "minItems": 2,
    "maxItems": 2,
}
INSTANTS = table_of(or_null(NUMBER))  # by flight [s]
RESIDUAL = record({f"{kind}_{axis}": SIZE for kind in ("force", "torque") for axis in "xyz"})
EFFECT = record({"effect": TEXT, "parameters": table_of(ANYTHING)}, spare={"onset": INSTANTS})
TRUTH = Form(
    record(
        {
            "effects": list_of(EFFECT),
            "class": list_of(list_of(TEXT)),
            "true_model_residual": RESIDUAL,
            "visibility": SIZE,
            "simulator": TEXT,
            "quality": TEXT,
            "kind": KIND,
            "seed": WHOLE,
        },
        spare={
            "parameters_residual": or_null(RESIDUAL),
            "best_onset": table_of(NUMBER),
            "visibility_in_training": table_of(SIZE),
        },
    )
)
FIGURES = Form(table_of(NUMBER))  # of an effect of the library

ESTIMATE = record({"value": or_null(NUMBER), "ci95": BOUNDS})
CAUSE = record(
    {"effect": TEXT, "parameters": table_of(ESTIMATE)},
    spare={
        "probability": or_null(SHARE),
        "onset": INSTANTS,
        "indistinguishable_from": list_of(TEXT),
    },
)
CHANNEL = record({}, spare={"rms": or_null(SIZE), "after": or_null(SIZE)})
AXES = record({}, spare=dict.fromkeys("xyz", CHANNEL))
MEDIANS = or_null(record({"position": list_of(or_null(NUMBER))}))
REPLAY = record({"horizon": list_of(NUMBER)}, spare={"before": MEDIANS, "after": MEDIANS})
ANSWER = Form(
    record(
        {
            "verdict": list_of(TEXT),
            "causes": list_of(CAUSE),
            "gap": record({}, spare={"force": AXES, "torque": AXES}),
            "shrink": record({}, spare={"replay": or_null(REPLAY)}),
        },
        spare={"wall": or_null(SIZE), "joined": list_of(TEXT)},
    )
)


def fault_of_truth(truth: dict[str, Any]) -> str | None:
    """One sentence on the first field that cannot be read, or does not agree with the others; None: there is none."""
    return misfit(TRUTH, truth) or next(_disagreements(truth), None)


def fault_of_answer(answer: dict[str, Any]) -> str | None:
    """The same of an answer."""
    return misfit(ANSWER, answer) or next(_unlike(answer["shrink"].get("replay") or {}), None)


def _disagreements(truth: dict[str, Any]) -> Iterator[str]:
    """Names are of the library, but for a foreign effect; every effect has its class."""
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
            wrong = misfit(FIGURES, effect["parameters"], f"effects[{i}].parameters")
            if wrong is not None:
                yield wrong
        for name in names:
            if name not in LIBRARY and name != own:
                yield f"class[{i}] must hold effects of the library; got {name!r}."


def _unlike(replay: dict[str, Any]) -> Iterator[str]:
    """Every horizon has its error."""
    for name in [name for name in ("before", "after") if replay.get(name) is not None]:
        given, asked = len(replay[name]["position"]), len(replay["horizon"])
        if given != asked:
            yield f"shrink.replay.{name}.position must hold an error for each of {asked} horizons; got {given}."
