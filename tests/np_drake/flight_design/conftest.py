"""Fixtures of a design: white readings of plausible size, and pairs of explanations that hover
cannot tell apart.
"""

import numpy as np
import pytest

from np_drake.diagnosis.numerics import NoiseModel, Readings
from np_drake.diagnosis.options import IDEAL_SENSORS
from np_drake.effects.explanation import Explanation
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.flight_design.limits import limits_for
from np_drake.vehicle import Vehicle

RMS = np.repeat(
    [0.5, 0.05, 0.05, 0.2, 0.05], 3
)  # of force, torque and three rates [N, N·m, m/s, m/s², rad/s]


@pytest.fixture(scope="session")
def readings() -> Readings:
    noise = NoiseModel(np.zeros((15, 1)), np.diag(1 / RMS), RMS, RMS**2, 0.02)
    return Readings(noise, IDEAL_SENSORS)


def explained(effect, probability, *deviations) -> Explanation:
    names = tuple(f"{effect.identifier}.{p.name}" for p in effect.parameters)
    return Explanation(
        (effect.identifier,), probability, (effect,), (), names, np.diag(np.square(deviations))
    )


@pytest.fixture(scope="session")
def nothing() -> Explanation:
    return Explanation((), 0.5, ())


@pytest.fixture(scope="session")
def drag() -> Explanation:
    return explained(LinearDrag(0.1, 0.1, 0.1), 0.5, 0.05, 0.05, 0.05)


@pytest.fixture(scope="session")
def heavy() -> list[Explanation]:
    """Return a mass error and the thrust scale that hovers alike."""
    scale = Vehicle().mass / (Vehicle().mass + 0.2)
    return [explained(MassError(0.2), 0.5, 0.05), explained(ThrustScale(scale), 0.5, 0.02)]


@pytest.fixture(scope="session")
def limits(heavy):
    return limits_for(Vehicle(), heavy, box=(4.0, 4.0, 2.5), speed=3.0, tilt=0.5)
