"""Laws of one inference: how causes and what they leave become a verdict."""

import dataclasses as dc
import importlib
from typing import ClassVar

import numpy as np
import pytest

from np_drake.effects.base import Motion, WrenchEffect
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.rigid_body import P
from np_drake.vehicle import Vehicle

module = importlib.import_module("np_drake.diagnosis.diagnose")


@dc.dataclass(frozen=True)
class Wall(WrenchEffect):
    """f_x = pull exp(-d / reach) at a distance d from a wall: no effect of the library."""

    pull: float = 0.7  # [N]
    reach: float = 0.3  # [m]
    x: float = 1.3  # where the wall is [m]

    parameters: ClassVar[tuple] = ()

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        chi = super().wrench(vehicle, motion)
        chi[..., 0] = self.pull * np.exp(
            -np.maximum(self.x - motion.x[..., P][..., 0], 0.0) / self.reach
        )
        return chi


DRAG, WALL = LinearDrag(0.3, 0.3, 0.3), Wall()


@pytest.fixture(scope="module")
def of(seen, inferred):
    """Return the inference of two flights and a third under drag and a slow force each."""

    def inference(*slow: WrenchEffect):
        how = {"noise": 1.0, "seconds": 10.0}
        flights = [seen(DRAG, s, name=str(i), seed=i, **how) for i, s in enumerate(slow, start=1)]
        return inferred(flights[:2], flights[2:])

    return inference


def test_a_cause_that_predicts_beside_what_is_not_named_alone_is_none(seen, inferred):
    def inference(*effects):
        flights = [seen(*effects, name=n, seed=i, noise=1.0) for i, n in enumerate("abc", start=1)]
        return inferred(flights[:2], flights[2:])

    found, clean = inference(DRAG, MassError(0.15)), inference()
    (drag,) = (c for c in found.causes if c.identifier == "linear_drag")
    dut = dc.replace(found, causes=[drag])
    assert [c.identifier for c in module.as_named(dut).causes] == ["linear_drag"]
    elsewhere = dc.replace(found.ranking, problem=clean.ranking.problem)
    alone = module.as_named(dc.replace(dut, ranking=elsewhere, held_out=clean.held_out))
    assert alone.causes == []
    assert "predict" in alone.below_threshold[-1].text


def test_a_force_that_follows_the_place_is_unknown_and_not_gusts(of):
    dut = of(WALL, WALL, WALL)
    assert dut.remainder.matters
    assert "gusty_wind" not in {c.identifier for c in dut.causes}
    assert "place" in {f.name for f in dut.findings}


def test_a_slow_force_that_follows_no_place_is_gusts(of):
    dut = of(*(GustyWind(0.0, 0.0, 0.0, 1.0, 0.8, seed) for seed in (61, 62, 63)))
    assert {c.identifier for c in dut.causes} == {"linear_drag", "gusty_wind"}
    assert not dut.remainder.matters
