import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake.lifting.training import family_training
from np_drake.lifting.training.excitation import measure_excitation
from np_drake.lifting.training.family_training import LiftedConfig
from np_drake.lifting.training.train import train

VZ, FZ = 2, 2


def vertical_gain(model) -> float:
    """Largest response of f_z to v_z within the horizon [N per m/s]."""
    s = model.system
    response = [s.C @ np.linalg.matrix_power(s.A, i) @ s.B for i in range(40)]
    return float(np.abs(np.sum(response, axis=0)[FZ, VZ]))


def test_on_a_plain_circle_the_vertical_speed_is_noise(plain):
    dut = measure_excitation([plain.zeta], step=0.02)
    assert dut.shrink[VZ, VZ] < 0.1
    assert "vz" in dut.text.split("shrunk along")[1]
    assert 0.8 < dut.line_share <= 1.0
    assert dut.line_frequency == pytest.approx(1.5 / (2 * np.pi), abs=0.02)


def test_with_dither_it_is_not(dithered):
    dut = measure_excitation([dithered.zeta], step=0.02)
    assert dut.shrink[VZ, VZ] > 0.8
    assert dut.excited.all()


def test_b_is_shrunk_where_the_flight_said_nothing(plain, trained):
    assert vertical_gain(train([plain.segment], LiftedConfig(steps=500)).model) < 0.1
    assert vertical_gain(trained.model) > 0.1


def test_unguarded_the_same_flight_teaches_nonsense(plain, monkeypatch):
    """What the guard is for: believed in every direction, the fit answers v_z with force."""
    monkeypatch.setattr(
        family_training,
        "measure_excitation",
        lambda *a, **k: dc.replace(measure_excitation(*a, **k), gain=np.ones(6)),
    )
    assert vertical_gain(train([plain.segment], LiftedConfig(steps=500)).model) > 0.5


@given(st.integers(0, 1000), st.floats(0.05, 20.0))
def test_trust_lies_between_none_and_all_and_grows_with_motion(seed, size):
    motion = np.random.default_rng(seed).standard_normal((300, 6)).cumsum(axis=0)
    small, large = (
        measure_excitation([scale * motion], np.full(6, 0.01)) for scale in (size, 2 * size)
    )
    assert np.all((small.gain >= 0) & (small.gain <= 1))
    assert np.all(large.gain >= small.gain - 1e-9)


def test_shrinking_keeps_what_was_excited():
    motion = np.sin(np.arange(3000)[:, None] * 0.02 * np.linspace(1.0, 3.0, 6))
    np.testing.assert_allclose(measure_excitation([motion]).shrink, np.eye(6), atol=0.02)


def test_what_is_shrunk_does_not_depend_on_units(plain):
    units = np.repeat([100.0, 180.0 / np.pi], 3)  # cm/s and degrees/s
    si, other = (
        measure_excitation([scale * plain.zeta], step=0.02).shrink for scale in (1.0, units)
    )
    np.testing.assert_allclose(other, units[:, None] * si / units, atol=1e-9)


def test_a_locked_pair_of_channels_is_one_direction():
    t = np.arange(3000) * 0.02
    zeta = 0.01 * np.random.default_rng(0).standard_normal((3000, 6))
    zeta[:, 0] += np.sin(t)
    zeta[:, 4] += np.sin(t)
    dut = measure_excitation([zeta], np.full(6, 0.01), step=0.02)
    assert dut.excited.sum() == 1
    assert "1 of 6 directions" in dut.text
