"""Laws of the effect `thrust_ceiling`."""

import numpy as np

from np_drake.effects.effect_entry import EffectEntry
from np_drake.effects.library import LIBRARY
from np_drake.effects.thrust_ceiling import ThrustCeiling
from np_drake.vehicle import Vehicle


def test_no_rotor_gives_more_than_the_ceiling():
    thrust = ThrustCeiling(share=0.5).thrust(
        Vehicle(), np.zeros(0), np.array([1.0, 5.9, 6.1, 12.0])
    )
    np.testing.assert_allclose(thrust, [1.0, 5.9, 6.0, 6.0])  # half of 12 N


def test_a_scenario_may_name_it_and_the_diagnosis_does_not_look_for_it():
    assert EffectEntry("thrust_ceiling", {"share": 0.6}, onset=2.0).check().made == ThrustCeiling(
        0.6
    )
    assert "thrust_ceiling" not in LIBRARY
