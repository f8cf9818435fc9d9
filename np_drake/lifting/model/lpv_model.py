"""A lifted linear system that a network schedules: linear parameter-varying (LPV).

    theta = N(statistics of the window),   z = sum_j g_j E_j w
    z+ = A(theta) z + B(theta) zeta,   chi_hat = C(theta) z

theta is held within a horizon. A vehicle that hovers is the same in x and y, and left to right. So
two vertical planes have one law, and heave another; this holds at yaw near zero. The statistics
stay the same where a flight is turned or mirrored.

The states of a plane are oscillators and decays, those of heave decays: A is stable by
construction. The other states are a level of the torque in each plane and the last velocity, which
C reads as drag. The torque about z is not among them.   Source: own choice; scheduling as in LPV
identification, Toth 2010.
"""

import dataclasses as dc
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem, Taps
from np_drake.trained_model import STEPS, Array, ModelFile, Perceptron, number_in, summary_in
from np_drake.vehicle import Vehicle
from np_drake.vehicle.scaling import PERIOD, ratios

NEURAL_LPV = "neural-lpv"
LPV_SCHEMA = "np_drake.lpv_model/1"  # format of the file and its version
TAPS = Taps.averaging(100, 8, 12)  # what the encoders see of a window
BLOCKS = 10  # means of which the statistics are made [1]
BLOCK = 8  # samples of each [1]
DECAYS = np.exp(-1.0 / np.array([75.0, 300.0]))  # of the statistics over a sample [1]
NEW = 400.0  # samples during which a flight counts as new [1]
ARM = 0.1  # unit of a torque over that of a force, of the paper's vehicle [m]
LEAST = 1e-3  # added to mean squares before their logarithm [1]
# Force, velocity, body rate and torque of each plane: columns of [chi, zeta]
CHANNELS = np.array([0, 6, 10, 4, 1, 7, 9, 3])
# of these columns
SIGNS = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, -1.0, -1.0])
VERTICAL = [2, 8]  # force and velocity of heave
OSCILLATORS = 2  # of a plane
DECAYING = 3  # decays of a plane, and of heave
PLANE = 2 * OSCILLATORS + DECAYING  # states of a plane
LEVEL = 2 * PLANE + DECAYING  # first state that is a level of the torque
VELOCITY = LEVEL + 2  # first state that is the last velocity
K = VELOCITY + 3
RATES = 2 * OSCILLATORS + 2 * DECAYING  # rates that the network writes, as logarithms
# Bounds of these logarithms, of rates in 1/step: from slower than a flight to a step or two; own
# choice
LOWEST = np.log(5e-5)
HIGHEST = np.log(0.6)
# What the network writes: rates, inputs of each state, drag in the planes and in heave
PARAMETERS = RATES + PLANE + DECAYING + 2
ARRAYS = ("experts", "lifts", "level", "torque", "probes", "glances")  # that are learned
MOST = 20.0  # largest logarithm of a gate [1]


def units_of(vehicle: Vehicle, step: float) -> tuple[float, float, float, float]:
    """Return the units of force, torque, velocity and body rate in which vehicles of any size look
    alike: of a force 1 m/s² of the mass; time is counted in steps.

    Args:
        step: between samples [s].
    """
    clock = step / PERIOD
    return vehicle.mass, vehicle.mass * ARM * ratios(vehicle).length, clock, 1 / clock


@dc.dataclass(frozen=True)
class Features:
    """What the model reads of windows (..., 100, 12), scaled, oldest sample first."""

    planes: np.ndarray  # (..., 2, taps 4) force, velocity, body rate and torque
    heave: np.ndarray  # (..., taps 2) force and velocity
    blocks: np.ndarray  # (..., 2, BLOCKS 2) means of force and velocity
    climb: np.ndarray  # (..., 2) vertical velocity, and its change over a block

    @classmethod
    def of(cls, windows: np.ndarray) -> "Features":
        """Return the features of windows."""
        shape = windows.shape[:-2]
        moved = windows[..., CHANNELS] * SIGNS
        seen = (TAPS.matrix @ moved).reshape(*shape, -1, 2, 4)
        parts = moved[..., -BLOCKS * BLOCK :, :].reshape(*shape, BLOCKS, BLOCK, 2, 4)
        up = windows[..., 8]
        return cls(
            np.moveaxis(seen, -2, -3).reshape(*shape, 2, -1),
            (TAPS.matrix @ windows[..., VERTICAL]).reshape(*shape, -1),
            np.moveaxis(parts[..., :2].mean(axis=-3), -2, -3).reshape(*shape, 2, -1),
            np.stack([up[..., -1], up[..., -1] - up[..., -1 - BLOCK]], axis=-1),
        )


@dc.dataclass(frozen=True)
class LpvModel(ModelFile):
    """Trained predictor as held by a model file; all but `scale` and `step` without units."""

    step: float  # [s]
    scale: np.ndarray  # (12,) units of [chi, zeta] [N, N·m, m/s, rad/s]
    experts: Array  # (J, PLANE, taps 4) encoders of a plane
    lifts: Array  # (J, DECAYING, taps 2) of heave
    level: Array  # (taps 4,) of the level of the torque
    torque: Array  # (PLANE,) of the states of a plane in its torque
    probes: Array  # (2, P, BLOCKS 2) what the statistics of each decay are taken of
    glances: Array  # (Q, taps 4) of which the present size is read
    network: Perceptron  # of the statistics: gates and theta
    summary: dict[str, Any] = dc.field(default_factory=dict)  # of the training, for people

    configuration = NEURAL_LPV
    schema = LPV_SCHEMA
    window = TAPS.delay

    def __post_init__(self):
        J = len(self.experts)
        taps = len(TAPS.matrix)
        P = self.probes.shape[1]
        Q = len(self.glances)
        shapes = {
            "scale": (12,),
            "experts": (J, PLANE, 4 * taps),
            "lifts": (J, DECAYING, 2 * taps),
            "level": (4 * taps,),
            "torque": (PLANE,),
            "probes": (len(DECAYS), P, 2 * BLOCKS),
            "glances": (Q, 4 * taps),
        }
        for name, shape in shapes.items():
            actual = getattr(self, name).shape
            require(actual == shape, f"LpvModel: {name} must be {shape}; got {actual}.")
        require(np.all(self.scale > 0), "LpvModel: scale must be positive.")
        read = len(DECAYS) * (P + 2) + Q + 2 * taps + 1
        self.network.require_sizes(read, J + PARAMETERS)

    def in_numpy(self) -> "LpvModel":
        """Return the model with arrays in the place of tensors."""
        arrays: dict[str, Any] = {name: np.asarray(getattr(self, name), float) for name in ARRAYS}
        return dc.replace(self, **arrays, network=self.network.in_numpy())

    def energies(self, features: Features) -> np.ndarray:
        """Return the squares (2, P + 2) whose decaying means are the statistics."""
        seen = self.probes @ features.blocks.T
        climb = np.tile(features.climb**2, (len(DECAYS), 1))
        return np.concatenate([(seen**2).sum(axis=-1), climb], axis=1)

    def statistics(
        self, planes: Array, heave: Array, mean: Array, age: Array, xp: Any = np
    ) -> Array:
        """Return what the network reads (..., S); see `schedule`."""
        glance = xp.sqrt(((planes @ self.glances.T) ** 2).sum(-2) + LEAST)
        logarithm = xp.log(mean + LEAST).reshape(*planes.shape[:-2], -1)
        return xp.concatenate([logarithm, glance, heave, age], -1)

    def schedule(self, planes: Array, heave: Array, mean: Array, age: Array, xp: Any = np) -> tuple:
        """Return z (..., K) but for the last velocity, and theta (..., PARAMETERS).

        Args:
            planes, heave: of `Features`.
            mean: (..., 2, P + 2) decaying means of `energies`.
            age: (..., 1) samples of the flight over `NEW`, at most 1.
            xp: numpy, or torch where all arrays are tensors.
        """
        batch = planes.shape[:-2]
        J = len(self.experts)
        value = self.network(self.statistics(planes, heave, mean, age, xp))
        gates = xp.exp(value[..., :J].clip(-MOST, MOST))
        gates = gates / gates.sum(-1)[..., None]
        mixed = (gates @ self.experts.reshape(J, -1)).reshape(*batch, PLANE, -1)
        lifts = (gates @ self.lifts.reshape(J, -1)).reshape(*batch, DECAYING, -1)
        states = (planes @ mixed.swapaxes(-1, -2)).reshape(*batch, -1)
        up = (lifts @ heave[..., None])[..., 0]
        level = planes @ self.level
        return xp.concatenate([states, up, level], -1), value[..., J:]

    def matrices(self, theta: Array, xp: Any = np) -> tuple:
        """Return A (..., K, K), B (..., K, 6) and C (..., 6, K) of theta, without units.

        Args:
            xp: as of `schedule`.
        """
        rates = xp.exp(theta[..., :RATES].clip(LOWEST, HIGHEST))
        batch = theta.shape[:-1]
        A, B, C = (xp.zeros((*batch, *size)) for size in ((K, K), (K, 6), (6, K)))
        size = xp.exp(-rates[..., OSCILLATORS : 2 * OSCILLATORS])
        cos, sin = (size * of(rates[..., :OSCILLATORS]) for of in (xp.cos, xp.sin))
        decays = xp.exp(-rates[..., 2 * OSCILLATORS :])
        for axis, (row, sign) in enumerate(((4, 1.0), (3, -1.0))):
            states = slice(axis * PLANE, (axis + 1) * PLANE)
            a = states.start + np.arange(OSCILLATORS)
            A[..., a, a] = A[..., a + OSCILLATORS, a + OSCILLATORS] = cos
            A[..., a, a + OSCILLATORS] = sin
            A[..., a + OSCILLATORS, a] = -sin
            q = states.start + np.arange(2 * OSCILLATORS, PLANE)
            A[..., q, q] = decays[..., :DECAYING]
            B[..., states, axis] = theta[..., RATES : RATES + PLANE]
            C[..., axis, a] = C[..., axis, q] = 1.0
            C[..., row, states] = sign * self.torque
            C[..., row, LEVEL + axis] = sign
            C[..., axis, VELOCITY + axis] = theta[..., -2]
        up = np.arange(2 * PLANE, LEVEL)
        level = [LEVEL, LEVEL + 1]
        last = np.arange(3)
        A[..., up, up] = decays[..., DECAYING:]
        B[..., up, 2] = theta[..., RATES + PLANE : -2]
        C[..., 2, up] = 1.0
        C[..., 2, VELOCITY + 2] = theta[..., -1]
        A[..., level, level] = B[..., VELOCITY + last, last] = 1.0
        return A, B, C

    def system(self, theta: np.ndarray) -> LiftedLinearSystem:
        """Return the lifted linear system of theta (PARAMETERS,)."""
        A, B, C = self.matrices(theta)
        return LiftedLinearSystem(A, B / self.scale[6:], C * self.scale[:6, None], self.step)

    def content(self) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Return the arrays and the header of its file."""
        arrays = {k: value for k, value in vars(self).items() if isinstance(value, np.ndarray)}
        header = {"step": self.step, "summary": self.summary}
        return self.network.tensors() | arrays, header

    @classmethod
    def of_content(cls, tensors: dict[str, Any], header: dict[str, Any]) -> "LpvModel":
        """Return the model of the content of a file."""
        network = Perceptron.taken_from(tensors)
        step = number_in(header, "step", *STEPS)
        return cls(step, **tensors, network=network, summary=summary_in(header))
