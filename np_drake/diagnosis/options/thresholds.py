"""Probabilities and ratios from which a diagnosis decides."""

import dataclasses as dc


@dc.dataclass(frozen=True)
class Thresholds:
    """Thresholds of the decision; the defaults are those of real sensors.

    Source: own choice, where a field names none. Probabilities and ratios are pure numbers.
    """

    # A cause.
    sure: float = 0.5  # least probability; ideal sensors: 0.75
    significance: float = 0.95  # confidence level of the Wald test that parameters are not none
    same: float = 3.5  # difference of log evidence below which two effects are indistinguishable
    most_same: int = 2  # effects named as indistinguishable from a cause
    # Second answer.
    split_misfit: float = 1.6  # held-out residual over noise from which a split is made; ideal sensors: 1.25
    split_payload: float = (
        0.01  # probability of a payload from which one that begins in flight is sought again
    )
    split_half: float = 4.0  # least length of either half [s]
    # Tests of what is left.
    line: float = 20.0  # power of a spectral line over its neighbourhood
    slow_torque: float = 12.0  # over that of gyro noise; ideal sensors: 9
    clear_torque: float = 6.0  # times `slow_torque`, above which its share does not matter
    burst: float = 8.0  # of a slow force over its usual deviation
    lift: float = 5.0  # of a flight's mean lift over the tolerance
    held_out_share: float = 0.4  # share of a threshold that held-out flights must show too
    held_out_power: float = 0.3  # share of slow power left of held-out flights that no good model leaves
    swing_power: float = 0.25  # the same beside a payload: what a swing leaves that is lost at a snap
    novel: float = 2.0  # times a threshold at which held-out flights suffice
    steepness: float = 6.0  # slope of the probability's logit in the logarithm of a ratio
    # Gusts.
    doubted: float = 0.8  # most probability of gusts, and of their drag, that are hardly possible
    slow_force_felt: float = 4.0  # log evidence of even odds, where a drag feels the force
    slow_force: float = 7.0  # the same where no drag does
    place: float = 1e-3  # probability below which a slow force does not follow the place by chance
    strongest_wind: float = 8.0  # deviation of gusts [m/s]; as `GustyWind`
    friction: float = 2.0  # standard deviations of a dry friction that gusts do not have
    faint_friction: float = 1.3  # the same that gusts hardly have
    gust_interval: float = (
        2.0  # factor on the intervals of gusts, which sensor drift resembles; ideal sensors: 1
    )

    def slow_force_evidence(self, *, felt: bool) -> float:
        """Return the log evidence at which a slow force has even odds; `felt`: whether a drag feels it."""
        return self.slow_force_felt if felt else self.slow_force
