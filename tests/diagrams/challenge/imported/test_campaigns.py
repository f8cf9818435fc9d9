"""Laws of the campaigns on logs of other origin: what is written is what a map reads, and outcomes are told apart."""

import itertools

import numpy as np
import pytest

from diagrams.challenge.generate.logged_input import as_logged
from diagrams.challenge.imported import conventions, round_trip, thinned
from diagrams.challenge.imported.written import columns_in, default_map, quantities_of, write_table
from np_drake.flight_log import FlightLog
from np_drake.logs.importing.conventions import changed
from np_drake.logs.importing.convert import convert


def made(rows=60, seed=0):
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(rows, 4))
    three = [rng.normal(size=(rows, 3)) for _ in range(4)]
    return FlightLog(
        t=0.01 * np.arange(rows),
        p=three[0],
        q=q / np.linalg.norm(q, axis=1, keepdims=True),
        v=three[1],
        w=three[2],
        a=three[3],
        u=rng.uniform(1.0, 9.0, (rows, 4)),
    )


@pytest.mark.parametrize("error", conventions.ERRORS)
def test_what_is_written_in_conventions_is_read_with_their_map(error):
    x = quantities_of(made())
    own = changed(default_map(list(x)), conventions.ERRORS[error])
    found = convert(columns_in(x, own), own)
    found["attitude"] *= np.sign(np.sum(found["attitude"] * x["attitude"], axis=1, keepdims=True))
    for name, value in x.items():
        assert np.allclose(found[name], value, atol=1e-12), name


@pytest.mark.parametrize("error", [e for e in conventions.ERRORS if e != "time in ms"])
def test_every_error_changes_a_column(error):
    x = quantities_of(made())
    declared = default_map(list(x))
    own = columns_in(x, changed(declared, conventions.ERRORS[error]))
    assert any(not np.allclose(own[name], column) for name, column in columns_in(x, declared).items())


def test_every_single_error_comes_first_and_no_pair_twice():
    dut = conventions.errors_of(40, seed=1)
    assert [errors for errors in dut if len(errors) == 1] == [(name,) for name in conventions.ERRORS]
    assert len(set(dut)) == 40
    for pair in dut[len(conventions.ERRORS) :]:
        options = [option for name in pair for option, _ in conventions.ERRORS[name]]
        assert len(set(options)) == len(options)


def test_a_table_holds_times_in_the_unit_of_the_map(tmp_path):
    log = made()
    x = quantities_of(log)
    own = changed(default_map(list(x)), (("time.unit", "ms"),))
    write_table(tmp_path / "t.csv", log.t, columns_in(x, own), own)
    rows = np.genfromtxt(tmp_path / "t.csv", delimiter=",", names=True)
    assert np.allclose(rows["t"], 1000 * log.t)
    assert np.allclose(rows["position_1"], log.p[:, 1], rtol=1e-8)


def test_thinned_cases_count_causes_of_timing_and_others():
    def case(verdict, naive=()):
        return thinned.ThinnedCase(0, "drake", "clean", 2, verdict, naive)

    dut = [case(("clock_offset", "unknown")), case(("linear_drag",)), case((), ("motor_lag",))]
    assert thinned.count(dut, "verdict") == (1, 2)
    assert thinned.count(dut, "naive") == (1, 0)


def test_round_trips_cover_every_rate_with_every_meaning_and_every_input():
    for full in (False, True):
        dut = round_trip.tasks(full=full)
        product = set(itertools.product(round_trip.RATES, round_trip.SEMANTICS))
        assert {(rate, semantics) for _, _, rate, semantics, kind in dut if kind == "command"} == product
        assert {kind for *_, kind in dut} == {"command", *round_trip.INPUTS}
        assert {effect for _, effect, *_ in dut} == set(round_trip.EFFECTS)


def test_a_row_holds_the_command_that_its_meaning_says():
    log = made(8)
    assert np.array_equal(as_logged(log, "held_after", 1).u, log.u)
    assert np.array_equal(as_logged(log, "held_before", 1).u[1:], log.u[:-1])
    assert np.allclose(as_logged(log, "averaged", 2).u, 0.5 * (log.u[::2] + log.u[1::2]))
    assert np.array_equal(as_logged(log, "sampled", 2).u, log.u[::2])
