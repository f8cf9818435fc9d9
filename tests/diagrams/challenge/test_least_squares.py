"""Laws of the opponent: a planted effect is found, and BIC is sure of it."""

import numpy as np
import pytest

from diagrams.challenge.least_squares import (
    LENGTHS,
    WRENCH,
    fit,
    library_columns,
    payload_columns,
    select_by_bic,
)
from diagrams.challenge.out_of_library import OutOfLibraryWrench, periodic_force
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.vehicle import Vehicle
from tests.np_drake.diagnosis.simulated_flights import fly

STEADY = {"force": np.array([-0.5, 0.2, 0.0]), "frequency": 0.0, "phase": np.pi / 2}


def found_on(log):
    e = make_flight_residuals(log, Vehicle())
    return select_by_bic(e.y[:, :WRENCH], library_columns([e]))


def test_a_steady_force_is_a_wind():
    found = found_on(fly(OutOfLibraryWrench(periodic_force, **STEADY), seed=2, noise=0.1))
    assert found.get("constant_wind", 0.0) > 0.99


def test_columns_of_noise_are_not_chosen_and_a_planted_one_is():
    draw = np.random.default_rng(0)
    y = draw.normal(size=(2000, 6))
    noise = [(f"noise_{i}", draw.normal(size=(2000, 6, 2))) for i in range(5)]
    assert select_by_bic(y, noise) == {}
    planted = ("planted", y[..., None] + draw.normal(size=(2000, 6, 1)))
    assert list(select_by_bic(y, [*noise, planted])) == ["planted"]


def test_the_criterion_is_that_of_gaussian_noise():
    draw = np.random.default_rng(1)
    X, noise = draw.normal(size=(500, 6, 2)), 0.1 * draw.normal(size=(500, 6))
    y = X @ [0.3, -0.2] + noise
    c, bic = fit(y, [("made", X)])
    assert c == pytest.approx([0.3, -0.2], abs=0.01)  # noise over root of 3000 rows
    left = np.mean((y - X @ c) ** 2, axis=0)
    assert bic == pytest.approx(500 * np.log(left).sum() + 2 * np.log(3000))


def test_a_planted_payload_is_found_at_its_length():
    mass, length = 0.15, LENGTHS[13]
    log = fly(
        SuspendedPayload(mass, length, 0.0, 0.0, 0.0, damping=0.1), seed=4, noise=0.1, vigour=0.5
    )
    assert found_on(log).get("suspended_payload", 0.0) > 0.99
    e = make_flight_residuals(log, Vehicle())
    y = e.y[:, :WRENCH] * [1, 1, 1, 0, 0, 0]
    fits = [fit(y, [columns]) for columns in payload_columns([e])]
    best = min(range(len(LENGTHS)), key=lambda i: fits[i][1])
    assert best == 13
    assert fits[best][0][0] == pytest.approx(mass, rel=0.06)  # linear about hanging still
