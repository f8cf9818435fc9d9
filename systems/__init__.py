"""LeafSystems and plant pieces; all memory lives in the Context.

The names below are the public interface; each is imported when it is first used.
"""

from typing import TYPE_CHECKING

from np_drake.lazy_names import lazy_names

if TYPE_CHECKING:
    from systems.neural_predictor import NeuralPredictor as NeuralPredictor
    from systems.np_mpc import NpMpc as NpMpc
    from systems.payload_config import PayloadConfig as PayloadConfig
    from systems.plant import set_hover as set_hover
    from systems.recorder import add_recorder as add_recorder
    from systems.reference_source import ReferenceSource as ReferenceSource
    from systems.sensor_model import add_sensor_model as add_sensor_model
    from systems.tethered_quadrotor import make_tethered_quadrotor as make_tethered_quadrotor
    from systems.wrench_effects import WrenchEffects as WrenchEffects
    from systems.wrench_estimator import WrenchEstimator as WrenchEstimator
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
