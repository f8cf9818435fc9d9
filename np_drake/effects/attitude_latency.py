"""Effect `attitude_latency`: an attitude that is older than the velocity beside it."""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.effects.base import Measurement, Parameter, SensorEffect
from np_drake.rigid_body import Q, W
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class AttitudeLatency(SensorEffect):
    """Time by which the attitude in a row is older than position and velocity; to first order in
    the body rates.

    A nuisance of logs of an estimator, whose filters delay its states by different times: never a
    cause.
    Source: own choice.
    """

    latency: float = 0.01  # [s]

    role = "nuisance"
    named = "a latency of the attitude"
    linear = False
    small = True
    corrupts = ("qw", "qx", "qy", "qz")
    parameters = (
        Parameter(
            "latency",
            "s",
            0.0,
            -0.1,
            0.1,
            0.01,
            departure=(
                "attitude logged {size} behind the velocity|attitude logged {size} "
                "before the velocity"
            ),
        ),
    )

    def measure(self, vehicle: Vehicle, truth: Measurement, white: np.ndarray) -> Measurement:
        """Return the reading with the attitude of `latency` before."""
        x = np.array(truth.x, float)
        turn = attitude.from_rotation_vector(-self.latency * x[..., W].reshape(-1, 3)).reshape(
            x[..., Q].shape
        )
        x[..., Q] = attitude.multiply(x[..., Q], turn)
        return dc.replace(truth, x=x)
