"""Baselines without training: a constant wrench, the last label held, and a disturbance
observer.
"""

import numpy as np

from np_drake import rigid_body
from np_drake.residual_model import Memory, Sample, WrenchForecast, constant_forecast
from np_drake.rotor_input import lag_shares
from np_drake.vehicle import Vehicle


class Constant:
    """Residual model chi_i = chi, whatever is measured, without memory.

    Args:
        chi: (6,) [N, N·m]; zero for the nominal controller.
        step: between samples [s].
    """

    def __init__(self, chi: np.ndarray, *, step: float, name: str):
        self.chi = chi
        self.step = step
        self.name = name

    def initial_memory(self) -> Memory:
        """Return no memory."""
        return {}

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return no memory."""
        return memory

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the constant wrench."""
        return constant_forecast(self.chi, horizon)


class Hold:
    """Residual model chi_i = label for all i; a sample without a label leaves the last one.

    Args:
        step: time between samples [s].
    """

    name = "hold"

    def __init__(self, *, step: float):
        self.step = step

    def initial_memory(self) -> Memory:
        """Return the memory before any sample: chi (6,) [N, N·m]."""
        return {"chi": np.zeros(6)}

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return the memory after one more sample; a label with NaN leaves it as it is."""
        return {"chi": sample.chi.copy()} if np.all(np.isfinite(sample.chi)) else memory

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the held wrench."""
        return constant_forecast(memory["chi"], horizon)


class DisturbanceObserver:
    """Luenberger observer of eq. (1) with a constant disturbance: chi_dot = 0.

    v_hat+ = v_hat + h v_dot(x, u, chi_hat) + l1 e,  chi_hat+ = chi_hat + M l2 e / h,  e = v -
    v_hat; both poles of the error at p = exp(-2 pi bandwidth h), so l1 = 1 - p², l2 = (1 - p)². The
    input u goes through the rotors' lag first, as the vehicle file has it.
    Source: own choice; the standard form of offset-free MPC with pole placement, with the best of
        seven pairs of bandwidths.

    Args:
        step: time between samples [s].
        force_bandwidth: [Hz].
        torque_bandwidth: [Hz].
    """

    name = "observer"

    def __init__(
        self,
        vehicle: Vehicle,
        *,
        step: float,
        force_bandwidth: float = 5.0,
        torque_bandwidth: float = 1.0,
    ):
        self.step = step
        self._vehicle = vehicle
        pole = np.exp(-2 * np.pi * np.repeat([force_bandwidth, torque_bandwidth], 3) * step)
        self._l1 = 1 - pole**2
        self._l2 = (1 - pole) ** 2
        self._mean, self._end = lag_shares(vehicle.rotor_time_constant, step)

    def initial_memory(self) -> Memory:
        """Return the memory before any sample.

        chi: (6,) [N, N·m].
        zeta: (6,) estimated [m/s, rad/s].
        x: (13,) last measured state.
        acting: (4,) input that acts [N, N·m].
        started: (1,).
        """
        return {
            "chi": np.zeros(6),
            "zeta": np.zeros(6),
            "x": np.zeros(13),
            "acting": self._vehicle.hover_input,
            "started": np.zeros(1),
        }

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return the memory after one predictor-corrector step; a sample with NaN predicts only."""
        seen = bool(np.all(np.isfinite(sample.x)))
        command = np.where(np.isfinite(sample.u), sample.u, memory["acting"])
        if not memory["started"][0]:
            if not seen:
                return memory
            return {
                **memory,
                "zeta": rigid_body.zeta(sample.x),
                "x": sample.x,
                "acting": command,
                "started": np.ones(1),
            }
        x = memory["x"].copy()
        x[7:13] = memory["zeta"]
        behind = memory["acting"] - command
        u = command + self._mean * behind
        acting = command + self._end * behind
        rate = rigid_body.state_derivative(self._vehicle, x, u, memory["chi"])
        predicted = memory["zeta"] + self.step * rate[7:13]
        if not seen:
            q = x[3:7] + self.step * rate[3:7]
            x[3:7] = q / np.linalg.norm(q)
            return {**memory, "zeta": predicted, "x": x, "acting": acting}
        error = rigid_body.zeta(sample.x) - predicted
        impulse = self._l2 * error / self.step
        wrench = [self._vehicle.mass * impulse[:3], self._vehicle.J @ impulse[3:]]
        return {
            "chi": memory["chi"] + np.concatenate(wrench),
            "zeta": predicted + self._l1 * error,
            "x": sample.x,
            "acting": acting,
            "started": np.ones(1),
        }

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the estimated disturbance, held over the horizon."""
        return constant_forecast(memory["chi"], horizon)
