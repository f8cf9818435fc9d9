"""Recovery of every library effect: it is flown, fitted from a weaker one, and found again."""

import numpy as np
import pytest

from np_drake.diagnosis.fitting import read, refine
from np_drake.diagnosis.forward_model import Term
from np_drake.diagnosis.options import Options
from np_drake.effects.base import Effect
from np_drake.effects.library import LIBRARY
from np_drake.effects.linear_drag import LinearDrag

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)

ELSEWHERE = {
    "suspended_payload": "test_refine",
    "gusty_wind": "test_gusts",
}  # hidden states are found otherwise
SIGNS = (1.0, -0.6, 0.8)
NEAR_THE_GROUND = {"effective_radius": 1.2}  # [m]: at which a flight two metres up feels it
INEXACT = 0.01  # of a figure that is typical: what a lag of 30 ms suffers on a grid of 20 ms
DRAG = LinearDrag(0.4, 0.4, 0.4)


def strong(name: str, share: float) -> Effect:
    """Return that share of a typical effect."""
    values = {}
    signs = (
        np.abs(SIGNS) if LIBRARY[name].prior_correlation else SIGNS
    )  # axes that are alike have one sign
    for p, sign in zip(LIBRARY[name].parameters, [*signs] * 2, strict=False):
        if p.choices:
            values[p.name] = p.choices[1]
        else:
            one_sided = p.lower >= p.neutral
            away = NEAR_THE_GROUND.get(p.name, p.typical) * (1.0 if one_sided else sign)
            values[p.name] = float(np.clip(p.neutral + share * away, p.lower, p.upper))
    return LIBRARY[name].of(values)


@pytest.mark.parametrize("name", sorted(set(LIBRARY) - set(ELSEWHERE)))
def test_what_flies_is_found_again_within_its_interval(seen, noise, name):
    true = [strong(name, 1.0)]
    start = [strong(name, 0.5)]
    if LIBRARY[name].needs:
        true, start = [DRAG, *true], [DRAG, *start]
    flights = [seen(*true, noise=1.0, seconds=10.0, name=str(i), seed=i) for i in (1, 2)]
    dut = refine([Term(e) for e in start], [], flights, noise, temperature=1.0, priors=REAL.priors)
    expected = read([Term(e) for e in true], dut.free)
    deviation = np.sqrt(np.diag(dut.covariance))
    grid = INEXACT * np.array([f.scale for f in dut.free])
    np.testing.assert_array_less(np.abs(dut.values - expected), 3.5 * deviation + grid)
    told = [abs(v - f.neutral) / d for v, f, d in zip(expected, dut.free, deviation, strict=True)]
    assert max(told) > 4.0  # an interval that holds everything shows nothing
