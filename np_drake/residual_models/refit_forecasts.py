"""Forecasts of a whole flight where A and B are refit at every sample."""

import dataclasses as dc

import numpy as np

from np_drake.residual_model import FlightForecasts


@dc.dataclass
class RefitForecasts(FlightForecasts):
    """Forecasts at every sample of a flight, each sample with its own A (o, K, K) and B (o, K, 6).

    before: (o,) spectral radius of each refit A before it was made stable [1].
    """

    before: np.ndarray

    def at(
        self, horizons: list[int], origins: np.ndarray, zeta: np.ndarray, *, zeta_known: bool
    ) -> np.ndarray:
        """Return chi_hat (o, len(horizons), 6) of the forecasts at `origins`, see `FlightForecasts` [N, N·m]."""
        at = origins - self.first
        A, B, z = self.A[at].swapaxes(1, 2), self.B[at].swapaxes(1, 2), self.z[at][:, None]
        chi_hat = np.repeat(self.offset[at][:, None], len(horizons), axis=1)
        drive = zeta[origins][:, None] @ B
        for i in range(max(horizons) + 1):
            if i in horizons:
                chi_hat[:, horizons.index(i)] += (z @ self.C.T)[:, 0]
            if zeta_known and i > 0:
                drive = zeta[origins + i][:, None] @ B
            z = z @ A + drive
        return chi_hat
