"""Simple residual models that others are measured by."""
