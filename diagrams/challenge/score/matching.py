"""Is a verdict right? By name, and by class: effects that are physically the same in the data."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from diagrams.challenge.score.answered_case import COMPANION, WINDS, Solved
from np_drake.diagnosis.result import UNKNOWN

WIDEST = 3  # names that a class may hold, a cause's own included: more tell nothing


def class_of(case: Solved, name: str) -> tuple[str, ...]:
    """A cause's own name and those that it says cannot be told from it."""
    return (name, *case.causes.get(name, {}).get("indistinguishable_from", ()))


def hits(case: Solved, true: int, name: str) -> bool:
    """Does the cause `name` stand for the true effect number `true`? A class that is too wide stands for none."""
    own = class_of(case, name)
    same = case.truth["class"][true]
    return len(set(own)) <= WIDEST and (name in same or case.true_names[true] in own)


def matches(case: Solved) -> dict[int, str]:
    """Number of true effect -> cause that stands for it; as many as possible, each cause once, own names first."""
    named = case.named
    if not named or not case.true_names:
        return {}
    worth = np.array(
        [
            [hits(case, i, name) * (1.0 + 0.01 * (name == true)) for name in named]
            for i, true in enumerate(case.true_names)
        ]
    )
    pairs = zip(*linear_sum_assignment(-worth), strict=True)
    return {int(i): named[j] for i, j in pairs if worth[i, j] > 0}


def exact(case: Solved) -> bool:
    """The verdict names all true effects and nothing else."""
    return set(case.verdict) == set(case.true_names)


def exact_lenient(case: Solved) -> bool:
    """As `exact`, but a wind's drag may be missing."""
    spare = {COMPANION} if set(WINDS) & set(case.true_names) else set()
    return set(case.verdict) - spare == set(case.true_names) - spare


def right_class(case: Solved, *, unknown_allowed: bool = False) -> bool:
    """Every true effect has its cause and every cause its effect; `unknown` is a name too many unless allowed."""
    if UNKNOWN in case.verdict and not unknown_allowed:
        return False
    found = matches(case)
    return len(found) == len(case.true_names) == len(case.named)


def detected(case: Solved) -> bool:
    """The main effect has its cause, whatever else is named."""
    return 0 in matches(case)


def tellable(case: Solved) -> bool:
    """Do the training flights tell every true effect from all others but a few?

    One that is lost in noise, or in what vehicle file and sensors may be off by, is the same as any other, and as none.
    """
    return all(len({name, *same}) <= WIDEST for name, same in _with_class(case))


def names_right(case: Solved) -> tuple[int, int, int]:
    """Names that are right, too many (`unknown` among them) and missing, by class."""
    right = len(matches(case))
    return right, len(case.verdict) - right, len(case.true_names) - right


def is_true(case: Solved, name: str) -> bool:
    """Is `name` a true effect, or physically the same as one?"""
    return any(name in {true, *same} for true, same in _with_class(case))


def _with_class(case: Solved) -> list[tuple[str, list[str]]]:
    """Every true effect with its class."""
    return list(zip(case.true_names, case.truth["class"], strict=True))
