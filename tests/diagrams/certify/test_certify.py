"""Laws of certificates: bounds, the part that is chosen, and what is flown."""

import dataclasses as dc
import json

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from diagrams.batch.run import Run, Workers
from diagrams.certify import Bound, Range, certificate, certify
from diagrams.certify.certificate import chosen_part
from diagrams.cli.certify import sentence, tables
from diagrams.cli.main import run as command_line
from diagrams.evidence import coverage
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import load_flight
from diagrams.loop.flight_result import fly
from np_drake.effects import LinearDrag, MassError
from np_drake.effects.effect_entry import EffectEntry, Posterior
from np_drake.vehicle import Vehicle
from systems.payload_config import push

OVER = (Range("payload", 0.1, 0.5), Range("speed", 0.5, 1.5))
maps = arrays(bool, st.tuples(st.integers(1, 6), st.integers(1, 6)))


class Here(Workers):
    """Workers of this process."""

    def run(self, work, cases, **how):
        return [{"case": case, "result": work(case)} for case in cases]


def made_of(probability, seed, **how):
    """Return a certificate of flights that fail with a probability of their shares."""

    def flown(case, **_):
        rng = np.random.default_rng([seed, case["flight"]])
        lost = bool(rng.random() < probability(np.array(case["shares"])))
        told = {"payload": case["shares"][0], "speed": case["shares"][1]}
        peak = None if lost else case["shares"][0] + 0.2 * case["shares"][1]
        refused, answer = "", {"lost": lost, "grounded": False, "peak": peak, "E_xy": peak}
        return {"refused": refused, **answer, "drawn": told}

    run = Run(seed=seed, workers=Here())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(certificate, "flown", flown)
        return certify(load_experiment("circle"), OVER, run=run, **how)


@pytest.mark.parametrize("n", [1, 20, 299])
def test_the_bound_without_failures_is_closed(n):
    assert Bound(0, n, 0.95).upper == pytest.approx(1 - 0.05 ** (1 / n))


@pytest.mark.parametrize(
    "failures, flights, limit", [(0, 11, 0.01), (1, 60, 0.05), (2, 90, 0.02), (0, 0, 0.5)]
)
def test_as_many_flights_lack_as_bring_the_bound_to_the_limit(failures, flights, limit):
    lacking = Bound(failures, flights, 0.95).lacking(limit)
    assert Bound(failures, flights + lacking, 0.95).upper <= limit
    assert Bound(failures, flights + lacking - 1, 0.95).upper > limit


def test_no_flights_bring_a_bound_to_a_limit_that_failures_refute():
    assert Bound(0, 11, 0.95).lacking(0.01) == 288  # 0.99^299 is below 5 %, 0.99^298 is not
    assert Bound(0, 500, 0.95).lacking(0.01) == 0
    assert Bound(3, 11, 0.95).lacking(0.01) is None


@pytest.mark.parametrize(
    "failures, flights, said",
    [
        (0, 11, "24 %"),
        (0, 299, "1.0 %"),
        (0, 298, "1.1 %"),
        (11, 11, "100 %"),
        (0, 30000, "0.010 %"),
    ],
)
def test_a_bound_is_written_as_people_write_it_and_never_rounded_down(failures, flights, said):
    assert Bound(failures, flights, 0.95).at_most == said


@given(maps, st.sampled_from([0.0, 0.1]))
def test_the_part_fails_seldom_and_reaches_from_a_corner(failed, rate):
    part = chosen_part(failed.astype(int), np.full(failed.shape, 3), rate)
    assert failed[part].sum() <= rate * 3 * part.sum()
    assert part.all() or failed.any()
    whole = [np.flip(part, flip) for flip in ((), (0,), (1,), (0, 1))]
    assert any(all(np.all(np.diff(p.astype(int), axis=a) <= 0) for a in (0, 1)) for p in whole)


@given(maps)
def test_no_cell_can_be_added_to_the_part(failed):
    part = chosen_part(failed.astype(int), np.ones(failed.shape, int), 0.0)
    sizes = []
    for flip in ((), (0,), (1,), (0, 1)):
        seen = np.logical_or.accumulate(np.flip(failed, flip), axis=0)
        sizes.append(np.sum(~np.logical_or.accumulate(seen, axis=1)))
    assert part.sum() == max(sizes)


def test_the_bound_holds_as_often_as_it_says():
    def probability(shares):  # two cells of six are beyond it, the rest fail a little
        return np.where(shares[..., 1] > 0.66, 0.5, 0.03)

    held, flights = 0, 200
    for seed in range(flights):
        found = made_of(probability, seed, flights=80, cells=3)
        middle = (np.argwhere(found.part) + 0.5) / 3
        held += not len(middle) or np.mean(probability(middle)) <= found.bound().upper
    assert held >= 0.95 * flights - 2 * np.sqrt(flights * 0.95 * 0.05)


def test_exploring_goes_on_at_the_border():
    found = made_of(lambda shares: float(shares[1] > 0.5), 1, flights=320, cells=8)
    speed = np.array(found.flights["shares"].tolist())[80:160, 1]  # after the even quarter
    assert np.mean((speed > 0.3) & (speed < 0.5)) > 0.5
    assert found.part[:, :4].all()
    assert not found.part[:, 4:].any()
    assert found.bound().failures == 0
    assert found.bound().flights == 160
    assert sentence(found).startswith("circle with nominal is not shown")  # 160 tell 1.9 %
    assert "139 more flights without a failure would show it (--flights 598)" in sentence(found)
    assert set(found.cells[found.part]) == {"not shown: 139 more flights would"}
    assert set(found.cells[~found.part]) == {"no"}
    (_, _, rows), *_ = (table for table in tables(found) if table[0] == "what may be flown")
    assert all(said == "0.5 to 1 not shown: 139 more flights would" for _, said in rows)
    assert dc.replace(found, limit=0.02).allowed()[0][1] == "0.5 to 1"
    assert set(dc.replace(found, limit=0.02).cells[found.part]) == {"yes"}
    refuted = dc.replace(found, flights=found.flights.assign(failed=True))
    assert set(refuted.cells.ravel()) == {"no"}
    assert "fails in the part below more often than 1 %" in sentence(refuted)


def test_what_the_deviation_goes_with_comes_first():
    lines = made_of(lambda shares: 0.9 * shares[0] ** 2, 2, flights=200).drivers()
    assert lines[0]["name"] == "payload"
    assert lines[0]["rho"] > 0.5
    low, _, high = lines[0]["thirds"]
    assert low < high


def test_where_every_cell_fails_nothing_may_be_flown():
    found = made_of(lambda shares: 1.0, 3, flights=60, cells=2)
    assert found.answer == "no"
    assert found.bound() == Bound(0, 0, 0.95)
    assert "nothing may be flown" in sentence(found)
    assert [said for _, said in found.allowed()] == ["no", "no"]
    flown = "15 of 60 flights asked were flown; for 45 no part was left in which they fail seldom"
    assert found.flown_of_asked().startswith(flown)
    assert tables(found)
    true = pd.DataFrame({"shares": [[0.2, 0.2]], "failed": [False], "peak": [0.1], "E_xy": [0.1]})
    line = coverage.judged(found, true)
    assert (line["flown"], line["covered"], line["some"]) == (0, None, False)


def test_where_no_draw_can_be_flown_it_says_why():
    config = load_experiment("circle")
    config.reality.rotor_drag = 0.0
    with pytest.raises(ValueError, match="no draw can be flown"):
        certify(config, [Range("wind", 1.0, 2.0)], flights=8, cells=2, run=Run(workers=Here()))
    config.reality.effects = [EffectEntry.of(LinearDrag())]
    config.reality.wind = [1.0, 0.0, 0.0]
    config.check()


def test_a_payload_below_the_ground_fails_and_no_flight_starts_there():
    config = load_experiment("hover")
    config.duration, config.reference.ramp, config.reference.height = 0.4, 0.2, 0.93
    config.events = [push(0.1, [0.0, 0.0, -0.1])]  # the hanging payload clears it by 0.075 m
    over = [Range("tether", 0.7, 1.1)]
    how = {"config": config, "over": over, "seed": 0}
    found = [certificate.flown({"flight": 0, "shares": [k]}, **how) for k in (0.0, 0.35, 0.9)]
    assert [one["grounded"] for one in found] == [False, True, False]
    assert "the payload must hang above the ground at 0 s" in found[2]["refused"]


def test_failed_flights_are_scenario_files_that_fail_alike(tmp_path):
    config = load_experiment("hover")
    config.duration, config.reference.ramp = 0.4, 0.2
    over = (Range("payload", 0.1, 0.5),)
    found = certify(config, over, flights=4, within=1e-4, run=Run(workers=Here()), cells=1)
    paths = found.write_failed(tmp_path / "failed", seed=0)
    assert len(paths) == found.flights["failed"].sum() > 0
    number = int(paths[0].stem.rpartition("_")[2])
    flight = fly(load_flight(str(paths[0])), seed=number)
    away = np.linalg.norm(flight.flown - flight.signals["p_ref"], axis=1)
    assert away.max() == pytest.approx(found.flights["peak"][number], rel=1e-9)


def test_the_command_answers_with_bounds_map_and_files(tmp_path, capsys):
    fields = "--set reference.ramp=0.2 --duration 0.2 --controller nominal --cells 2 --flights 40"
    over = "--over payload=0.1:0.5 --over tether=0.5:0.9 --within 0.05"
    out = ["--out", str(tmp_path / "out"), "--json", str(tmp_path / "found.json")]
    command = ["certify", "hover", *over.split(), *fields.split(), *out]
    assert command_line(command) == 0
    said = capsys.readouterr().out
    assert "leaves the corridor" in said
    assert "what may be flown" in said
    values = json.loads((tmp_path / "found.json").read_text())
    assert len(values["flights"]) == 40
    assert set(values["bounds"]) == {"failed", "lost", "outside", "grounded"}
    assert values["asked"] == values["flown"] == 40
    assert "40 of 40 flights asked were flown" in said
    assert np.shape(values["cells"]) == (2, 2)
    assert (tmp_path / "out" / "map.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    "over, why",
    [
        ("reference.sped=1:2", "unknown field"),
        ("payload=0.1:0.2", "must differ"),
        ("speed=1:2 --within nan", "less than or equal to 50"),
        ("speed=1:2 --flights 20", "--flights: must be at least 4 a cell of the map, 144; got 20"),
    ],
)
def test_ranges_that_do_not_fit_are_one_line(over, why, capsys):
    command = ["certify", "circle", "--over", "payload=0.1:0.3", "--over", *over.split()]
    assert command_line(command) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert why in line
    assert line.startswith("np-drake certify: ")


def test_a_true_vehicle_is_judged_in_the_part_alone():
    found = made_of(lambda shares: float(shares[1] > 0.5), 1, flights=120, cells=2)
    places = [[0.2, 0.2], [0.8, 0.3], [0.2, 0.9]]
    true = pd.DataFrame({"shares": places, "failed": [False, True, True], "peak": [0.4, 1.1, 9.0]})
    line = coverage.judged(found, true.assign(E_xy=true["peak"]))
    assert (line["flown"], line["failed"], line["covered"]) == (2, 1, False)
    assert line["peak_seen"] == pytest.approx(0.4 + 0.95 * 0.7)


def test_errors_as_told_for_their_place_are_in_the_band():
    rng = np.random.default_rng(0)
    shares = rng.random((400, 2))
    error = 0.01 * np.exp(shares @ [1.0, 2.0] + 0.2 * rng.standard_normal(400))
    flights = pd.DataFrame({"shares": shares.tolist(), "E_xy": error})
    told, seen = flights[:200], flights[200:]
    assert coverage.in_band(told, seen) == pytest.approx(0.95, abs=0.04)
    assert coverage.in_band(told, seen.assign(E_xy=2 * seen["E_xy"])) < 0.05
    assert coverage.in_band(told, seen.assign(E_xy=None)) == 0.0


def test_naive_vehicles_lack_what_the_logs_told():
    interval = {"mass": [[1.8, 2.2]]}
    vehicle = dc.replace(Vehicle(), intervals=interval).check()
    config = dc.replace(load_experiment("circle"), vehicle=vehicle)
    config.reality.effects = [EffectEntry.of(MassError(0.1))]
    config.reality.posterior = Posterior(["mass_error.delta_mass"], [[1e-4]])
    alone = coverage.without_spread(config)
    assert certificate.drawn_flight(alone, (), (), seed=(0,))[1] == {}
    plain = coverage.with_plain_spread(config)
    _, drawn = certificate.drawn_flight(plain, (), (), seed=(0,))
    assert {"mass", "thrust_scale", "inertia[0][0]"} <= set(drawn)
    assert not plain.reality.effects
