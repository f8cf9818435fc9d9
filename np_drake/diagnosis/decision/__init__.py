"""Which effects are reported as causes, and with which probability."""

from np_drake.diagnosis.decision.adaptive_split import JOINED, infer_adaptively, without_onsets_in
from np_drake.diagnosis.decision.infer import infer

__all__ = [
    "JOINED",
    "infer",
    "infer_adaptively",
    "without_onsets_in",
]
