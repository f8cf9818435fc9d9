"""Which effects are reported as causes, and with which probability."""

from np_drake.diagnosis.decision.causes import joint_posterior
from np_drake.diagnosis.decision.explanations import explanations_of
from np_drake.diagnosis.decision.infer import Inference, infer
from np_drake.diagnosis.decision.second_answer import novelty, second_answer, without_onsets_in

__all__ = [
    "Inference",
    "explanations_of",
    "infer",
    "joint_posterior",
    "novelty",
    "second_answer",
    "without_onsets_in",
]
