"""Fixture: an effect that the library does not have."""

import dataclasses as dc
from typing import ClassVar

import numpy as np
import pytest

from np_drake.effects.base import WrenchEffect
from np_drake.rigid_body import W


@dc.dataclass(frozen=True)
class Damper(WrenchEffect):
    """A torque against the body rate, which the library does not have."""

    identifier: ClassVar[str] = "damper"

    def wrench(self, vehicle, motion):
        return np.concatenate([np.zeros_like(motion.x[..., W]), -0.02 * motion.x[..., W]], axis=-1)


@pytest.fixture(scope="session")
def damper() -> WrenchEffect:
    """Return a torque against the body rate."""
    return Damper()
