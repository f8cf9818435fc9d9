"""Laws of the smallest sizes that flights can tell: they follow noise and length, and are what a
fit then finds.
"""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.doctor.smallest_sizes import (
    Information,
    smallest_gust,
    smallest_sizes,
    traces,
)
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.options import Options

OPTIONS = Options.for_sensors(False)
LINEAR = ("linear_drag", "inertia_error", "weak_rotor", "center_of_mass_offset")


@pytest.fixture(scope="module")
def flight(seen):
    return seen(name="a", seed=1, noise=1.0)


@pytest.fixture(scope="module")
def found(flight):
    return [t for t in traces([flight], OPTIONS.priors) if t.identifier in LINEAR]


def sizes(flights, noise, found):
    return {s.identifier: s for s in smallest_sizes(Information(flights, noise, [], found))}


def test_half_the_noise_is_half_the_size(flight, noise, found):
    quiet = dc.replace(noise, mixing=2 * noise.mixing)
    loud, dut = sizes([flight], noise, found), sizes([flight], quiet, found)
    for name in LINEAR:
        np.testing.assert_allclose(dut[name].alone, 0.5 * loud[name].alone, rtol=1e-6)  # rounding


def test_an_effect_is_not_told_from_its_twin_and_the_twin_is_named(flight, noise, found):
    drag = next(t for t in found if t.identifier == "linear_drag")
    twin = dc.replace(drag, identifier="twin")
    dut = sizes([flight], noise, [drag, twin])["linear_drag"]
    assert dut.resembles == ("twin",)
    # no better than the prior of the twin allows
    assert np.all(dut.beside > 3 * np.array(drag.typical))
    assert np.all(dut.alone < 0.5 * np.array(drag.typical))


def test_a_trace_of_nothing_is_never_told(flight, noise, found):
    drag = next(t for t in found if t.identifier == "linear_drag")
    still = dc.replace(drag, columns={n: 0 * X for n, X in drag.columns.items()})
    assert np.all(sizes([flight], noise, [still])["linear_drag"].alone > 1e3)  # N·s/m


def test_gusts_are_told_from_less_in_less_noise_and_in_longer_flights():
    def of(deviation: float) -> NoiseModel:
        unit = np.full(15, deviation)
        return NoiseModel(np.zeros((15, 1)), np.diag(1 / unit), unit, unit**2, 0.02)

    dut = smallest_gust(of(0.1), 100.0)
    assert smallest_gust(of(0.05), 100.0) == pytest.approx(0.5 * dut)
    longer = smallest_gust(of(0.1), 1600.0)
    # the power as one over root T; the lowest frequencies
    assert longer == pytest.approx(0.5 * dut, rel=0.02)
    assert 0.0 < dut < 0.1
