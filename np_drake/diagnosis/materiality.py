"""Sizes below which an effect or a structure is immaterial."""

import dataclasses as dc


@dc.dataclass(frozen=True)
class Materiality:
    """Bounds of the region of practical equivalence with no effect; the defaults are those of real sensors.

    Source: own choice, where a field names none.
    """

    force: float = 0.006  # RMS force over weight, in all flights [1]; ideal sensors: 0.003
    torque: float = 0.01  # RMS torque over RMS commanded torque [1]; ideal sensors: 0.003
    calibration_force: float = (
        0.02  # of weight: mass and thrust below it are what vehicle files are off by [1]
    )
    still_air: float = 0.25  # mean level wind [m/s]; source: draught in rooms, ISO 7730
    sensor: float = 1.5  # size of a sensor error over the tolerance of that sensor [1]
    structure_share: float = 0.03  # of a channel's power, for a spectral line [1]


@dc.dataclass(frozen=True)
class Size:
    """Size of a term.

    Args:
        force: over weight [1].   torque: over RMS commanded torque [1].   gap: share of the gap above the noise [1].
        sensor: of a sensor error, its size over the tolerance [1].
    """

    force: float
    torque: float
    gap: float
    sensor: float

    def material(self, materiality: Materiality, *, calibration: bool, sensor: bool) -> bool:
        """Return whether the size is material.

        Args:
            calibration: whether the term is what a vehicle file may be off by.   sensor: whether it is a sensor error.
        """
        if calibration:
            return self.force >= materiality.calibration_force
        if sensor:
            return self.sensor >= materiality.sensor
        return self.force >= materiality.force or self.torque >= materiality.torque
