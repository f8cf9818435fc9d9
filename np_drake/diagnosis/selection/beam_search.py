"""Beam search over sets of candidates by Bayesian evidence, with removals and swaps."""

from collections.abc import Iterable

import numpy as np

from np_drake.diagnosis.regressors import Model, RegressionProblem

BEAM = 6  # sets kept from step to step
MARGIN = 8.0  # log evidence below the best at which the beam stops growing
MOST_EFFECTS = 8  # in a model


def search(problem: RegressionProblem) -> list[Model]:
    """Return all models met, best first.

    A beam grows by one candidate at a time, then the best is swapped and reduced until it rests.
    """
    seen: dict[tuple[int, ...], float] = {(): 0.0}

    def score_all(sets: Iterable[tuple[int, ...]]) -> None:
        new = [members for members in sets if members not in seen]
        seen.update(zip(new, problem.scores(new), strict=True))

    everyone = range(len(problem.candidates))
    layer: list[tuple[int, ...]] = [()]
    for _ in range(MOST_EFFECTS):
        grown = {
            tuple(sorted((*m, i)))
            for m in layer
            for i in everyone
            if i not in m and problem.fits_together((*m, i))
        }
        if not grown:
            break
        score_all(grown)
        ranked = sorted(grown, key=lambda m: (-seen[m], m))
        best = max(seen.values())
        layer = _diverse(problem, ranked, BEAM)
        if seen[layer[0]] < best - MARGIN:
            break
    current = max(seen, key=lambda m: seen[m])
    while True:
        better = _neighbours(problem, current)
        score_all(better)
        candidate = max(better, key=lambda m: seen[m], default=current)
        if seen[candidate] <= seen[current]:
            break
        current = candidate
    return [Model(m, s) for m, s in sorted(seen.items(), key=lambda item: -item[1]) if s > -np.inf]


def _diverse(problem: RegressionProblem, ranked: list[tuple[int, ...]], beam: int) -> list[tuple[int, ...]]:
    """The best of each set of effects: variants of one effect must not fill the beam."""
    kept: dict[tuple[str, ...], tuple[int, ...]] = {}
    for members in ranked:
        names = tuple(sorted(name for i in members for name in problem.candidates[i].identifiers))
        kept.setdefault(names, members)
        if len(kept) == beam:
            break
    return list(kept.values())


def _neighbours(problem: RegressionProblem, members: tuple[int, ...]) -> set[tuple[int, ...]]:
    """One candidate fewer, or one exchanged."""
    found = set()
    for out in members:
        rest = tuple(i for i in members if i != out)
        found.add(rest)
        for i in range(len(problem.candidates)):
            new = tuple(sorted((*rest, i)))
            if i not in members and problem.fits_together(new):
                found.add(new)
    return found
