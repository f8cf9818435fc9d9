import numpy as np

from np_drake.identification.estimation import parameters
from np_drake.vehicle.published import dimensionless, published_vehicles


def test_published_vehicles_lie_within_three_deviations_of_the_priors():
    known = {p.name: p for p in parameters(600.0, 0.01)}
    of = {
        "jxx": "inertia",
        "jyy": "inertia_pitch",
        "jzz": "inertia_yaw",
        "torque": "torque_lever",
        "lag": "time_constant",
    }
    for vehicle in published_vehicles():
        told = dimensionless(vehicle)
        for name, number in of.items():
            if number in told:
                assert abs(np.log(told[number]) - known[name].mean) < 3 * known[name].sd, (
                    vehicle.name,
                    name,
                )
