"""How the residuals of another flight are read: the noise model of a diagnosis, and the tolerances that it used."""

import dataclasses as dc
from collections.abc import Mapping
from typing import Any

import numpy as np

from np_drake.diagnosis.numerics.autoregressive_noise import NoiseModel
from np_drake.diagnosis.options import Tolerance


@dc.dataclass(frozen=True)
class Readings:
    """Noise of the residuals and tolerances of vehicle file and sensors that a diagnosis found or used."""

    noise: NoiseModel
    tolerance: Tolerance

    def as_json(self) -> dict[str, Any]:
        """Return noise and tolerances in plain types."""
        noise = self.noise
        arrays = {name: getattr(noise, name).tolist() for name in ("phi", "mixing", "rms", "innovation")}
        return {"noise": {**arrays, "step": noise.step}, "tolerance": dc.asdict(self.tolerance)}

    @classmethod
    def of_json(cls, content: Mapping[str, Any]) -> "Readings":
        """Return the readings that `as_json` wrote."""
        found = content["noise"]
        phi, mixing, rms, innovation = (
            np.array(found[name], float) for name in ("phi", "mixing", "rms", "innovation")
        )
        noise = NoiseModel(phi, mixing, rms, innovation, float(found["step"]))
        return cls(noise, Tolerance(**content["tolerance"]))
