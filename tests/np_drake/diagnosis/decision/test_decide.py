"""Laws of one inference: how what remains becomes a verdict."""

import dataclasses as dc
from functools import cache
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from np_drake.diagnosis.decision import compare, confidence
from np_drake.diagnosis.decision import decide as dut_module
from np_drake.diagnosis.decision.cause_report import PROBABILITY
from np_drake.diagnosis.decision.confidence import is_vague_drift, leaves_more_than_noise
from np_drake.diagnosis.decision.decide import decide
from np_drake.diagnosis.forward_model.term import Term
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors.generic import PREFIX
from np_drake.diagnosis.result import Cause, Estimate, Finding
from np_drake.diagnosis.selection.ranking import ranked
from np_drake.effects.base import Motion, WrenchEffect
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.rigid_body import P
from np_drake.vehicle import Vehicle

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)


@dc.dataclass(frozen=True)
class Wall(WrenchEffect):
    """f_x = pull exp(-d / reach) at a distance d from a wall: no effect of the library."""

    pull: float = 0.7  # [N]
    reach: float = 0.3  # [m]
    x: float = 1.3  # where the wall is [m]

    identifier: ClassVar[str] = "wall"

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        chi = super().wrench(vehicle, motion)
        chi[..., 0] = self.pull * np.exp(-np.maximum(self.x - motion.x[..., P][..., 0], 0.0) / self.reach)
        return chi


DRAG, WALL = LinearDrag(0.3, 0.3, 0.3), Wall()


def gusts(seed: int) -> GustyWind:
    return GustyWind(0.0, 0.0, 0.0, 1.0, 0.8, seed)


@pytest.fixture(scope="module")
def flown(seen):
    """Two flights to fit and a third, each under drag and a slow force of its own, made once."""

    @cache
    def flights(*slow: WrenchEffect):
        how = {"noise": 1.0, "seconds": 10.0}
        *fitted, held_out = [seen(DRAG, s, name=str(i), seed=i, **how) for i, s in enumerate(slow, start=1)]
        return fitted, [held_out]

    return flights


def test_a_slow_force_that_follows_the_place_is_unknown_and_not_gusts(flown, inferred):
    dut = inferred(*flown(WALL, WALL, WALL))
    assert not dut.gusty
    assert "gusty_wind" not in {c.identifier for c in dut.causes}
    assert dut.unknown
    assert "place" in {f.name for f in dut.unexplained.findings}


def test_a_slow_force_that_does_not_is_gusts(flown, inferred):
    dut = inferred(*flown(gusts(61), gusts(62), gusts(63)))
    assert dut.gusty
    assert "gusty_wind" in {c.identifier for c in dut.causes}
    assert not dut.unknown


def test_gusts_are_no_surer_than_any_other_name_however_loud_they_are(flown, inferred):
    dut = inferred(*flown(gusts(61), gusts(62), gusts(63)))
    (surest,) = (c.probability for c in dut.causes if c.identifier == "gusty_wind")
    assert 0.95 * REAL.thresholds.trust < surest <= REAL.thresholds.trust


def test_the_mean_of_gusts_holds_a_steady_wind_that_the_fit_has_and_that_is_no_cause(
    flown, inferred, monkeypatch
):
    blown = flown(*(dc.replace(gusts(seed), mean_x=3.0) for seed in (61, 62, 63)))
    causes_of = dut_module.causes_of

    def without_wind(*given, **how):
        causes, minor = causes_of(*given, **how)
        return [c for c in causes if c.identifier != "constant_wind"], minor

    means = []
    for rule in (causes_of, without_wind):
        monkeypatch.setattr(dut_module, "causes_of", rule)
        dut = inferred(*blown)
        assert "constant_wind" in {t.effect.identifier for t in dut.ranking.named.terms}
        means.append(next(c for c in dut.causes if c.identifier == "gusty_wind").parameters["mean_x"].value)
    assert means[0] == pytest.approx(3.0, abs=1.0)
    assert means[1] == pytest.approx(means[0])


def test_a_drag_that_lost_an_axis_to_gusts_is_not_unknown(flown, searched, monkeypatch):
    fitted, held_out = flown(gusts(61), gusts(62), gusts(63))
    found = searched(fitted)
    ranking = ranked(found)
    assert [t.effect.identifier for t in ranking.named.terms] == ["linear_drag"]
    lost = dc.replace(ranking.named, terms=(Term(dc.replace(DRAG, d_x=-0.2)),))
    monkeypatch.setattr(compare, "ranked", lambda _: dc.replace(ranking, named=lost))
    dut = decide(compare.compare(found, held_out))
    assert not dut.unknown
    assert {c.identifier for c in dut.causes} == {"linear_drag", "gusty_wind"}


def test_without_that_rule_the_wall_would_be_gusts(flown, searched, monkeypatch):
    monkeypatch.setattr(compare, "position_p_value", lambda *_: 1.0)
    fitted, held_out = flown(WALL, WALL, WALL)
    assert compare.compare(searched(fitted), held_out).gusty


@pytest.mark.parametrize("noise, doubted", [(1.0, False), (1.3, True)])
def test_a_name_is_less_sure_where_unseen_flights_leave_more_than_noise(seen, inferred, noise, doubted):
    how = {"seconds": 10.0}
    fitted = [seen(DRAG, name=str(i), seed=i, noise=1.0, **how) for i in (1, 2)]
    dut = inferred(fitted, [seen(DRAG, name="3", seed=3, noise=noise, **how)])
    assert [c.identifier for c in dut.causes] == ["linear_drag"]
    assert not dut.unknown
    assert (dut.causes[0].probability <= REAL.thresholds.doubted) is doubted


@pytest.mark.parametrize(
    "ratio, sure, unknown", [(1.3, True, False), (1.7, False, False), (2.3, False, True)]
)
def test_what_is_left_of_lift_and_torque_in_gusts_is_none_of_theirs(
    flown, inferred, monkeypatch, ratio, sure, unknown
):
    blown = flown(gusts(61), gusts(62), gusts(63))
    monkeypatch.setattr(confidence, "misfit", lambda *_: np.array([3.0, 3.0, ratio, 1.0, 1.0, 1.0]))
    dut = inferred(*blown)
    assert dut.unknown is unknown
    assert ("upright" in {f.name for f in dut.unexplained.findings}) is unknown
    assert (max(c.probability for c in dut.causes) > 0.9) is sure


@pytest.mark.parametrize(
    "unsure, share, unknown",
    [(True, 0.7, True), (True, 0.3, False), (False, 0.7, False)],
    ids=["structure is as likely", "it is not", "nothing is near to a cause"],
)
def test_where_no_name_is_sure_and_structure_is_as_likely_it_is_unknown(
    seen, compared, monkeypatch, unsure, share, unknown
):
    doubt = Finding("linear_drag", "", 1.0, {PROBABILITY: 0.6} if unsure else {})
    monkeypatch.setattr(dut_module, "causes_of", lambda *_, **__: ([], [doubt]))
    flights = [seen(DRAG, name=str(i), seed=i, noise=1.0, seconds=10.0) for i in (1, 2, 3)]
    found = compared(flights[:2], flights[2:])
    torn = {**found.ranking.probability, f"{PREFIX}height": share}
    dut = decide(dc.replace(found, ranking=dc.replace(found.ranking, probability=torn)))
    assert dut.unknown is unknown
    assert ("height" in {f.name for f in dut.unexplained.findings}) is unknown


def left_by(options: Options, ratio: tuple[float, ...], rows: int, *, swings: bool = False):
    """What `misfits` asks of unseen flights that leave `ratio` (6,) of the noise."""
    residual = {"a": np.tile([*ratio, *[9.0] * 9], (rows, 1))}
    term = SimpleNamespace(swings=swings)
    ranking = SimpleNamespace(
        named=SimpleNamespace(terms=[term]), options=options, noise=SimpleNamespace(rms=np.ones(15))
    )
    return ranking, SimpleNamespace(held=SimpleNamespace(residual=residual, rows={"a": np.ones(rows, bool)}))


@pytest.mark.parametrize(
    "options, ratio, rows, swings, found",
    [
        (IDEAL, (1.2, 1, 1, 1, 1, 1), 1000, False, True),
        (IDEAL, (1.05, 1, 1, 1, 1, 1), 1000, False, False),
        (IDEAL, (1.05, 1, 1, 1, 1, 1), 20_000, False, False),
        (IDEAL, (1, 1, 1, 1, 1, 1.2), 100, False, False),
        (IDEAL, (1, 1, 1.2, 1, 1, 1), 1000, True, False),
        (REAL, (3, 3, 1.2, 1, 1, 1), 1000, False, False),
        (REAL, (1, 1, 1.5, 1, 1, 1), 1000, False, True),
        (REAL, (1, 1, 1, 1, 1, 1.5), 1000, False, True),
    ],
    ids=[
        "more than noise",
        "as inexact as noise is known",
        "that in a long flight",
        "a short flight, by chance",
        "a swing that is lost",
        "an attitude that wanders",
        "a rig's lift",
        "a rig's torque",
    ],
)
def test_what_is_more_than_noise_depends_on_what_sensors_and_chance_do(options, ratio, rows, swings, found):
    assert leaves_more_than_noise(*left_by(options, ratio, rows, swings=swings)) is found  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("half", "real", "found"), [(0.003, True, False), (0.004, True, True), (0.004, False, False)]
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_on_a_rig_a_drift_of_thrust_that_is_hardly_known_may_be_what_its_sensors_do(half, real, found, sign):
    rate = Estimate(sign * 0.01, "1/s", (sign * 0.01 - half, sign * 0.01 + half))
    drift = Cause("thrust_drift", 0.97, {"rate": rate}, {})
    options = REAL if real else IDEAL
    assert is_vague_drift(drift, options) is found
    assert not is_vague_drift(dc.replace(drift, identifier="mass_error"), options)
