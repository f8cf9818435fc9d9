"""Which cases a challenge set holds."""

from itertools import combinations

import numpy as np

from diagrams.challenge.generate.case import CLEAN, OUT_OF_LIBRARY, CaseDraw
from diagrams.challenge.out_of_library.draw import DEVELOPMENT, HOLDOUT
from np_drake.effects.library import LIBRARY

SHARES = {
    "pair": 0.15,
    "triple": 0.08,
    "onset": 0.12,
    OUT_OF_LIBRARY: 0.15,
}  # the rest are single effects
TWO_AT_ONCE = 1 / 3  # of the out-of-library cases of `wild`: two out-of-library effects act [1]
# Physically the same, or nearly so: never in one case together.
EQUIVALENT = (
    {
        "mass_error",
        "thrust_scale",
        "thrust_drift",
        "translational_lift",
        "rotor_inflow",
        "ground_effect",
    },
    {"motor_lag", "command_delay", "clock_offset"},
    {"linear_drag", "quadratic_drag", "rotor_inflow", "constant_wind", "gusty_wind"},
    {"center_of_mass_offset", "weak_rotor", "suspended_payload"},
    {"mass_error", "suspended_payload"},
)


def compatible(names: tuple[str, ...]) -> bool:
    """Return whether effects can be told apart in principle, and act at different places."""
    if any(len(group & set(names)) > 1 for group in EQUIVALENT):
        return False
    return len({LIBRARY[name].place for name in names}) == len(names)


def compose(
    cases: int, clean: int, seed: int, *, unseen: bool = False, two: float = 0.0
) -> list[CaseDraw]:
    """Draw `cases` with an effect and `clean` without, in shuffled order; single effects cycle
    through the library.

    Args:
        unseen: whether all have an out-of-library effect that is held out from the other sets.
        two: share of the out-of-library cases that have two such effects at once [1].
    """
    rng = np.random.default_rng([seed, 7])
    shares = {OUT_OF_LIBRARY: 1.0} if unseen else SHARES
    counts = {kind: round(share * cases) for kind, share in shares.items()}
    kinds = ["single"] * (cases - sum(counts.values()))
    kinds += [kind for kind, count in counts.items() for _ in range(count)] + [CLEAN] * clean
    strange = HOLDOUT if unseen else DEVELOPMENT
    names = {
        "single": _cycle(rng, [(name,) for name in LIBRARY]),
        "onset": _cycle(rng, [(name,) for name, effect in LIBRARY.items() if effect.begins]),
        OUT_OF_LIBRARY: _cycle(rng, [(name,) for name in strange]),
        "two at once": _cycle(rng, list(combinations(strange, 2))),
        "pair": _cycle(rng, [c for c in combinations(LIBRARY, 2) if compatible(c)]),
        "triple": _cycle(rng, [c for c in combinations(LIBRARY, 3) if compatible(c)]),
        CLEAN: _cycle(rng, [()]),
    }
    drawn = [(kind, next(names[kind])) for kind in kinds]
    both = [i for i, kind in enumerate(kinds) if kind == OUT_OF_LIBRARY][
        : round(two * counts[OUT_OF_LIBRARY])
    ]
    for i in both:
        drawn[i] = OUT_OF_LIBRARY, next(names["two at once"])
    order = rng.permutation(len(drawn))
    return [CaseDraw(index, *drawn[i]) for index, i in enumerate(order)]


def _cycle(rng: np.random.Generator, items: list):
    """Yield every item once in random order, then again in another."""
    while True:
        for i in rng.permutation(len(items)):
            yield items[i]
