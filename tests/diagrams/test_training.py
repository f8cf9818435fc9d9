"""Laws of learning over the envelope of a vehicle."""

import dataclasses as dc
import math

import numpy as np
import pytest

from diagrams import training
from diagrams.loop.controller_config import FILTER_MODEL
from diagrams.training import flown_error, learn_priors
from np_drake.payload_filter.bank_options import BankOptions, Prior
from np_drake.payload_filter.model_file import PayloadFilterModel
from np_drake.vehicle import Vehicle

FIRST = BankOptions()
HOW = {"model": PayloadFilterModel.load(FILTER_MODEL), "seed": 3, "vehicle": Vehicle()}


@pytest.mark.nightly
def test_the_error_of_a_drawn_flight_is_that_of_its_track_and_repeats():
    error = flown_error(5, **HOW)
    assert math.log(1e-3) < error < math.log(0.1)
    assert flown_error(5, **HOW) == error


def test_what_cannot_be_flown_counts_for_nothing(monkeypatch):
    def refuse(*_, **__):
        raise ValueError("too heavy")

    monkeypatch.setattr(training, "drawn_flight", refuse)
    assert flown_error(0, **HOW) is None


BEST = {"change": 0.05, "push": 0.5, "damping": 0.12}  # of the made error


def found(options):
    """The numbers that the made error asks for, by name."""
    own = {"push": options.push[1], "damping": options.damping.deviation}
    return {"change": options.change, **own}


def error(options):
    far = [math.log(value / BEST[name]) for name, value in found(options).items()]
    return 1.0 + sum(d**2 for d in far)


def test_the_search_finds_the_priors_of_least_error_and_changes_no_others():
    told = []
    best, course = learn_priors(FIRST, error, lambda *trial: told.append(trial))
    for name, value in found(best).items():
        assert abs(math.log(value / BEST[name])) < math.log(1.3)
    assert np.all(np.diff(course) <= 0)
    assert course[-1] == error(best)
    done, total, least = told[-1]
    assert (done, least) == (total, course[-1])
    damping, push = Prior(FIRST.damping.mean, best.damping.deviation), list(FIRST.push)
    push[1] = best.push[1]
    assert best == dc.replace(FIRST, change=best.change, damping=damping, push=tuple(push))


def test_a_gain_that_chance_would_give_changes_nothing():
    best, _ = learn_priors(FIRST, lambda o: 1.0 + 1e-4 * o.change, lambda *_: None)
    assert best == FIRST
