"""Models, estimation, diagnosis and control without a simulator: no Diagram, LeafSystem or
MultibodyPlant.

The names below are the public interface; each is imported when it is first used. Effects are in
`np_drake.effects`.
"""

from np_drake.lazy_names import lazy_names

__version__ = "0.1.0"

NAMES = {
    "Vehicle": "np_drake.vehicle",
    "load_vehicle": "np_drake.vehicle",
    "FlightLog": "np_drake.flight_log",
    "open_flights": "np_drake.logs.opening",
    "open_case": "np_drake.logs.opening",
    "circle": "np_drake.references.harmonic",
    "lemniscate": "np_drake.references.harmonic",
    "effects": "np_drake.effects",
    "train": "np_drake.lifting.training.train",
    "NeuralPredictor": "np_drake.residual_models.neural_predictor",
    "PayloadFilter": "np_drake.payload_filter.predictor",
    "MpcConfig": "np_drake.mpc.problem",
    "diagnose": "np_drake.diagnosis.diagnose",
    "identify": "np_drake.identification.identify",
    "tracking_errors": "np_drake.metrics",
}
__getattr__, __dir__ = lazy_names(__name__, NAMES)
