"""What a value of a JSON file must be, as a tree of forms; the first misfit is one sentence with its place."""

import dataclasses as dc
import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from np_drake.yaml_kinds import shown

Inside = Callable[[Any, str], str | None]


def _nothing(value: Any, place: str) -> str | None:
    return None


@dc.dataclass(frozen=True)
class Form:
    """must: words for what it is.   suits: is a value so on the face of it?   inside: the misfit of what it holds."""

    must: str
    suits: Callable[[Any], bool]
    inside: Inside = _nothing
    spare: bool = False  # may be missing from a record


def misfit(form: Form, value: Any, place: str = "") -> str | None:
    """Where the value stands, what it must be and what it is; None where it suits.

    Args: place: as `effects[0].onset`; empty for the whole file.
    """
    if not form.suits(value):
        return f"{place or 'it'} must be {form.must}; got {shown(value)}."
    return form.inside(value, place)


def number(least: float = -math.inf, most: float = math.inf) -> Form:
    """A finite number, bounds included."""
    bounds = [
        f"at {word} {bound:g}" for word, bound in (("least", least), ("most", most)) if math.isfinite(bound)
    ]
    words = " ".join(["a finite number,", " and ".join(bounds)]) if bounds else "a finite number"
    return Form(words, lambda value: _is_number(value) and least <= value <= most)


def whole() -> Form:
    """A whole number."""
    return Form("a whole number", lambda value: isinstance(value, int) and not isinstance(value, bool))


def text(*choices: str) -> Form:
    """Text; one of `choices` if there are any."""
    must = f"one of {', '.join(choices)}" if choices else "text"
    return Form(must, lambda value: isinstance(value, str) and (not choices or value in choices))


def list_of(item: Form, length: int | None = None) -> Form:
    """A list whose items are all `item`, of any length unless one is given."""
    return Form(
        f"a list{'' if length is None else f' of {length}'}, each {item.must}",
        lambda value: isinstance(value, list) and length in (None, len(value)),
        lambda value, place: _first(misfit(item, inner, f"{place}[{i}]") for i, inner in enumerate(value)),
    )


def table_of(item: Form) -> Form:
    """An object of any names, whose values are all `item`."""
    return Form(
        f"an object, each value {item.must}",
        lambda value: isinstance(value, dict),
        lambda value, place: _first(misfit(item, inner, _joined(place, key)) for key, inner in value.items()),
    )


def record(fields: Mapping[str, Form]) -> Form:
    """An object that holds these fields; what else it holds is of no matter."""

    def one(name: str, form: Form, value: dict[str, Any], place: str) -> str | None:
        if name in value:
            return misfit(form, value[name], _joined(place, name))
        return None if form.spare else f"{_joined(place, name)} is missing; it must be {form.must}."

    return Form(
        f"an object with {', '.join(fields)}",
        lambda value: isinstance(value, dict),
        lambda value, place: _first(one(name, form, value, place) for name, form in fields.items()),
    )


def anything() -> Form:
    """What is not read."""
    return Form("of any kind", lambda value: True)


def spare(form: Form) -> Form:
    """May be missing from a record."""
    return dc.replace(form, spare=True)


def or_null(form: Form) -> Form:
    """May be null."""
    return dc.replace(
        form,
        must=f"{form.must}, or null",
        suits=lambda value: value is None or form.suits(value),
        inside=lambda value, place: None if value is None else form.inside(value, place),
    )


def also(form: Form, rule: Inside) -> Form:
    """A form whose parts must also agree with each other, by `rule`, which sees only what suits the form."""
    return dc.replace(form, inside=lambda value, place: form.inside(value, place) or rule(value, place))


def _is_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def _joined(place: str, name: str) -> str:
    return f"{place}.{name}" if place else name


def _first(sentences: Iterable[str | None]) -> str | None:
    return next((sentence for sentence in sentences if sentence is not None), None)
