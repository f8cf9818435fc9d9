"""Laws of the share of the rotors' torque to which the motion responds."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.calibration import LEAST_GAIN as LEAST
from np_drake.diagnosis.calibration import torque_gain, with_torque_gain
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.residuals import TORQUE
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.ground_effect import GroundEffect
from np_drake.effects.mixer_gain import MixerGain
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.weak_rotor import WeakRotor

SHARE = np.array([0.3, 0.5, 0.8])
PAYLOAD = SuspendedPayload(mass=0.1, length=1.0, hook_x=0.05)


@pytest.fixture(scope="module")
def weak(seen):
    """Return a flight of which the motion shows a share of the logged torque."""
    return seen(MixerGain(*SHARE), name="a", seed=1, seconds=8.0)


def test_the_gain_is_the_share_of_torque_that_the_motion_shows(weak):
    assert torque_gain([weak]) == pytest.approx(SHARE, abs=0.05)


@pytest.mark.parametrize(
    "effect", [BladeFlapping(0.3), SuspendedPayload(0.2, 0.7, hook_z=-0.1)], ids=str
)
def test_torque_that_trims_a_moment_is_shown(seen, effect):
    dut = seen(MixerGain(*SHARE), effect, name="a", seed=1, seconds=8.0)
    assert torque_gain([dut]) == pytest.approx(SHARE, abs=0.05)


def test_torque_of_which_the_motion_shows_nothing_keeps_a_little(weak):
    y = weak.y.copy()
    y[:, TORQUE] = -weak.nominal[:, TORQUE]
    assert torque_gain([dc.replace(weak, y=y)]) == pytest.approx([LEAST] * 3)


def test_the_gain_leaves_the_gap_against_the_file_and_takes_torque_alone(weak):
    (scaled,) = with_torque_gain([weak], SHARE)
    assert scaled.against_file == pytest.approx(weak.y)
    assert scaled.nominal[:, TORQUE] == pytest.approx(weak.nominal[:, TORQUE] * SHARE, abs=1e-9)
    assert scaled.nominal[:, 2] == pytest.approx(weak.nominal[:, 2])
    assert np.sqrt(np.mean(scaled.y[:, TORQUE] ** 2)) < 0.2 * np.sqrt(
        np.mean(weak.y[:, TORQUE] ** 2)
    )


@pytest.mark.parametrize(
    "effect",
    [WeakRotor(1.0, 0.8), CenterOfMassOffset(0.02, 0.0, 0.0), GroundEffect(0.3), PAYLOAD],
    ids=str,
)
def test_a_share_of_the_torque_of_every_effect_is_shown(weak, effect):
    (scaled,) = with_torque_gain([weak], SHARE)
    whole, shown = (predicted_residual(e, [Term(effect)]) for e in (weak, scaled))
    assert shown[:, TORQUE] == pytest.approx(whole[:, TORQUE] * SHARE, abs=1e-9)
    assert shown[:, :3] == pytest.approx(whole[:, :3], abs=1e-9)
