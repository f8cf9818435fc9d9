"""The trained predictor: encoder, lifted linear system, trust, in-flight refit, model file."""
