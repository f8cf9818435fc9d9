"""rotorpy's own aerodynamics and motors, which no effect of this project has exactly."""

from rotorpy.vehicles.hummingbird_params import quad_params

# Drag of the body, drag and inflow of the rotors, their lift and flapping, and the motors' time constant.
OWN = ("c_Dx", "c_Dy", "c_Dz", "k_d", "k_z", "k_h", "k_flap", "tau_m")


def own_physics() -> dict[str, float]:
    """Return these parameters of the vehicle that comes with rotorpy, the Hummingbird, as they stand there [SI]."""
    return {name: float(quad_params[name]) for name in OWN}
