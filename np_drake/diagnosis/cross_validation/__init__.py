"""Predictive evidence: what the terms of a model gain in flights and blocks of time that did not
fit them.
"""

from np_drake.diagnosis.cross_validation.support import Support, support_of

__all__ = ["Support", "support_of"]
