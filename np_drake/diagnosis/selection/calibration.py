"""Calibration of shares of evidence to probabilities.

Evidence is that of a model of noise which is never quite right, and of a library that does not have everything: shares
of it are too sure. Three constants were set on withheld simulated flights (`np-drake challenge`, other seeds than
those of the published results), where it is known what acts.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from np_drake.diagnosis.options import Thresholds


def calibrated_probability(share: Mapping[str, float], names: Sequence[str], thresholds: Thresholds) -> float:
    """Return the probability that one of these indistinguishable effects acts [1].

    share: of the evidence, held by the models that have an effect.   Source: own choice.
    """
    together = float(np.clip(sum(share.get(name, 0.0) for name in names), 0.0, 1.0 - 1e-12))
    odds = (together / (1.0 - together)) ** thresholds.temper
    return thresholds.trust * odds / (1.0 + odds)
