import numpy as np
import pandas as pd

from np_drake.identification.estimation import parameters
from np_drake.vehicle.published import FILE, dimensionless


def test_published_vehicles_lie_within_three_deviations_of_the_priors():
    known = {p.name: p for p in parameters(600.0, 0.01)}
    of = {
        "jxx": "inertia",
        "jyy": "inertia_pitch",
        "jzz": "inertia_yaw",
        "torque": "torque_lever",
        "lag": "time_constant",
    }
    told = dimensionless(pd.read_csv(FILE))
    for name, number in of.items():
        off = np.abs(np.log(told[number].dropna()) - known[name].mean)
        assert (off < 3 * known[name].sd).all(), name
