import dataclasses as dc
import re

import numpy as np
import pytest
from scipy import signal

from np_drake import attitude
from np_drake.identification.identify import Identification, doubts, identify, trades
from tests.np_drake.identification import analytic

TRUTH = {  # name: (value, tolerance of it), beside which the interval must hold the value nearly
    "thrust coefficient": (9e-6, 3e-8),
    "inertia xx": (0.011, 1e-4),
    "inertia yy": (0.013, 1e-4),
    "inertia zz": (0.02, 6e-4),
    "inertia xy": (-0.0002, 5e-5),
    "inertia xz": (0.0001, 1e-4),
    "inertia yz": (0.00015, 1e-4),
    "centre of mass x": (0.003, 2e-4),
    "centre of mass y": (-0.002, 2e-4),
    "gain of rotor 1": (1.01, 5e-3),
    "gain of rotor 4": (0.985, 5e-3),
    "torque over thrust": (1.9e-7 / 9e-6, 6e-4),
    "inertia of a rotor": (4e-6, 2e-7),
    "time constant up": (0.03, 1e-3),
    "time constant down": (0.04, 1e-3),
    "transport delay": (0.008, 1e-3),
    "thrust at full throttle": (10.0, 0.1),
    "IMU x": (0.01, 5e-4),
    "IMU y": (-0.012, 5e-4),
    "IMU z": (0.008, 5e-4),
    "IMU tilt x": (0.03, 4e-3),
    "IMU tilt y": (-0.02, 4e-3),
    "drag, lateral": (0.1, 0.01),
}


@pytest.fixture(scope="module")
def again():
    """Identify from logs with the mass, on the shortest flights."""

    def run(*logs, **options) -> Identification:
        return identify(
            logs,
            options.pop("prior", analytic.KNOWN),
            mass=options.pop("mass", analytic.TRUE.mass),
            **options,
        )

    return run


@pytest.fixture(scope="module")
def short():
    return analytic.flight(seed=7, seconds=5.0)


@pytest.fixture(scope="module")
def alone(again, short):
    return again(short)


def test_a_collective_command_tells_its_curve_and_no_rotor(by_collective):
    dut = by_collective
    truth = {  # value, and what the unequal rotors of the flight change
        "hover command": (0.5, 0.01),
        "thrust over command at hover, in weights": (1 / 0.44, 0.03),
        "command without thrust": (0.06, 0.02),
        "time constant up": (0.03, 0.004),
        "transport delay": (0.008, 0.004),
        "drag, lateral": (0.1, 0.01),
    }
    for name, (value, tolerance) in truth.items():
        assert dut[name].value == pytest.approx(value, abs=tolerance), name
        assert dut[name].low - tolerance < value < dut[name].high + tolerance
        assert dut[name].observable, name
    named = " ".join(q.name for q in dut.quantities)
    assert not any(word in named for word in ("inertia", "rotor", "torque", "centre of mass"))


@pytest.mark.parametrize("kind", ["found", "by_throttle"])
def test_a_flight_in_closed_form_tells_its_vehicle(kind, request):
    dut = request.getfixturevalue(kind)
    for name in TRUTH.keys() & {q.name for q in dut.quantities}:
        value, tolerance = TRUTH[name]
        assert dut[name].value == pytest.approx(value, abs=tolerance), name
        assert dut[name].low - tolerance < value < dut[name].high + tolerance


def framed(dut: Identification, **changed) -> Identification:
    """Return an identification with other given values of the vehicle."""
    frame = dc.replace(dut.basis.frame, **changed)
    return dc.replace(dut, basis=dc.replace(dut.basis, frame=frame))


def shifted(dut: Identification, name: str, deviations: float) -> Identification:
    """Return an identification with one parameter elsewhere in its prior."""
    z = dut.estimate.z.copy()
    z[dut.estimate.layout.names.index(name)] = deviations
    return dc.replace(dut, estimate=dc.replace(dut.estimate, z=z))


def test_physics_doubts_values_of_no_vehicle(found, by_throttle):
    fits = framed(found, radius=0.12)  # C_T 0.09
    assert doubts(fits) == []
    (doubt,) = doubts(framed(found, radius=0.06))
    assert re.match(r"thrust coefficient: C_T.*12 or 14 poles\?", doubt)
    xx, yy = doubts(shifted(fits, "jxx", 4.0))
    assert xx.startswith("inertia xx: its share of m l²")
    assert "wheelbase" in yy
    assert doubts(by_throttle) == []
    (doubt,) = doubts(shifted(by_throttle, "curve", -2.5))
    assert re.match("thrust at full throttle.*ends of the throttle", doubt)


def test_a_centre_of_mass_that_unequal_rotors_explain_trades_against_them(found):
    names = found.estimate.layout.names
    covariance = 1e-4 * np.eye(len(found.estimate.z))
    i, k = names.index("com_x"), names.index("gain_pitch")
    dut = dc.replace(found, estimate=dc.replace(found.estimate, covariances=(covariance,)))
    assert trades(dut) == []
    covariance[np.ix_([i, k], [i, k])] = [[1.0, -0.99], [-0.99, 1.0]]
    dut = dc.replace(dut)
    gains = [f"gain of rotor {number}" for number in range(1, 5)]
    assert trades(dut) == [(["centre of mass x"], gains)]


def test_neither_heading_nor_place_of_the_world_matter(alone, again, short):
    turn = attitude.from_rotation_vector(np.array([[0.0, 0.0, 1.9]]))
    turned = {
        f: attitude.rotate(np.broadcast_to(turn, short.q.shape), getattr(short, f)) for f in "pva"
    }
    turned["p"] = turned["p"] + [50.0, -20.0, 7.0]
    other = again(dc.replace(short, q=attitude.multiply(turn, short.q), **turned))
    for a, b in zip(alone.quantities, other.quantities, strict=True):
        assert abs(a.value - b.value) <= 1e-4 * (a.high - a.low), a.name
        assert (a.name, b.high - b.low) == (b.name, pytest.approx(a.high - a.low, rel=5e-4))


def test_the_unit_of_rotor_speed_scales_the_coefficient_alone(alone, again, short):
    other = again(dc.replace(short, rotor=short.rotor * 10.0))
    assert other["thrust coefficient"].value == pytest.approx(
        alone["thrust coefficient"].value / 100.0, rel=1e-3
    )
    for name in ("inertia xx", "inertia zz", "centre of mass x", "torque over thrust", "IMU x"):
        assert other[name].value == pytest.approx(
            alone[name].value, abs=0.1 * (alone[name].high - alone[name].low)
        )


def test_without_mass_quantities_are_over_the_mass(alone, again, short):
    ratios = again(short, mass=None)
    assert ratios.basis.ratios
    assert ratios["inertia xx"].value == pytest.approx(
        alone["inertia xx"].value / analytic.TRUE.mass, rel=1e-6
    )


def test_a_trusted_coefficient_tells_the_mass(again, short):
    right = dc.replace(analytic.KNOWN, thrust_coefficient=9e-6)
    dut = again(short, mass=None, prior=right, trusted=True)
    assert not dut.basis.ratios
    assert dut["mass"].value == pytest.approx(1.3, rel=0.01)
    assert dut["mass"].low < dut["mass"].value < dut["mass"].high


def test_flights_that_differ_in_inertia_disagree_on_it_alone_and_widen_it(found, flights, again):
    heavier = np.array(analytic.TRUE.inertia) * np.array([[1.1, 1, 1], [1, 1, 1], [1, 1, 1]])
    other = analytic.flight(dc.replace(analytic.TRUE, inertia=heavier.tolist()), 2, seconds=10.0)
    dut = again(*flights[:2], other)
    assert dut["inertia xx"].p < 0.01
    ratio, usual = (q.high / q.low - 1.0 for q in (dut["inertia xx"], found["inertia xx"]))
    assert ratio > 5 * usual
    assert dut["inertia xx"].low < 0.0121
    assert dut["inertia xx"].high > 0.011
    assert dut["IMU x"].p > 0.01
    assert dut["thrust coefficient"].p > 0.01


@pytest.mark.parametrize("kind", ["desk", "thrown"])
def test_a_log_that_does_not_fly_is_refused_in_a_line(again, short, kind):
    rest = (
        dc.replace(short, rotor=0 * short.rotor)
        if kind == "desk"
        else dc.replace(short, a=short.a * 0 - [0, 0, 9.81])
    )
    with pytest.raises(ValueError, match=r"identify: .*flight7") as told:
        again(rest)
    assert "\n" not in str(told.value)


def noisy_commands(size: float) -> Identification:
    """Return what flights tell whose logged torque holds noise that the motion did not answer."""
    rng = np.random.default_rng(5)
    logs = []
    for seed in range(2):
        log = analytic.flight(seed=seed, seconds=10.0, drive="command")
        noise = signal.lfilter([0.2], [1.0, -0.8], rng.normal(size=log.u.shape), axis=0)
        logs.append(dc.replace(log, u=log.u + size * noise * log.u.std(axis=0) * [0, 1, 1, 1]))
    return identify(logs, analytic.KNOWN, mass=analytic.TRUE.mass)


def test_noise_of_the_input_shows_by_its_power():
    exact, loud, twice = (noisy_commands(size).input_noise[:2] for size in (0.0, 0.1, 0.2))
    assert (exact < 0.002).all()
    np.testing.assert_allclose((twice - exact) / (loud - exact), 4.0, rtol=0.4)


def test_an_inertia_may_be_smaller_by_all_that_noise_of_the_input_explains(found):
    dut = dc.replace(found, input_noise=np.array([1.0, 0.0, 0.0]))
    smaller, before = dut["inertia xx"], found["inertia xx"]
    assert smaller.low < 0.6 * before.value
    assert smaller.high > before.value
    assert 0.7 * before.value < smaller.value < 0.9 * before.value
    assert dut["inertia yy"].value == pytest.approx(found["inertia yy"].value, rel=1e-4)
