"""Fixed dictionary of decaying modes, for which the best lifted linear system is a linear least-squares problem.

Every channel of chi has modes lambda^h of its own; chi_hat_h = sum over modes of lambda^h times an amplitude, and z
holds the amplitudes. So A = diag(lambda) is stable whatever the data say, C = 1, and only E and B are learned.
Geometrically spaced time constants represent any course that is smooth in log h.   Source: own choice, after the
basis functions of Wahlberg & Mäkilä 1996.
"""

import dataclasses as dc
import itertools

import numpy as np

from np_drake.lifting.training.horizon_ridge import GROUPS


@dc.dataclass(frozen=True)
class ModeDictionary:
    """Decaying modes of each channel of chi.

    poles: six arrays, one a channel of chi, each lambda in (0, 1) [1].
    """

    poles: tuple[np.ndarray, ...]

    def __post_init__(self):
        if len(self.poles) != 6 or any(np.any(p <= 0) or np.any(p >= 1) for p in self.poles):
            raise ValueError("ModeDictionary: there must be six lists of poles inside (0, 1).")

    @property
    def K(self) -> int:
        """Number of modes over all channels."""
        return sum(map(len, self.poles))

    @property
    def A(self) -> np.ndarray:
        """Diagonal transition matrix, (K, K)."""
        return np.diag(np.concatenate(self.poles))

    @property
    def C(self) -> np.ndarray:
        """Output matrix that sums each channel's modes, (6, K)."""
        C = np.zeros((6, self.K))
        for channel, place in enumerate(self.places):
            C[channel, place] = 1.0
        return C

    @property
    def places(self) -> list[slice]:
        """Slices of each channel's modes in z."""
        ends = np.cumsum([0] + [len(p) for p in self.poles])
        return [slice(a, b) for a, b in itertools.pairwise(ends)]

    def readout(self, horizons: np.ndarray) -> np.ndarray:
        """Return C A^h for every horizon, (H, 6, K)."""
        powers = np.concatenate(self.poles)[None] ** horizons[:, None]
        return self.C[None] * powers[:, None]

    def projector(self, horizons: np.ndarray, weights: np.ndarray, *, ridge: float = 1e-8) -> np.ndarray:
        """Return the map from a trajectory chi (H, 6) to its amplitudes z, (K, H, 6), by least squares.

        It is applied as z = einsum("khc,hc", projector, chi).
        Args: weights: (H, 2) of the errors of force and torque at each horizon.   ridge: relative to the mean power
        [1].
        """
        out = np.zeros((self.K, len(horizons), 6))
        for channel, (place, poles) in enumerate(zip(self.places, self.poles, strict=True)):
            weight = weights[:, [channel in range(*g.indices(6)) for g in GROUPS].index(True)]
            basis = poles[None] ** horizons[:, None] * weight[:, None]
            normal = basis.T @ basis
            normal[np.diag_indices(len(normal))] += ridge * np.trace(normal) / len(normal)
            out[place, :, channel] = np.linalg.solve(normal, basis.T * weight)
        return out


def time_constants(force: tuple[float, ...], torque: tuple[float, ...], level: float) -> ModeDictionary:
    """Return modes of these time constants [steps]; force has a level besides that holds for `level` steps.

    The total force of a flight has a level that lasts (thrust in excess of hover); torque has none.
    """
    f = np.exp(-1.0 / np.append(force, level))
    t = np.exp(-1.0 / np.asarray(torque, float))
    return ModeDictionary((f, f, f, t, t, t))
