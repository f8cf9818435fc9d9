"""Columns and published rows of the paper's estimation table.

Source of the values: Jin et al. 2025, table of estimation errors on 6 held-out flights (label
MRFsum), as printed; the NeuroMHE and NeuroBEM rows, of 13 flights, are those of Wang et al. 2024,
as the evaluation script in the authors' repository (NPU-RCIR/Neural-Predictor) has them. RMSE [N,
N·m].
"""

import numpy as np

CHANNELS = {  # of chi, in each column
    **{"F_x": [0], "F_y": [1], "F_z": [2], "tau_x": [3], "tau_y": [4], "tau_z": [5]},
    **{"F_xy": [0, 1], "tau_xy": [3, 4], "F": [0, 1, 2], "tau": [3, 4, 5]},
}
COLUMNS = tuple(CHANNELS)  # in the order of the table

PUBLISHED: dict[
    str, dict[str, tuple[float, ...]]
] = {  # flight: method: the ten columns, NP on six flights
    "3D circle 1": {
        "NeuroBEM": (0.196, 0.211, 0.215, 0.005, 0.006, 0.003, 0.288, 0.008, 0.360, 0.009),
        "NeuroMHE": (0.258, 0.269, 0.108, 0.003, 0.002, 0.003, 0.373, 0.004, 0.388, 0.005),
    },
    "figure-8 1": {
        "NeuroBEM": (0.065, 0.056, 0.235, 0.004, 0.003, 0.002, 0.085, 0.005, 0.250, 0.006),
        "NeuroMHE": (0.039, 0.056, 0.039, 0.002, 0.001, 0.002, 0.069, 0.002, 0.079, 0.003),
    },
    "race track 2": {
        "NeuroBEM": (0.262, 0.248, 0.552, 0.014, 0.012, 0.007, 0.360, 0.019, 0.659, 0.020),
        "NeuroMHE": (0.245, 0.175, 0.208, 0.012, 0.008, 0.018, 0.301, 0.014, 0.366, 0.023),
    },
    "figure-8 2": {
        "NeuroBEM": (0.051, 0.036, 0.339, 0.002, 0.002, 0.002, 0.063, 0.003, 0.345, 0.003),
        "NeuroMHE": (0.020, 0.058, 0.029, 0.002, 0.001, 0.002, 0.061, 0.002, 0.068, 0.003),
    },
    "melon 1": {
        "NeuroBEM": (0.099, 0.108, 0.397, 0.004, 0.005, 0.003, 0.147, 0.007, 0.423, 0.007),
        "NeuroMHE": (0.053, 0.059, 0.060, 0.003, 0.001, 0.002, 0.079, 0.003, 0.099, 0.004),
    },
    "figure-8 4": {
        "NeuroBEM": (0.400, 0.313, 1.084, 0.020, 0.018, 0.009, 0.508, 0.027, 1.197, 0.028),
        "NeuroMHE": (0.169, 0.174, 0.237, 0.010, 0.010, 0.007, 0.242, 0.017, 0.339, 0.018),
    },
    "ellipse": {
        "NeuroBEM": (0.204, 0.315, 1.039, 0.012, 0.008, 0.005, 0.375, 0.022, 1.105, 0.023),
        "NeuroMHE": (0.176, 0.165, 0.089, 0.005, 0.003, 0.006, 0.242, 0.006, 0.258, 0.008),
    },
    "linear oscillation": {
        "NeuroBEM": (0.164, 0.185, 0.456, 0.013, 0.011, 0.006, 0.247, 0.017, 0.518, 0.018),
        "NeuroMHE": (0.119, 0.105, 0.186, 0.011, 0.007, 0.005, 0.159, 0.013, 0.244, 0.014),
        "NP": (0.041, 0.024, 0.101, 0.007, 0.004, 0.004, 0.048, 0.008, 0.112, 0.009),
    },
    "race track 1": {
        "NeuroBEM": (0.169, 0.158, 0.463, 0.009, 0.009, 0.004, 0.231, 0.013, 0.517, 0.013),
        "NeuroMHE": (0.141, 0.092, 0.115, 0.007, 0.004, 0.004, 0.168, 0.009, 0.204, 0.009),
        "NP": (0.025, 0.018, 0.048, 0.005, 0.003, 0.002, 0.031, 0.006, 0.057, 0.006),
    },
    "3D circle 2": {
        "NeuroBEM": (0.110, 0.129, 0.470, 0.006, 0.009, 0.004, 0.170, 0.011, 0.499, 0.011),
        "NeuroMHE": (0.140, 0.135, 0.075, 0.003, 0.002, 0.004, 0.194, 0.004, 0.208, 0.006),
        "NP": (0.055, 0.021, 0.139, 0.007, 0.003, 0.004, 0.058, 0.007, 0.151, 0.008),
    },
    "figure-8 3": {
        "NeuroBEM": (0.145, 0.168, 0.584, 0.010, 0.012, 0.006, 0.221, 0.015, 0.624, 0.017),
        "NeuroMHE": (0.118, 0.133, 0.151, 0.010, 0.006, 0.005, 0.178, 0.012, 0.233, 0.013),
        "NP": (0.058, 0.029, 0.127, 0.007, 0.004, 0.004, 0.065, 0.008, 0.143, 0.009),
    },
    "melon 2": {
        "NeuroBEM": (0.244, 0.198, 0.921, 0.009, 0.006, 0.003, 0.314, 0.015, 0.974, 0.016),
        "NeuroMHE": (0.254, 0.213, 0.094, 0.005, 0.003, 0.004, 0.331, 0.005, 0.344, 0.007),
        "NP": (0.069, 0.025, 0.182, 0.009, 0.004, 0.005, 0.073, 0.010, 0.197, 0.011),
    },
    "random points": {
        "NeuroBEM": (0.161, 0.183, 0.471, 0.008, 0.008, 0.005, 0.244, 0.012, 0.530, 0.013),
        "NeuroMHE": (0.115, 0.114, 0.204, 0.010, 0.006, 0.005, 0.162, 0.012, 0.260, 0.012),
        "NP": (0.032, 0.028, 0.077, 0.007, 0.004, 0.003, 0.042, 0.008, 0.088, 0.008),
    },
}


def column_rmse(error: np.ndarray) -> dict[str, float]:
    """Return the ten columns of the table from errors (n, 6) [N, N·m].

    F_xy, F, tau_xy, tau are RMS lengths of the error vector. Rows with NaN do not count.
    Raises: ValueError: if no row without NaN is left.
    """
    error = error[np.isfinite(error).all(axis=1)]
    if not len(error):
        raise ValueError("column_rmse: the flight must have a row with a label and an estimate.")
    square = np.mean(error**2, axis=0)
    return {name: float(np.sqrt(square[channels].sum())) for name, channels in CHANNELS.items()}
