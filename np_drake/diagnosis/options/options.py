"""All constants that steer the answer of a diagnosis, resolved for real or ideal sensors."""

import dataclasses as dc

from np_drake.diagnosis.materiality import Materiality
from np_drake.diagnosis.options.priors import Priors
from np_drake.diagnosis.options.thresholds import Thresholds
from np_drake.diagnosis.tolerance import IDEAL_SENSORS, Tolerance


@dc.dataclass(frozen=True)
class Options:
    """What a diagnosis is made with; change fields by `dataclasses.replace`."""

    tolerance: Tolerance  # what vehicle file and sensors may be off by
    materiality: Materiality  # sizes below which effects are immaterial
    priors: Priors  # of models and parameters
    thresholds: Thresholds  # of the decision

    @classmethod
    def for_sensors(cls, real: bool, tolerance: Tolerance | None = None) -> "Options":
        """Return the options for real or ideal sensors.

        Args:
            real: whether logs come from real sensors.
            tolerance: of vehicle file and sensors; default: `Tolerance()` where real, else `IDEAL_SENSORS`.
        """
        if real:
            return cls(tolerance or Tolerance(), Materiality(), Priors(), Thresholds())
        return cls(
            tolerance or IDEAL_SENSORS,
            Materiality(effect_force=0.003, exactness=0.3),
            Priors(pendulum_mass=0.006, pendulum_length=0.003, pendulum_hook=0.0003, pendulum_damping=0.003),
            Thresholds(sure=0.75, split_misfit=1.25, slow_torque=9.0, gust_interval=1.0),
        )
