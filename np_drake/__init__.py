"""Models, estimation, diagnosis and control without a simulator: no Diagram, LeafSystem or
MultibodyPlant.

The names below are the public interface; each is imported when it is first used. Effects are in
`np_drake.effects`.
"""

from typing import TYPE_CHECKING

from np_drake.lazy_names import lazy_names

__version__ = "0.1.0"

if TYPE_CHECKING:
    from np_drake import effects as effects
    from np_drake.diagnosis.diagnose import diagnose as diagnose
    from np_drake.flight_log import FlightLog as FlightLog
    from np_drake.identification.identify import identify as identify
    from np_drake.labels import LabelConfig as LabelConfig
    from np_drake.lifting.training.train import train as train
    from np_drake.logs.opening import open_case as open_case
    from np_drake.logs.opening import open_flights as open_flights
    from np_drake.metrics import tracking_errors as tracking_errors
    from np_drake.mpc.controller import MpcController as MpcController
    from np_drake.mpc.problem import MpcConfig as MpcConfig
    from np_drake.payload_filter.predictor import PayloadFilter as PayloadFilter
    from np_drake.references.harmonic import circle as circle
    from np_drake.references.harmonic import lemniscate as lemniscate
    from np_drake.residual_models.lifted_predictor import (
        LiftedLinearPredictor as LiftedLinearPredictor,
    )
    from np_drake.training_data.segments import Segment as Segment
    from np_drake.vehicle import Vehicle as Vehicle
    from np_drake.vehicle import load_vehicle as load_vehicle
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
