import numpy as np
import pytest

from diagrams.challenge.foreign_further import RotorSaturation, SlidingLoad
from diagrams.challenge.generate.composition import compose
from diagrams.challenge.out_of_library.draw import FOREIGN, SEEN, UNSEEN, draw_foreign
from diagrams.challenge.simulators.drake.simulator import fly
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


def test_there_are_twenty_of_either_sort():
    assert len(SEEN) == 20
    assert len(UNSEEN) == 20
    assert len(FOREIGN) == 40


def test_what_nothing_was_set_on_is_in_no_usual_set_and_alone_in_its_own():
    usual, unseen = compose(200, 0, 1), compose(64, 8, 1, unseen=True)
    assert not {name for d in usual for name in d.names} & set(UNSEEN)
    assert {name for d in usual if d.kind == "foreign" for name in d.names} == set(SEEN)
    assert [d.kind for d in unseen].count("foreign") == 64
    assert [d.kind for d in unseen].count("clean") == 8
    assert {name for d in unseen for name in d.names} == set(UNSEEN)


def test_no_rotor_gives_more_than_where_it_saturates(vehicle):
    dut = RotorSaturation(2.0)
    thrust = np.array([1.0, 2.5, 2.0, 3.0])
    x = np.zeros(13)
    x[3] = 1.0
    f, tau = vehicle.mixer[0], vehicle.mixer[1:]
    expected = np.minimum(thrust, 2.0) - thrust
    chi = dut.wrench(vehicle, Motion(0.0, x, thrust))
    np.testing.assert_allclose(chi, [0.0, 0.0, f @ expected, *(tau @ expected)], atol=1e-12)


def test_a_sliding_load_lies_on_the_low_side(vehicle):
    """Nose down (pitch forward) it twists further forward; level it does nothing."""
    dut = SlidingLoad(0.3, 0.1)
    for pitch in (0.0, 0.2, -0.2):
        x = np.zeros(13)
        x[3], x[5] = np.cos(pitch / 2), np.sin(pitch / 2)
        torque = dut.wrench(vehicle, Motion(0.0, x, np.ones(4)))[3:]
        np.testing.assert_allclose(torque, [0.0, 0.3 * np.tanh(np.sin(pitch) / 0.1), 0.0], atol=1e-12)
