"""Wrench labels: eq. (1) inverted from measured motion, and a causal low-pass.

Raw label = rigid_body.residual_wrench(q, w, a, al, command); chi = low-pass(raw label), force and
torque with a bandwidth each. Where the vehicle file has a `rotor_time_constant`, the command goes
through that lag first, on rotor speed. A row with NaN gets a NaN label and leaves the memory as it
was, so that the next good row continues from it.
"""

import dataclasses as dc
from collections.abc import Callable
from typing import Protocol, runtime_checkable

import numpy as np
import scipy

from np_drake import rigid_body
from np_drake.checks import require
from np_drake.compiled import compiled, finite
from np_drake.flight_log import FlightLog
from np_drake.residual_model import Memory
from np_drake.rotor_input import (
    acting_command,
    rotor_decay,
    rotor_speed,
    rotor_wrench,
    with_rotor_lag,
)
from np_drake.vehicle import Vehicle
from np_drake.vehicle.scaling import ratios

# within chi
FORCE = slice(0, 3)
TORQUE = slice(3, 6)


@dc.dataclass
class LabelConfig:
    """Causal low-pass on the raw labels.

    Source: own choice, the bandwidths with the best tracking; motor lag corrupts torque labels
    above 2 Hz, so that their bandwidth is lower.
    """

    force_bandwidth: float = 4.0  # −3 dB, of the force label; infinite: none [Hz]
    torque_bandwidth: float = 1.0  # −3 dB, of the torque label; infinite: none [Hz]
    order: int = 1  # of the Butterworth filter, 1 to 4

    def check(self) -> "LabelConfig":
        """Return self after checking bandwidths and order.

        Raises: ValueError: where one is impossible.
        """
        for name in ("force_bandwidth", "torque_bandwidth"):
            require(
                getattr(self, name) > 0,
                f"LabelConfig: {name} must be positive [Hz]; got {getattr(self, name)}.",
            )
        require(self.order in (1, 2, 3, 4), f"LabelConfig: order must be 1 … 4; got {self.order}.")
        return self

    def filters(self, step: float) -> list[tuple[slice, np.ndarray]]:
        """Return (channels, second-order sections) of force and torque at a sampling interval
        [s].
        """
        bands = ((FORCE, self.force_bandwidth), (TORQUE, self.torque_bandwidth))
        return [(channels, self._sections(bandwidth, step)) for channels, bandwidth in bands]

    def _sections(self, bandwidth: float, step: float) -> np.ndarray:
        if np.isinf(bandwidth):
            return np.tile([1.0, 0.0, 0.0, 1.0, 0.0, 0.0], ((self.order + 1) // 2, 1))
        nyquist = 0.5 / step
        require(
            bandwidth < nyquist,
            f"LabelConfig: bandwidth must lie below half the sampling rate, {nyquist:.3g} Hz; "
            f"got {bandwidth:.3g} Hz.",
        )
        return scipy.signal.butter(self.order, bandwidth / nyquist, output="sos")


RAW = LabelConfig(np.inf, np.inf)  # for what filters by itself and wants white noise


@runtime_checkable
class ReadsLabels(Protocol):
    """A residual model that needs labels of its own low-pass."""

    label: LabelConfig


def default_labels(vehicle: Vehicle) -> LabelConfig:
    """Return the low-pass for `vehicle`: that of the paper's at the pace of its own sampling
    (`Scales.clock`).
    """
    pace = ratios(vehicle).clock
    paper = LabelConfig()
    return LabelConfig(paper.force_bandwidth / pace, paper.torque_bandwidth / pace, paper.order)


def labelled(vehicle: Vehicle, model: object) -> Vehicle:
    """Return the vehicle that the labels for `model` assume, with the `rotor_lag` of the model's
    training where it has one [s].

    A lag named in the vehicle's file takes precedence.
    """
    return with_rotor_lag(vehicle, getattr(model, "rotor_lag", 0.0))


class LabelFilter:
    """Streaming form of the labels: one sample at a time, all memory in the caller's dictionary.

    Args:
        step: time between samples [s].
    """

    def __init__(self, vehicle: Vehicle, config: LabelConfig | None = None, *, step: float) -> None:
        require(0 < step < np.inf, f"LabelFilter: step must be positive [s]; got {step}.")
        self._vehicle = vehicle
        self._filters = (config or default_labels(vehicle)).check().filters(step)
        self._sections = len(self._filters[0][1])
        self._decay = rotor_decay(vehicle, step)

    def initial_memory(self) -> Memory:
        """Return the memory before any sample.

        started: (1,) 0 or 1.   rotor: (4,) lagged rotor speed [rad/s], NaN before the first sample.
        state: (sections, 2, 6) of the filters.
        """
        return {
            "started": np.zeros(1),
            "rotor": np.full(4, np.nan),
            "state": np.zeros((self._sections, 2, 6)),
        }

    def step(
        self, memory: Memory, *, x: np.ndarray, a: np.ndarray, al: np.ndarray, u: np.ndarray
    ) -> tuple[Memory, np.ndarray]:
        """Return the memory after one sample, and the label of that sample.

        Args:
            x: (13,) state.
            a: (3,) dv/dt in W, without gravity [m/s²].
            al: (3,) dw/dt in B [rad/s²].
            u: (4,) command that a and al show the effect of: online, the one that acted up to now
                [N, N·m].
        Returns:
            The memory after this sample, and chi (6,) [N, N·m], NaN where an entry of the sample
            is.
        """
        rotor, u = self._lagged(memory["rotor"], np.asarray(u, float))
        raw = rigid_body.residual_wrench(
            self._vehicle, q=x[rigid_body.Q], w=x[rigid_body.W], a=a, al=al, u=u
        )
        if not finite(raw):
            return {**memory, "rotor": rotor}, np.full(6, np.nan)
        state = memory["state"].copy()
        chi = np.empty(6)
        for channels, sos in self._filters:
            if not memory["started"][0]:
                state[:, :, channels] = scipy.signal.sosfilt_zi(sos)[:, :, None] * raw[channels]
            _filter_once(sos, raw[channels], state[:, :, channels], chi[channels])
        return {"started": np.ones(1), "rotor": rotor, "state": state}, chi

    def _lagged(self, rotor: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return rotor speed and wrench after `u` acted for one step; a NaN command leaves the
        speed.
        """
        if self._decay == 0.0:
            return rotor, u
        if not finite(u):
            return rotor, np.full(4, np.nan)
        target = rotor_speed(self._vehicle, u)
        rotor = target if np.isnan(rotor[0]) else target + self._decay * (rotor - target)
        return rotor, rotor_wrench(self._vehicle, rotor)


@compiled
def _filter_once(sos, value, state, out):
    """Pass one sample value (c,) through second-order sections (s, 6), whose state (s, 2, c) moves
    on, to out (c,).

    The transposed direct form II, as of `scipy.signal.sosfilt`.
    """
    for c in range(len(value)):
        x = value[c]
        for s in range(len(sos)):
            y = sos[s, 0] * x + state[s, 0, c]
            state[s, 0, c] = sos[s, 1] * x - sos[s, 4] * y + state[s, 1, c]
            state[s, 1, c] = sos[s, 2] * x - sos[s, 5] * y
            x = y
        out[c] = x


def raw_labels(log: FlightLog, vehicle: Vehicle) -> np.ndarray:
    """Return unfiltered labels (n, 6), row k's command (through the lag) with row k's acceleration
    [N, N·m].
    Raises: ValueError: where the log has no acceleration (see
        `logs.accelerations.with_accelerations`).
    """
    if log.a is None or log.al is None:
        raise ValueError(
            f"labels: {log.name} must have acceleration columns; differentiate the log first."
        )
    u = acting_command(log, vehicle)
    return rigid_body.residual_wrench(vehicle, q=log.q, w=log.w, a=log.a, al=log.al, u=u)


def labels(log: FlightLog, vehicle: Vehicle, config: LabelConfig | None = None) -> np.ndarray:
    """Return causal low-passed labels chi (n, 6) [N, N·m].

    A row with NaN gets NaN, and the filter continues after it.
    """

    def forward(sos: np.ndarray, raw: np.ndarray, good: np.ndarray) -> np.ndarray:
        start = scipy.signal.sosfilt_zi(sos)[:, :, None] * raw[good][0]  # at rest at the first row
        return scipy.signal.sosfilt(sos, raw[good], axis=0, zi=start)[0]

    return _filtered(log, vehicle, config, forward)


def smooth_labels(
    log: FlightLog, vehicle: Vehicle, config: LabelConfig | None = None
) -> np.ndarray:
    """Return zero-phase labels (n, 6), as targets for training and truth for plots, never for a
    controller [N, N·m].

    The low-pass runs forward and backward (-6 dB at the bandwidth). NaN rows are bridged by a line,
    and stay NaN.
    """

    def both_ways(sos: np.ndarray, raw: np.ndarray, good: np.ndarray) -> np.ndarray:
        bridged = np.stack(
            [np.interp(log.t, log.t[good], column[good]) for column in raw.T], axis=1
        )
        padding = min(len(bridged) - 1, 3 * (2 * len(sos) + 1))
        return scipy.signal.sosfiltfilt(sos, bridged, axis=0, padlen=padding)[good]

    return _filtered(log, vehicle, config, both_ways)


def _filtered(
    log: FlightLog, vehicle: Vehicle, config: LabelConfig | None, run: Callable
) -> np.ndarray:
    """Return labels (n, 6) that `run` takes from sections, raw labels of a group of channels and
    their good rows.
    """
    raw = raw_labels(log, vehicle)
    good = np.all(np.isfinite(raw), axis=1)
    chi = np.full_like(raw, np.nan)
    filters = (config or default_labels(vehicle)).check().filters(log.step) if good.any() else ()
    for channels, sos in filters:
        chi[good, channels] = run(sos, raw[:, channels], good)
    return chi
