"""The Neural Predictor as a LeafSystem."""

from systems.residual_predictor import ResidualPredictor


class NeuralPredictor(ResidualPredictor):
    """placeholder"""
