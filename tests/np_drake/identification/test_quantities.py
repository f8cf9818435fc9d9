import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake.identification.estimation import parameters
from np_drake.identification.model import Frame, target_speed
from np_drake.identification.quantities import QUANTITIES, Basis
from np_drake.vehicle.vehicle import ThrottleMap

PRIOR = {p.name: p.value(0.0) for p in parameters(600.0, 0.01)}
BY_NAME = {q.name: q for q in QUANTITIES}
SQUARE = np.array([[0.1, 0.1, 0.0], [0.1, -0.1, 0.0], [-0.1, -0.1, 0.0], [-0.1, 0.1, 0.0]])


def basis(
    mass: float | None = 1.0, *, throttle: float = 0.4, coefficient: float | None = None
) -> Basis:
    frame = Frame(SQUARE, np.array([1.0, -1.0, 1.0, -1.0]), 0.08, 500.0, 0.0, throttle)
    return Basis(frame, "rotor_speed", mass, coefficient, 500.0)


@given(factor=st.floats(0.1, 10.0))
def test_what_is_per_mass_scales_with_it_and_nothing_else(factor):
    for q in QUANTITIES:
        if q.name == "mass":
            continue
        expected = q.of(PRIOR, basis(1.0)) * (factor if q.per_mass else 1.0)
        assert q.of(PRIOR, basis(factor)) == pytest.approx(expected, rel=1e-9), q.name


def test_four_rotors_in_hover_carry_the_weight():
    dut = basis(1.7)
    hovers = PRIOR | {"scale": 1.0, "charge": 1.0}
    assert 4 * dut.hover_thrust(hovers) == pytest.approx(1.7 * 9.81)


@given(gains=st.tuples(*[st.floats(-0.1, 0.1)] * 3))
def test_the_gains_of_rotors_have_the_mean_one(gains):
    v = PRIOR | dict(zip(("gain_roll", "gain_pitch", "gain_yaw"), gains, strict=True))
    assert np.mean(
        [BY_NAME[f"gain of rotor {i}"].of(v, basis()) for i in (1, 2, 3, 4)]
    ) == pytest.approx(1.0)


@given(hover=st.floats(0.2, 0.8), curve=st.floats(0.0, 0.5), idle=st.floats(0.0, 0.12))
def test_the_throttle_map_of_the_file_gives_hover_its_thrust(hover, curve, idle):
    v, dut = PRIOR | {"curve": curve, "idle": idle}, basis(1.0, throttle=hover)
    names = ("thrust at full throttle", "linear share of throttle")
    own = ThrottleMap(*(BY_NAME[name].of(v, dut) for name in names))
    assert float(own.thrust(hover)) == pytest.approx(
        dut.hover_thrust(v) * v["full_speed"] ** 2, rel=1e-6
    )
    # Elsewhere it is near the model's, which has an idle speed.
    full = BY_NAME["thrust at full throttle"].of(v, dut)
    for u in np.linspace(hover, 1.0, 5):
        assert float(own.thrust(u)) == pytest.approx(
            full * float(target_speed(np.array(u), curve, idle)) ** 2, abs=0.04 * full
        )
