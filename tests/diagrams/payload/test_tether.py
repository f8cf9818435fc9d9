"""The payload's mode from the project's own flights: a circle with dither shows it, a plain circle
does not.
"""

import numpy as np
import pytest

from diagrams.payload.tether import fly_and_read


def test_a_dithered_circle_gives_the_tethers_length():
    length = 0.5  # [m]; others in tests/np_drake/skill, on made flights
    found = fly_and_read("training_circle", length=length, seed=0, duration=30.0)
    assert found.length == pytest.approx(length, rel=0.1)
    assert found.mode.frequency == pytest.approx(np.sqrt(9.81 / length) / (2 * np.pi), rel=0.05)
    assert found.mode.damping < 0.1


def test_a_plain_circle_cannot_and_says_so():
    found = fly_and_read("plain_circle", length=0.8, seed=0, duration=12.0)
    assert not found.shown
    assert np.isnan(found.length)
    assert "cannot show the pendulum" in found.text
