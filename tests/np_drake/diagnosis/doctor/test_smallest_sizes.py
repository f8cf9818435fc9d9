"""Laws of the smallest sizes that flights can tell: they follow noise and length, and are what a
fit then finds.
"""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.calibration import nuisance_of
from np_drake.diagnosis.doctor.smallest_sizes import (
    Information,
    explain,
    nearest_usual,
    smallest_gust,
    smallest_sizes,
    traces,
)
from np_drake.diagnosis.numerics import Gram, NoiseModel
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import tolerance_of
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.inertia_error import InertiaError
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.rotor_gyroscopic import RotorGyroscopic

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


def test_four_times_the_flight_is_half_the_size(flight, noise, found):
    flights = [dc.replace(flight, log=dc.replace(flight.log, name=n)) for n in "abcd"]
    longer = [dc.replace(t, columns=dict.fromkeys("abcd", t.columns["a"])) for t in found]
    short, dut = sizes([flight], noise, found), sizes(flights, noise, longer)
    for name in LINEAR:
        np.testing.assert_allclose(dut[name].alone, 0.5 * short[name].alone, rtol=1e-6)  # rounding


def test_an_effect_is_not_told_from_its_twin_and_the_twin_is_named(flight, noise, found):
    drag = next(t for t in found if t.identifier == "linear_drag")
    twin = dc.replace(drag, identifier="twin")
    dut = sizes([flight], noise, [drag, twin])["linear_drag"]
    assert dut.resembles == ("twin",)
    assert np.all(
        dut.beside > 3 * np.array(drag.typical)
    )  # no better than the prior of the twin allows
    assert np.all(dut.alone < 0.5 * np.array(drag.typical))


def test_a_simpler_case_of_an_effect_has_no_rival_in_it(flight, noise, found):
    drag = next(t for t in found if t.identifier == "linear_drag")
    along_x = dc.replace(
        drag,
        identifier="along_x",
        parameters=drag.parameters[:1],
        typical=drag.typical[:1],
        columns={n: X[..., :1] for n, X in drag.columns.items()},
    )
    assert sizes([flight], noise, [drag, along_x])["along_x"].resembles == ()


def test_a_trace_of_nothing_is_never_told(flight, noise, found):
    drag = next(t for t in found if t.identifier == "linear_drag")
    still = dc.replace(drag, columns={n: 0 * X for n, X in drag.columns.items()})
    assert np.all(sizes([flight], noise, [still])["linear_drag"].alone > 1e3)  # N·s/m


@pytest.mark.parametrize(
    "effect, parameter",
    [
        (lambda size: LinearDrag(size, 0.0, 0.0), "d_x"),
        (lambda size: InertiaError(1.0, 1 + size, 1.0), "scale_yy"),
        (lambda size: RotorGyroscopic(size), "rotor_inertia"),
        (lambda size: CenterOfMassOffset(0.0, size, 0.0), "y"),
    ],
    ids=["linear_drag", "inertia_error", "rotor_gyroscopic", "center_of_mass_offset"],
)
def test_twice_the_smallest_size_is_found_at_its_posterior(seen, effect, parameter):
    clean = _judged([seen(name="a", seed=1, noise=1.0)])
    smallest = _of(clean, effect(0.0).identifier, parameter)
    flights = [seen(effect(2 * smallest), name="a", seed=1, noise=1.0)]
    information = _judged(flights)
    size = _of(information, effect(0.0).identifier, parameter)
    estimate = _estimate(information, effect(0.0).identifier, parameter)
    assert size == pytest.approx(smallest, rel=0.2)  # the effect in the log is no noise
    assert abs(estimate - 2 * smallest) < smallest  # three deviations
    assert estimate > size


def test_gusts_are_told_from_less_in_less_noise_and_in_longer_flights():
    def of(deviation: float) -> NoiseModel:
        unit = np.full(15, deviation)
        return NoiseModel(np.zeros((15, 1)), np.diag(1 / unit), unit, unit**2, 0.02)

    dut = smallest_gust(of(0.1), 100.0)
    assert smallest_gust(of(0.05), 100.0) == pytest.approx(0.5 * dut)
    longer = smallest_gust(of(0.1), 1600.0)
    assert longer == pytest.approx(
        0.5 * dut, rel=0.02
    )  # the power as one over root T; the lowest frequencies
    assert 0.0 < dut < 0.1


@dc.dataclass(frozen=True)
class Judged:
    flights: list
    noise: NoiseModel
    nuisance: list
    traces: list


def _judged(flights) -> Judged:
    options = Options.for_sensors(tolerance_of(flights).real)
    nuisance = nuisance_of(flights, options.tolerance, options.priors)
    every = [t for t in traces(flights, options.priors) if t.identifier != "suspended_payload"]
    explained = explain(flights, nuisance, nearest_usual(every), options)
    return Judged(explained.flights, explained.noise, nuisance, every)


def _of(judged: Judged, identifier: str, parameter: str) -> float:
    information = Information(judged.flights, judged.noise, judged.nuisance, judged.traces)
    s = next(s for s in smallest_sizes(information) if s.identifier == identifier)
    return float(s.alone[s.parameters.index(parameter)])


def _estimate(judged: Judged, identifier: str, parameter: str) -> float:
    """Return the estimate of one effect beside the nuisance alone."""
    trace = next(t for t in judged.traces if t.identifier == identifier)
    blocks = [*(c.columns for c in judged.nuisance), trace.columns]
    grams = [e.gram(judged.noise, [b[e.name] for b in blocks]) for e in judged.flights]
    total: Gram = sum(grams[1:], grams[0])
    mean, _ = total.posterior(np.arange(len(total.Xy)))
    k = [p.name for p in trace.parameters].index(parameter)
    return float(mean[-len(trace.parameters) :][k] * trace.typical[k])
