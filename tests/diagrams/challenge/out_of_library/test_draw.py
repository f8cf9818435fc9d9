import numpy as np
import pytest

from diagrams.challenge.generate.composition import compose
from diagrams.challenge.out_of_library.draw import DEVELOPMENT, HOLDOUT, OUT_OF_LIBRARY, draw_out_of_library
from diagrams.challenge.simulators.drake.simulator import fly
from np_drake.effects.base import Motion, WrenchEffect
from np_drake.effects.library import LIBRARY
from np_drake.labels import raw_labels


@pytest.mark.parametrize("name", OUT_OF_LIBRARY)
def test_an_out_of_library_effect_flies_and_shows(name, vehicle, plan, t):
    effect = draw_out_of_library(name, np.random.default_rng(4), vehicle)
    assert effect.identifier == name
    assert name not in LIBRARY
    log = fly(vehicle, plan, [effect], t=t)
    chi = raw_labels(log, vehicle)
    assert np.abs(chi).max() > 1e-3
    if isinstance(effect, WrenchEffect):
        expected = effect.wrench(vehicle, Motion(log.t, log.x, log.u @ vehicle.unmixer.T))
        np.testing.assert_allclose(chi, expected, atol=1e-5)  # [N, N·m]


def test_there_are_twenty_of_either_sort():
    assert len(DEVELOPMENT) == 20
    assert len(HOLDOUT) == 20
    assert len(OUT_OF_LIBRARY) == 40


def test_held_out_effects_are_in_no_ordinary_set_and_alone_in_their_own():
    usual, unseen = compose(200, 0, 1), compose(64, 8, 1, unseen=True)
    assert not {name for d in usual for name in d.names} & set(HOLDOUT)
    assert {name for d in usual if d.kind == "foreign" for name in d.names} == set(DEVELOPMENT)
    assert [d.kind for d in unseen].count("foreign") == 64
    assert [d.kind for d in unseen].count("clean") == 8
    assert {name for d in unseen for name in d.names} == set(HOLDOUT)
