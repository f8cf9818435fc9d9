"""One half of the flights of a real set, identified, and judged on the other half."""

import dataclasses as dc
import time
from typing import Any

import numpy as np

from diagrams.batch.campaign import Case
from diagrams.identification.real_sets import SETS, Folders, halves, open_set, stated_mass
from np_drake.identification.identify import identify
from np_drake.identification.signals import G
from np_drake.identification.validation import HORIZONS, HeldOut, held_out


@dc.dataclass(frozen=True)
class HalfCase:
    """Work of a case {"set", "half"}."""

    folders: Folders

    def __call__(self, case: Case) -> dict[str, Any]:
        """Return what the half tells, and errors of three models on the flights of the other.

        Raises: LogError: if a log cannot be used.
        """
        name = case["set"]
        parts = halves(self.folders.files(name))
        fitted, judging = (
            open_set(name, part) for part in (parts[case["half"]], parts[1 - case["half"]])
        )
        start = time.process_time()
        found = identify(fitted, SETS[name].nominal, mass=stated_mass(name))
        quantities = found.quantities
        spent = time.process_time() - start
        weight = found.basis.mass_of(found.estimate.layout.values(found.estimate.z)) * G
        return {
            "flights": [log.name for log in fitted],
            "seconds": sum(float(log.t[-1] - log.t[0]) for log in fitted),
            "drive": found.basis.drive,
            "ratios": found.basis.ratios,
            "processor_time": spent,
            "quantities": [
                {
                    "name": q.name,
                    "unit": q.quantity.unit,
                    "positive": q.quantity.positive,
                    "value": q.value,
                    "ci95": [q.low, q.high],
                    "told": q.told,
                    "p": q.p,
                }
                for q in quantities
            ],
            "held_out": [
                _errors(row, weight, found.basis.frame.arm)
                for row in held_out(found, judging, plain=True)
            ],
        }


def _errors(row: HeldOut, weight: float, arm: float) -> dict[str, Any]:
    """Return force over weight, torque over weight times arm [1], and open-loop errors by
    horizon.
    """
    return {
        "flight": row.flight,
        "model": row.model,
        "force": float(np.linalg.norm(row.force)) / weight,
        "torque": float(np.linalg.norm(row.torque)) / (weight * arm),
        "open_loop": {
            f"{horizon:g}": list(e) for horizon, e in zip(HORIZONS, row.open_loop, strict=True)
        },
    }
