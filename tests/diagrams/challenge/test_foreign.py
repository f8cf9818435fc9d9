import numpy as np
import pytest

from diagrams.challenge.drake_simulator import fly
from diagrams.challenge.foreign import FOREIGN, draw_foreign
from np_drake.effects.base import Motion, WrenchEffect
from np_drake.effects.library import LIBRARY
from np_drake.labels import raw_labels


@pytest.mark.parametrize("name", FOREIGN)
def test_a_foreign_effect_flies_and_shows(name, vehicle, plan, t):
    effect = draw_foreign(name, np.random.default_rng(4), vehicle)
    assert effect.identifier == name
    assert name not in LIBRARY
    log = fly(vehicle, plan, [effect], t=t)
    chi = raw_labels(log, vehicle)
    assert np.abs(chi).max() > 1e-3
    if isinstance(effect, WrenchEffect):
        expected = effect.wrench(vehicle, Motion(log.t, log.x, log.u @ vehicle.unmixer.T))
        np.testing.assert_allclose(chi, expected, atol=1e-5)  # [N, N·m]


def test_there_are_at_least_eight():
    assert len(FOREIGN) >= 8
