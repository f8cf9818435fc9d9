"""Training of the predictor from plain arrays, by configuration."""
