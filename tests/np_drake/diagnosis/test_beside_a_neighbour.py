"""Laws of a diagnosis beside a neighbour, whose downwash is simulated."""

import numpy as np
import pytest

from np_drake.diagnosis.diagnose import diagnose
from np_drake.effects.downwash import Downwash
from np_drake.flight_log import FlightLog, Neighbour
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
STRENGTH = 0.6
FLIGHTS = (("a", 1), ("b", 2), ("c", 3))
VIGOUR = (0.5, 0.5, 0.5, 1.0)  # stays below the neighbour


def hovering(t, height):
    """The log of a neighbour that hovers, on a recording that began 50 s earlier."""
    p, q = np.tile([0.1, 0.0, height], (len(t), 1)), np.tile([1.0, 0, 0, 0], (len(t), 1))
    still = np.zeros_like(p)
    return FlightLog(
        t=t + 50.0,
        p=p,
        q=q,
        v=still,
        w=still,
        u=np.zeros((len(t), 4)),
        name="neighbour",
        start=-50.0,
    )


@pytest.fixture(scope="module")
def answers(fly, quick_searches):
    """Diagnoses of the same flights with and without the log of the neighbour that hovered
    above.
    """
    t = np.linspace(-1.0, 20.0, 211)
    above = hovering(t, 2.6)
    effect = Downwash(STRENGTH, (Neighbour(t, above.p),))
    logs = [
        fly(effect, name=name, seed=seed, noise=1.0, seconds=10.0, vigour=VIGOUR)
        for name, seed in FLIGHTS
    ]
    neighbours = {name: [above] for name, _ in FLIGHTS}
    return [diagnose(VEHICLE, logs[:2], logs[2:], neighbours=given) for given in (neighbours, None)]


def test_the_strength_of_a_downwash_lies_in_its_interval(answers):
    dut, _ = answers
    assert dut.verdict == ("downwash",)
    (strength,) = dut.causes[0].parameters.values()
    assert strength.ci95[0] < STRENGTH < strength.ci95[1]
    assert strength.ci95[1] - strength.ci95[0] < 0.2
    assert dut.gap_reduction.fraction > 0.9
    assert any("beside neighbour" in line for line in dut.warnings)


def test_neighbours_of_no_flight_are_refused_in_one_line(fly):
    train, held_out = (fly(name=name, seed=seed, seconds=4.0) for name, seed in FLIGHTS[:2])
    with pytest.raises(ValueError, match="neighbours: must be of a, b; got 'z'"):
        diagnose(VEHICLE, [train], [held_out], neighbours={"z": [held_out]})
