"""TODO."""

import dataclasses as dc

# Of weight, in all flights, on a rig and in a laboratory [1]; own choice.
LEAST_FORCE = {True: 0.006, False: 0.003}
MATERIAL_FORCE = 0.01  # of weight, of structure that is no effect [1]; own choice
MATERIAL_TORQUE = 0.01  # of RMS commanded torque [1]
EXACT = 0.3  # of that structure and torque, where logs come from a laboratory [1]; own choice
CALIBRATED = 0.02  # of weight, below which mass and thrust are within what files are off by [1]
MATERIAL_GAP = 0.10  # of the gap above the noise [1]
LEAST_SHARE = 1e-5  # of it, less than what the causes beside it get wrong [1]; own choice: 0.3 % in size
LEAST_FORCED = 1e-3  # the same beside a payload, which no pendulum is to more than 3 %; own choice
MATERIAL_SENSOR = 1.5  # of the tolerance of that sensor [1]


@dc.dataclass(frozen=True)
class Size:
    """How large a term is: force over weight, torque over RMS commanded torque, share of the gap above noise,

    and of a sensor error, its size over the rig's tolerance [1].
    """

    force: float
    torque: float
    gap: float
    sensor: float

    def material(self, *, calibration: bool, sensor: bool, real: bool, least: float = LEAST_SHARE) -> bool:
        """Does it matter?   real: to a rig, not to a laboratory.   least: of the gap."""
        if self.gap < least:
            return False
        if calibration:
            return self.force >= CALIBRATED
        if sensor:
            return self.sensor >= MATERIAL_SENSOR
        torque = MATERIAL_TORQUE * (1.0 if real else EXACT)
        strong = self.force >= LEAST_FORCE[real] or self.torque >= torque
        return strong or self.gap >= MATERIAL_GAP
