"""Laws of the share of the rotors' torque to which the motion responds."""

import numpy as np
import pytest

from np_drake.diagnosis.calibration import torque_gain, with_torque_gain
from np_drake.diagnosis.residuals import TORQUE
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.mixer_gain import MixerGain
from np_drake.effects.suspended_payload import SuspendedPayload

SHARE = np.array([0.3, 0.5, 0.8])


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


def test_the_gain_leaves_the_gap_against_the_file_and_takes_torque_alone(weak):
    (scaled,) = with_torque_gain([weak], SHARE)
    assert scaled.against_file == pytest.approx(weak.y)
    assert scaled.nominal[:, TORQUE] == pytest.approx(weak.nominal[:, TORQUE] * SHARE, abs=1e-9)
    assert scaled.nominal[:, 2] == pytest.approx(weak.nominal[:, 2])
    assert np.sqrt(np.mean(scaled.y[:, TORQUE] ** 2)) < 0.2 * np.sqrt(
        np.mean(weak.y[:, TORQUE] ** 2)
    )
