"""Ground and wall effects that the library does not have: closed forms of their laws."""

import numpy as np

from diagrams.challenge.out_of_library.ground_and_walls import PlatformEdge, TiltedCushion
from np_drake.effects.base import Motion


def test_a_cushion_rights_what_leans_near_the_ground(vehicle):
    """Nose down (pitch forward) it raises the nose, by a share of 1 / e less a reach higher; level
    it does nothing.
    """
    dut, thrust = TiltedCushion(0.02, 0.8), np.array([4.0, 5.0, 6.0, 5.0])
    for pitch, height, share in (
        (0.3, 0.0, 1.0),
        (0.3, 0.8, np.exp(-1.0)),
        (0.3, -1.0, 1.0),
        (0.0, 0.0, 0.0),
    ):
        x = np.array([0.0, 0.0, height, np.cos(pitch / 2), 0.0, np.sin(pitch / 2), *np.zeros(7)])
        chi = dut.wrench(vehicle, Motion(0.0, x, thrust))
        np.testing.assert_allclose(
            chi, [0, 0, 0, 0, -0.02 * 20.0 * share * np.sin(0.3), 0], atol=1e-12
        )


def test_only_rotors_over_a_platform_feel_it(vehicle, moving):
    """Right over the edge the front rotors alone gain, and raise the nose; a reach higher 1 / e of
    that.
    """
    dut = PlatformEdge(0.1, 0.5, 0.2, normal=(1.0, 0.0, 0.0), from_origin=1.0, edge=1e-3)
    front = np.array(vehicle.rotor_positions)[:, 0] > 0
    thrust, z = np.array([4.0, 5.0, 6.0, 5.0]), np.array(vehicle.rotor_positions)[0, 2]
    for x, height, gained in (
        (1.0, 0.2, 0.1 * thrust * front),
        (1.0, 0.7, 0.1 / np.e * thrust * front),
        (2.0, 0.2, 0.1 * thrust),
        (0.0, 0.2, np.zeros(4)),
    ):
        state = moving((0, 0, 0), p=(x, 0.0, height - z))
        chi = dut.wrench(vehicle, Motion(0.0, state, thrust))
        np.testing.assert_allclose(chi, [0, 0, *(vehicle.mixer @ gained)], atol=1e-9)
