"""Wind effects that the library does not have: closed forms of their laws."""

import numpy as np

from diagrams.challenge.out_of_library.wind import DoorwayDraft, PassingVehicle, StandingEddy
from np_drake.effects.base import Motion

LEVEL = np.eye(13)[3]  # at the origin, at rest


def test_an_eddy_pushes_round_its_axis_and_most_at_its_core(vehicle, moving):
    """Counter-clockwise from above: north of the axis to the west; none on it."""
    dut = StandingEddy(0.4, (1.0, -1.0), 0.5)
    for y, push in ((-0.5, 0.4), (0.0, 0.8 * np.exp(-1.5)), (-1.0, 0.0), (-1.5, -0.4)):
        chi = dut.wrench(vehicle, Motion(0.0, moving((0, 0, 0), p=(1.0, y, 2.0)), np.ones(4)))
        np.testing.assert_allclose(chi, [-push, 0, 0, 0, 0, 0], atol=1e-12)


def test_a_draft_blows_on_one_side_and_half_at_its_edge(vehicle, moving):
    dut = DoorwayDraft((0.3, -0.2, 0.1), (0.0, 1.0, 0.0), 0.5, 0.1)
    for y, share in ((2.0, 1.0), (0.5, 0.5), (-2.0, 0.0)):
        chi = dut.wrench(vehicle, Motion(0.0, moving((0, 0, 0), p=(0.0, y, 1.0)), np.ones(4)))
        np.testing.assert_allclose(chi, share * np.array([0.3, -0.2, 0.1, 0, 0, 0]), atol=1e-12)


def test_a_vehicle_passes_once_in_every_period(vehicle):
    """Right below it pushes only; a duration before and after it twists to opposite sides."""
    dut = PassingVehicle(force=2.0, lever=0.1, course=0.0, period=4.0, passage=1.0, duration=0.2)
    t = np.array([1.0, 5.0, 13.0, 0.8, 1.2, 5.2, 3.0])
    chi = dut.wrench(vehicle, Motion(t, np.tile(LEVEL, (7, 1)), np.ones((7, 4))))
    edge = 2.0 * np.exp(-0.5)
    np.testing.assert_allclose(chi[:, 2], [-2.0, -2.0, -2.0, -edge, -edge, -edge, 0.0], atol=1e-9)
    np.testing.assert_allclose(
        chi[:, 3], [0, 0, 0, -0.1 * edge, 0.1 * edge, 0.1 * edge, 0], atol=1e-9
    )
