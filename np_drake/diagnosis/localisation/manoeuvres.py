"""Manoeuvres that would show an effect, or tell two apart, as the effects state them."""

from collections.abc import Sequence

from np_drake.effects.library import effect_of


def manoeuvre(effects: Sequence[str]) -> str:
    """Return one line that names a manoeuvre for one effect or for a pair, by their identifiers."""
    if len(effects) == 2 and (apart := tells_apart(*effects)):
        return apart
    known = [effect_of(name).excited_by for name in effects if effect_of(name).excited_by]
    return "; or ".join(dict.fromkeys(known)) or "a flight that excites every axis at several speeds"


def tells_apart(a: str, b: str) -> str:
    """Return the manoeuvre of their own that tells effects a and b apart; empty where none is known."""
    return effect_of(a).told_from.get(b, "") or effect_of(b).told_from.get(a, "")
