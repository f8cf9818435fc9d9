"""Gap reduction: held-out residual and open-loop replay, before and after the causes are added."""

from np_drake.diagnosis.gap.gap_reduction import measure_gap_reduction

__all__ = [
    "measure_gap_reduction",
]
