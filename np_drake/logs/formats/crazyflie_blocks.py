"""Crazyflie micro-SD logs of early firmware: one table in blocks, each with a checksum.

Little-endian, as the firmware wrote them before 2019:
    count
    uint8, number of variables, and for each of them its name as text `name(type)`, ended by a comma
    checksum
    uint32 blocks
    uint8 number of records, these (variables, packed), uint32 checksum
The checksums are of a kind that is not documented; a damaged block shows by its times.
The first variable is the time since the start [us]. `stateEstimateZ.quat` holds a quaternion in 32
bits.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import Contents, Progress, Recording, Stream

STREAM = "log"
TICK = "tick"  # name of the time
MICROSECOND = 1e-6  # [s]
TYPES = {letter: f"<{letter}" for letter in "hHiIqQefd"} | {
    "l": "<i4",
    "L": "<u4",
    "b": "i1",
    "B": "u1",
}
QUATERNION = "stateEstimateZ.quat"
PARTS = tuple(f"stateEstimateZ.q{axis}" for axis in "xyzw")
LONGEST_PAUSE = 60.0  # between two records of a log that is whole [s]; own choice
REMEDY = "copy it again from the card"


def recognises(start: bytes) -> bool:
    """Return whether the first bytes of a file are the names of such a log."""
    return start[1:].startswith(f"{TICK}(I),".encode())


def contents(content: bytes, path: Path) -> Contents:
    """Return the variables of a log."""
    names = [name for name, _ in _variables(content, path)[0][1:]]
    return {STREAM: (*names, *(PARTS if QUATERNION in names else ()))}


def read(
    content: bytes, path: Path, wanted: Mapping[str, list[str]], progress: Progress
) -> Recording:
    """Return the wanted variables of the only stream.

    Args:
        progress: called with the share that is read [1].
    Raises: LogError: if the header is damaged, a variable is not there, or no block is whole.
    """
    variables, begin = _variables(content, path)
    known = contents(content, path)[STREAM]
    for name in wanted.get(STREAM, ()):
        if name not in known:
            raise LogError(f"{path}: must hold the variable {name}; it does not.")
    record = np.dtype([(str(i), kind) for i, (_, kind) in enumerate(variables)])
    places = {name: str(i) for i, (name, _) in enumerate(variables)}
    pieces, notes = _blocks(content, begin, record.itemsize)
    rows = np.frombuffer(b"".join(pieces), record)
    if not len(rows):
        raise LogError(f"{path}: must hold at least one whole block after its header; {REMEDY}.")
    # The counter of microseconds has 32 bits and begins anew after 71 minutes.
    ticks = rows["0"].astype(np.uint32)
    steps = MICROSECOND * np.diff(ticks, prepend=ticks[:1]).astype(float)
    if len(odd := np.flatnonzero(steps > LONGEST_PAUSE)):
        rows, steps = rows[: odd[0]], steps[: odd[0]]
        notes += (f"row {odd[0] + 1}: the time is damaged; what follows is left out.",)
    t = MICROSECOND * float(ticks[0]) + np.cumsum(steps)
    q = _quaternions(rows[places[QUATERNION]]) if QUATERNION in places else {}
    with np.errstate(invalid="ignore"):  # the bits of a damaged float may be a signalling NaN
        columns = {
            n: q[n] if n in q else rows[places[n]].astype(float) for n in wanted.get(STREAM, ())
        }
    progress(1.0)
    facts = {"log version": "0, in blocks", "clock": "time since the start of the firmware [s]"}
    return Recording(str(path), {STREAM: Stream(t, columns)}, facts, notes)


def _variables(content: bytes, path: Path) -> tuple[list[tuple[str, str]], int]:
    """Return name and NumPy type of every variable, and where the first block begins."""
    found, offset = [], 1
    for _ in range(content[0]):
        end = content.find(b",", offset)
        text = content[offset:end].decode("ascii", "replace")
        if end < 0 or text[-3:-2] != "(" or text[-2:-1] not in TYPES or text[-1:] != ")":
            raise LogError(
                f"{path}, header: must name its variables like 'gyro.x(f)'; got "
                f"{text[:60]!r}; {REMEDY}."
            )
        found.append((text[:-3], TYPES[text[-2]]))
        offset = end + 1
    return found, offset + 4


def _blocks(content: bytes, offset: int, size: int) -> tuple[list[bytes], tuple[str, ...]]:
    """Return the records of all whole blocks, and a line where the log is cut or damaged."""
    pieces: list[bytes] = []
    while offset < len(content):
        end = offset + 1 + content[offset] * size
        if end + 4 > len(content):
            return pieces, (
                (
                    f"the log is cut; {len(content) - offset} bytes after its last whole block "
                    f"are left out."
                ),
            )
        pieces.append(content[offset + 1 : end])
        offset = end + 4
    return pieces, ()


def _quaternions(packed: np.ndarray) -> dict[str, np.ndarray]:
    """Return the components x, y, z, w (n,) of quaternions in 32 bits, by name.

    Two bits tell the largest component, which is positive; of the others each has a sign and nine
    bits of size over the square root of one half.
    """
    packed = packed.astype(np.uint32)
    largest = packed >> 30
    q = np.zeros((len(packed), 4))
    shift = np.zeros(len(packed), np.uint32)
    for i in (3, 2, 1, 0):
        small = largest != i
        part = packed >> shift
        size = (part & 0x1FF) / 0x1FF * np.sqrt(0.5)
        q[:, i] = np.where(small, np.where(part >> 9 & 1, -size, size), 0.0)
        shift = shift + np.where(small, 10, 0).astype(np.uint32)
    rest = np.sqrt(np.maximum(1 - np.sum(q**2, axis=1), 0.0))
    q[np.arange(len(q)), largest] = rest
    return dict(zip(PARTS, q.T, strict=True))
