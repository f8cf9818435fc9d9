"""Tether length from a flight: the payload's mode among the eigenvalues of A_c.

Hung from a hook that moves with v, the force of a payload on its tether is f = -m (g / l) s / (s² +
g / l) v for small swings: with v as the only input the pair of poles is that of the *driven*
pendulum, w² = g / l, whatever holds the hook. With the body rates as a second input it is not: m_q
dv/dt = thrust x tilt + f makes v and omega determine each other, and the fit may put the poles
anywhere between g / l and g / l (1 + m / m_q).
"""

import dataclasses as dc

import numpy as np

from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem, Mode
from np_drake.lifting.training.excitation import motion_near
from np_drake.lifting.training.family_training import LiftedConfig
from np_drake.lifting.training.train import train
from np_drake.training_data.segments import Segment

GRAVITY = 9.81  # default [m/s²]
SPAN = 2.4  # of the prediction loss: over a period of any tether below 1.4 m [s]
LONGEST_DELAY = 1.2  # of the encoder [s]
STARTS = (
    0.05,
    0.1,
)  # of the mode; the better end counts, as gradient descent stays near its start [rad/sample]
LARGEST_DAMPING = 0.4  # beyond, a pair of poles is no resonance; own choice [1]
NEEDED = 15.0  # motion near the mode over its noise, below which no length is given; own choice [1]


@dc.dataclass(frozen=True)
class Pendulum:
    """Pendulum identified from a flight.

    motion: horizontal motion near the mode, without the flight's strongest line, over its noise
    [1].
    """

    length: float  # of the tether, hook to payload; NaN where the flight does not show it [m]
    mode: Mode | None  # of A_c, if any
    motion: float
    text: str  # one line for people
    system: LiftedLinearSystem  # that was read

    @property
    def shown(self) -> bool:
        """Whether the flight shows the pendulum."""
        return bool(np.isfinite(self.length))


def pendulum_length(
    segments: list[Segment], *, gravity: float = GRAVITY, seed: int = 0
) -> Pendulum:
    """Train chi on v alone, read the pendulum's mode, and check whether the flight excites it.

    Args:
        segments: force and velocity in W (labels as in training), at one step.
        gravity: [m/s²].
    Raises: ValueError: if the segments are unusable or too short.
    """
    driven = [_driven_by_velocity(s) for s in segments]
    step = segments[0].step if segments else 1.0
    delay, horizon = (max(2, round(span / step)) for span in (LONGEST_DELAY, SPAN))
    results = [
        train(
            driven,
            LiftedConfig(delay, horizon, size=0, lateral=(start,), vertical=(start,), seed=seed),
        )
        for start in STARTS
    ]
    trained = min(results, key=lambda result: result.loss[-1]).model.system
    # Training saw no body rates
    system = dc.replace(trained, B=trained.B * [1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    mode = pendulum_mode(system)
    if mode is None:
        return Pendulum(
            np.nan, None, 0.0, "no oscillating mode answers the horizontal velocity.", system
        )
    motion = motion_near([s.zeta[:, :2] for s in segments], mode.frequency, step=step)
    found = f"mode at {mode.frequency:.3f} Hz, damping {mode.damping:.2f}"
    if motion < NEEDED:
        reason = (
            f"the flight cannot show the pendulum: near the {found}, it moved {motion:.1f} "
            f"x its noise beside its "
            f"strongest line, {NEEDED:.0f} are needed. Fly with dither."
        )
        return Pendulum(np.nan, mode, motion, reason, system)
    if mode.damping > LARGEST_DAMPING:
        return Pendulum(np.nan, mode, motion, f"the {found}, is no resonance: no pendulum.", system)
    length = gravity / (2 * np.pi * mode.frequency) ** 2
    text = f"tether of {length:.3f} m: {found}, excited {motion:.0f} x its noise."
    return Pendulum(float(length), mode, motion, text, system)


def pendulum_mode(system: LiftedLinearSystem) -> Mode | None:
    """Return the oscillating mode of A_c through which v_x moves f_x most (largest residue), None
    without any.

    Its frequency, not its |s|, is the pendulum's: the training limits how long a mode may last.
    Raises: ValueError: if the body rates drive the system too, see the module.
    """
    if np.any(system.B[:, 3:]):
        raise ValueError(
            "pendulum: the system must be driven by velocity alone; with body rates its "
            "poles are not the payload's."
        )
    eigenvalue, V = np.linalg.eig(system.A)
    output, drive = (
        system.C[0] @ V,
        np.linalg.lstsq(V, system.B[:, 0].astype(complex), rcond=None)[0],
    )
    residue = np.where(eigenvalue.imag > 1e-9, np.abs(output * drive), 0.0)
    if not residue.max(initial=0.0) > 0.0:
        return None
    frequency = np.angle(eigenvalue[np.argmax(residue)]) / (2 * np.pi * system.step)
    return min(system.modes(), key=lambda mode: abs(mode.frequency - frequency))


def _driven_by_velocity(segment: Segment) -> Segment:
    zeta = np.asarray(segment.zeta, float).copy()
    zeta[:, 3:] = 0.0
    return dc.replace(segment, zeta=zeta)
