"""LeafSystems and plant pieces; all memory lives in the Context.

The names below are the public interface; each is imported when it is first used.
"""

from np_drake.lazy_names import lazy_names

NAMES = {
    "PayloadConfig": "systems.payload_config",
    "make_tethered_quadrotor": "systems.tethered_quadrotor",
    "add_sensor_model": "systems.sensor_model",
    "add_recorder": "systems.recorder",
    "set_hover": "systems.plant",
    "NeuralPredictor": "systems.neural_predictor",
    "NpMpc": "systems.np_mpc",
    "ReferenceSource": "systems.reference_source",
    "WrenchEstimator": "systems.wrench_estimator",
    "WrenchEffects": "systems.wrench_effects",
}
__getattr__, __dir__ = lazy_names(__name__, NAMES)
