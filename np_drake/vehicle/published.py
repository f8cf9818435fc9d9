"""Published quadrotors, and what they tell before a flight does: dimensionless numbers with their
spread.

`presets/published.csv` holds what its sources measured, identified or drew. A value that a source
copies from another vehicle, computes from a simple body or tunes for a simulation is left out. A
source with one time constant has it for both directions.

Columns: name, source, and in SI the mass, the arm (mean distance of the rotors from the middle),
inertia about the centre of mass, thrust_coefficient, torque_over_thrust, rotor_radius,
max_rotor_thrust of one rotor, time constants of a rotor that speeds up and down, and rotor_inertia
about its axis; a figure that is not published is empty.
"""

import dataclasses as dc
import math
from functools import cache
from typing import Any

import numpy as np

from np_drake.vehicle.vehicle import AIR, GRAVITY, PRESETS

FILE = PRESETS / "published.csv"


@dc.dataclass(frozen=True)
class LogNormal:
    """Spread of a positive number over published vehicles: its logarithm is normal."""

    mean: float  # of the logarithm
    deviation: float  # of the logarithm
    count: int  # vehicles that tell it

    @property
    def median(self) -> float:
        """Median of the number."""
        return math.exp(self.mean)

    def within(self, deviations: float = 1.96) -> tuple[float, float]:
        """Return the ends of the interval of so many standard deviations, 95 % by default."""
        spread = deviations * self.deviation
        return math.exp(self.mean - spread), math.exp(self.mean + spread)


@dc.dataclass(frozen=True)
class DimensionlessPriors:
    """Spread of dimensionless numbers over the published vehicles, m mass, l arm, R rotor radius.

    Time constants are in seconds, for the published ones do not go with the size of the rotor.
    """

    thrust_to_weight: LogNormal  # 4 max_rotor_thrust / (m g)
    inertia: LogNormal  # J_xx / (m l²)
    inertia_pitch: LogNormal  # J_yy / J_xx
    inertia_yaw: LogNormal  # J_zz / (J_xx + J_yy)
    torque_lever: LogNormal  # torque over thrust and R
    thrust_number: LogNormal  # C_T = T / (rho n² (2 R)⁴), n in revolutions a second
    time_constant: LogNormal  # of a rotor that speeds up [s]
    time_constant_down: LogNormal  # over that of one that speeds up
    rotor_inertia: LogNormal  # of one rotor over m l²


@cache
def published_priors() -> DimensionlessPriors:
    """Return mean and standard deviation of the logarithms over all vehicles that tell a number."""
    import pandas as pd

    spreads = {}
    for name, column in dimensionless(pd.read_csv(FILE)).items():
        logs = np.log(column.dropna().to_numpy())
        spreads[str(name)] = LogNormal(float(logs.mean()), float(logs.std(ddof=1)), len(logs))
    return DimensionlessPriors(**spreads)


def dimensionless(v: Any) -> dict[str, Any]:
    """Return the numbers of `DimensionlessPriors` of vehicles in a table; NaN where one is not
    published.
    """
    unit = 1 / v["mass"]
    radius = 1 / v["rotor_radius"]
    arm = 1 / v["arm"]
    factor = (2 * math.pi) ** 2 / AIR / 16
    return {
        "thrust_to_weight": 4 * v["max_rotor_thrust"] * (1 / GRAVITY) * unit,
        "inertia": v["inertia_xx"] * unit * arm * arm,
        "inertia_pitch": v["inertia_yy"] * (1 / v["inertia_xx"]),
        "inertia_yaw": v["inertia_zz"] * (1 / (v["inertia_xx"] + v["inertia_yy"])),
        "torque_lever": v["torque_over_thrust"] * radius,
        "thrust_number": v["thrust_coefficient"] * factor * radius * radius * radius * radius,
        "time_constant": v["time_constant_up"],
        "time_constant_down": v["time_constant_down"] * (1 / v["time_constant_up"]),
        "rotor_inertia": v["rotor_inertia"] * unit * arm * arm,
    }
