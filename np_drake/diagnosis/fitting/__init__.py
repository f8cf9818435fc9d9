"""Maximum a posteriori parameters of one model."""
