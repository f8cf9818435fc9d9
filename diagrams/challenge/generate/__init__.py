"""Challenge cases: drawn from a seed, flown, written with their ground truth."""
