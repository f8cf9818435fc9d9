import dataclasses as dc

import numpy as np
import pytest

from np_drake.vehicle import Vehicle, load_vehicle


def test_mixer_and_unmixer_are_inverse():
    np.testing.assert_allclose(Vehicle().mixer @ Vehicle().unmixer, np.eye(4), atol=1e-12)


def test_saturation_leaves_what_the_rotors_can_give_and_bounds_the_rest():
    dut = Vehicle()
    np.testing.assert_allclose(dut.saturate(dut.hover_input), dut.hover_input)
    thrust = dut.saturate(np.array([[500.0, 0, 0, 0], [1.0, 3.0, 0, 0]])) @ dut.unmixer.T
    assert thrust.min() >= -1e-12
    assert thrust.max() <= dut.max_rotor_thrust + 1e-12


def test_file_round_trip_changes_only_what_it_names(tmp_path):
    file = tmp_path / "vehicle.yaml"
    file.write_text("name: mine\nmass: 1.5\n")
    dut = load_vehicle(file)
    assert (dut.name, dut.mass, dut.gravity) == ("mine", 1.5, 9.81)


@pytest.mark.parametrize(
    "text",
    [
        "mass: -1.0",
        "mas: 1.0",
        "inertia: [[1, 0], [0, 1]]",
        "inertia: [[0.1, 0, 0], [0, 0.1, 0], [0, 0, 1.0]]",
        "rotor_directions: [1, 2, 1, -1]",
        "input: stick",
        "mass: [",
        "rotor_positions: [[0,0,0],[0,0,0],[0,0,0],[0,0,0]]",
    ],
)
def test_bad_vehicle_file_gives_one_line_with_the_file(tmp_path, text):
    file = tmp_path / "vehicle.yaml"
    file.write_text(text)
    with pytest.raises(ValueError, match=r"vehicle\.yaml") as caught:
        load_vehicle(file)
    assert "\n" not in str(caught.value)


def test_missing_vehicle_file_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"nowhere\.yaml"):
        load_vehicle(tmp_path / "nowhere.yaml")


def test_changed_mass_is_checked():
    assert Vehicle().with_mass(3.0).mass == 3.0
    with pytest.raises(ValueError, match="mass"):
        dc.replace(Vehicle(), mass=float("nan")).check()
