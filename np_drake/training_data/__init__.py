"""Training data: segments of wrench labels and motion from flight logs."""
