"""Training of the predictor from plain arrays, by configuration."""

from collections.abc import Callable

OnEpoch = Callable[[int, int, float], None]  # called with (epoch, total, loss)
