"""Next flight: a random multisine within limits, and what its residual would tell of the
explanations that stand.
"""
