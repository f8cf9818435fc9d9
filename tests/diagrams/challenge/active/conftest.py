"""Fixtures of active diagnosis: a vehicle with drag, and answers that need no flight."""

import dataclasses as dc

import pytest

from diagrams.challenge.active.answer import Answer
from diagrams.challenge.generate.case import CaseDraw, draw_case
from np_drake.diagnosis.result import Diagnosis
from np_drake.effects.explanation import Explanation
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.quadratic_drag import QuadraticDrag


@pytest.fixture(scope="session")
def dragged():
    """Return a case whose only effect is a linear drag."""
    return draw_case(CaseDraw(0, "single", ("linear_drag",)), quality="real", seed=3, seconds=20.0)


def explained(probability, *effects):
    return Explanation(tuple(sorted(e.identifier for e in effects)), probability, effects)


@pytest.fixture(scope="session")
def answered(dragged):
    """Return an answer of the case with these probabilities of linear drag, quadratic drag and nothing."""
    nothing = Diagnosis("v", ("a",), ("b",), (), (), None, None, None)

    def make(linear, quadratic, none=0.0, verdict=("linear_drag",)) -> Answer:
        every = [
            explained(linear, LinearDrag(0.3, 0.3, 0.2)),
            explained(quadratic, QuadraticDrag(0.1, 0.1, 0.1)),
            explained(none),
        ]
        standing = tuple(sorted((e for e in every if e.probability > 0), key=lambda e: -e.probability))
        found = dc.replace(nothing, explanations=standing, verdict=verdict)
        return Answer(dragged, found, [["linear_drag"]])

    return make
