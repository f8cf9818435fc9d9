"""Response of rotors to their commands: throttle curve, battery voltage, first-order lag up and
down, dead time.

Rotor speeds are relative to that of hover, so that a thrust needs no thrust coefficient:
f / f_hover = speed², with T d speed/dt = target(throttle) - speed and T another where the speed
falls.
Source: first-order ESC and motor; the curve is that of PX4's thrust model, u -> (1 - c) u² + c u,
    on a speed at which
idle motors turn.
"""

import dataclasses as dc

import numpy as np

from np_drake.compiled import compiled

# longest substep of a lag [s]; own choice: a tenth of the time constant of a small motor
FINEST = 2.5e-3


@dc.dataclass(frozen=True)
class Substeps:
    """Uniform fine grid of a flight, and the row whose command is held in each of its steps.

    t: (m,) starts of the steps, from the first row on [s].
    row: (m,) index of the row.
    step: [s].
    """

    t: np.ndarray
    row: np.ndarray
    step: float

    @classmethod
    def of(cls, t: np.ndarray) -> "Substeps":
        """Return the grid of rows at t (n,) [s]."""
        own = float(np.median(np.diff(t)))
        step = own / max(1, int(np.ceil(own / FINEST - 1e-9)))
        fine = np.arange(t[0], t[-1], step)
        return cls(fine, np.searchsorted(t, fine + 0.5 * step, side="right") - 1, step)


def target_speed(throttle: np.ndarray, linear: float, idle: float = 0.0) -> np.ndarray:
    """Return rotor speed over that at full throttle [1].

    Args:
        throttle: (..., 4) of 0 to 1 [1].
        linear: share of the curve's linear part [1].
        idle: rotor speed at no throttle, over the full one [1].
    """
    u, idle = np.clip(throttle, 0.0, None), max(idle, 0.0)
    return idle + (1.0 - idle) * np.sqrt(np.maximum((1.0 - linear) * u * u + linear * u, 0.0))


@compiled
def lagged(target: np.ndarray, row: np.ndarray, step: float, up: float, down: float) -> np.ndarray:
    """Return rotor speeds (m + 1, 4) at the edges of substeps, exact for a held target.

    Args:
        target: (n, 4) speeds that the rows command.
        row: (m,) row whose target is held in each substep.
        step: length of a substep [s].
        up: time constant of a rising speed [s].
        down: time constant of a falling speed [s].
    """
    rise = np.exp(-step / up) if up > 0.0 else 0.0
    fall = np.exp(-step / down) if down > 0.0 else 0.0
    out = np.empty((row.size + 1, target.shape[1]))
    out[0] = target[row[0]]
    for k in range(row.size):
        for i in range(target.shape[1]):
            wanted = target[row[k], i]
            share = rise if wanted > out[k, i] else fall
            out[k + 1, i] = wanted + (out[k, i] - wanted) * share
    return out


def means(t: np.ndarray, values: np.ndarray, starts: np.ndarray, stops: np.ndarray) -> np.ndarray:
    """Return the means (k, c) of piecewise linear values over spans.

    Args:
        t: (m,) times of the values, uniform [s].
        values: (m, c) values; constant before the first and after the last.
        starts: (k,) of the spans [s].
        stops: (k,) of the spans [s].
    """
    step = t[1] - t[0]
    total = np.zeros_like(values)
    np.cumsum(0.5 * step * (values[1:] + values[:-1]), axis=0, out=total[1:])

    def integral(instants: np.ndarray) -> np.ndarray:
        place = (instants - t[0]) / step
        inside = np.clip(place, 0.0, len(t) - 1)
        k = np.minimum(inside.astype(int), len(t) - 2)
        part = (inside - k)[:, None]
        # Of a line from the node before, and of the constant beyond the ends.
        own = total[k] + step * part * (values[k] + 0.5 * part * (values[k + 1] - values[k]))
        beyond = step * (place - inside)[:, None]
        return own + beyond * np.where(beyond < 0, values[:1], values[-1:])

    return (integral(stops) - integral(starts)) / (stops - starts)[:, None]


def at(t: np.ndarray, values: np.ndarray, instants: np.ndarray) -> np.ndarray:
    """Return piecewise linear values (k, c) at instants (k,) [s].

    Args:
        t: (m,) times of the values, uniform [s].
        values: (m, c) values.
        instants: (k,) times [s].
    """
    place = np.clip((instants - t[0]) / (t[1] - t[0]), 0.0, len(t) - 1)
    k = np.minimum(place.astype(int), len(t) - 2)
    return values[k] + (place - k)[:, None] * (values[k + 1] - values[k])
