"""Training input as plain arrays: the wrench of one flight, and its uninterrupted pieces."""

import dataclasses as dc

import numpy as np


@dc.dataclass
class WrenchSequence:
    """Wrench chi and motion zeta of one flight at a fixed step.

    step: time between rows [s].   chi: (n, 6) [force, torque] [N, N·m]; the torque is in body axes.
    zeta: (n, 6) [velocity, body rates] [m/s, rad/s].   frame: of force and velocity, "world" | "body".
    total: True where chi is the whole wrench (NeuroBEM arrays), False where it is the residual one.
    A row with NaN has no label.
    """  # noqa: E501

    step: float
    chi: np.ndarray
    zeta: np.ndarray
    frame: str = "world"
    name: str = "flight"  # for messages and tables
    total: bool = False
    notes: list[str] = dc.field(default_factory=list)  # what a reader derived or repaired

    def __len__(self) -> int:
        return len(self.chi)

    def check(self) -> "WrenchSequence":
        """Return self after checking shapes and names.

        Raises: ValueError: where they do not fit.
        """
        if self.frame not in ("world", "body"):
            raise ValueError(f"WrenchSequence: frame must be world or body; got {self.frame!r}.")
        if not 0 < self.step < np.inf:
            raise ValueError(f"WrenchSequence: step must be positive [s]; got {self.step}.")
        if (
            np.ndim(self.chi) != 2
            or np.shape(self.chi)[1] != 6
            or np.shape(self.zeta) != np.shape(self.chi)
        ):
            raise ValueError(
                f"WrenchSequence: chi and zeta must be (n, 6); got {np.shape(self.chi)}, "
                f"{np.shape(self.zeta)}."
            )
        return self


@dc.dataclass(frozen=True)
class Segment:
    """One uninterrupted piece of flight, a sample every `step` seconds.

    chi: (n, 6) labels as the encoder will see them in flight [N, N·m].   zeta: (n, 6) [m/s, rad/s].
    target: (n, 6) what is to be predicted, where that is better known afterwards (a zero-phase
        smoothed
    label): the lifted linear system then learns to undo delay and noise of the label. Default: chi.
    late: samples by which the labels of force lag behind the wrench.
    """

    chi: np.ndarray
    zeta: np.ndarray
    step: float
    target: np.ndarray | None = None
    late: int = 0

    def __len__(self) -> int:
        return len(self.chi)

    @property
    def goal(self) -> np.ndarray:
        """Target (n, 6) where there is one, else chi [N, N·m]."""
        return self.chi if self.target is None else self.target

    @property
    def in_time(self) -> "Segment":
        """Samples with each label beside the motion and the target of its own time."""
        n = len(self) - self.late
        return Segment(self.chi[self.late :], self.zeta[:n], self.step, self.goal[:n])


def check_segments(segments: list[Segment], shortest: int) -> list[Segment]:
    """Return the segments of at least `shortest` samples, as float64.
    Raises: ValueError: if a shape or value is wrong, steps differ by over 2 %, or none is long
        enough.
    """
    if not segments:
        raise ValueError("Segment: there must be at least one training segment; got none.")
    checked = [_checked(segment, number) for number, segment in enumerate(segments)]
    steps = np.array([segment.step for segment in checked])
    if np.ptp(steps) > 0.02 * steps.min():
        raise ValueError(
            f"Segment: all segments must share one step [s]; got {steps.min()} to {steps.max()}."
        )
    long = [segment for segment in checked if len(segment) >= shortest]
    if not long:
        longest = max(map(len, checked))
        raise ValueError(
            f"Segment: at least {shortest} samples in one piece are needed; got {longest}."
        )
    return long


def _checked(segment: Segment, number: int) -> Segment:
    arrays = {"chi": segment.chi, "zeta": segment.zeta, "target": segment.goal}
    for name, value in arrays.items():
        arrays[name] = value = np.asarray(value, float)
        if value.ndim != 2 or value.shape != (len(segment.chi), 6):
            raise ValueError(
                f"Segment {number}: {name} must be (n, 6), one n for all; got {value.shape}."
            )
        if not np.all(np.isfinite(value)):
            row = int(np.argmin(np.all(np.isfinite(value), axis=1)))
            raise ValueError(
                f"Segment {number}: {name} must be finite; row {row} is not. Cut the log there."
            )
    if not segment.step > 0:
        raise ValueError(f"Segment {number}: step must be positive [s]; got {segment.step}.")
    return Segment(
        arrays["chi"], arrays["zeta"], float(segment.step), arrays["target"], segment.late
    )


def group_scale(values: list[np.ndarray], *, centred: bool) -> np.ndarray:
    """Return one scale for channels 0:3 and one for 3:6, as (6,): RMS over all samples of a group.

    One scale a group keeps lengths and angles as they are; scaling every channel to unit size would
    turn the noise of an unexcited channel into signal.

    Args:
        values: pieces (n, 6).
    """
    stacked = np.concatenate(values)
    if centred:
        stacked = stacked - stacked.mean(axis=0)
    power = np.mean(stacked**2, axis=0)
    scale = np.sqrt(np.repeat([power[:3].mean(), power[3:].mean()], 3))
    return np.where(scale > 1e-12, scale, 1.0)


def white_noise(values: list[np.ndarray]) -> np.ndarray:
    """Return the standard deviation of white noise in values (n, c), (c,), from fourth differences.

    A fourth difference multiplies white noise by sqrt(70) and all but removes motion slower than a
    tenth of the sampling rate. The median is taken, so that a few jumps do not count.
    """
    difference = np.concatenate([np.diff(piece, n=4, axis=0) for piece in values])
    return np.median(np.abs(difference), axis=0) / (0.6745 * np.sqrt(70.0))
