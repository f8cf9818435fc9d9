"""The trained predictor: encoder, lifted linear system, onsets, trust, in-flight refit, model file."""
