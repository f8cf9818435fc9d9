"""Writes blackbox logs of data version 2 with any encoding and predictor, as Betaflight documents
them.
"""

import dataclasses as dc
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

PRODUCT = "Blackbox flight data recorder by Nicholas Sherlock"
SETTINGS = {
    "Firmware type": "Cleanflight",
    "Firmware revision": "Betaflight 4.5.1 (77d01ba3b) STM32F405",
    "Craft name": "made",
    "minthrottle": "1070",
    "vbatref": "1660",
    "motorOutput": "158,2047",
    "gyro_scale": "0x3f800000",
    "acc_1G": "2048",
    "motor_poles": "14",
    "looptime": "125",
    "pid_process_denom": "2",
    "motor_pwm_protocol": "7",
}
END = b"E\xffEnd of log\0"
SVB, UVB, NEG14, TAG8, TAG2, TAG4, NULL, TAG2V = 0, 1, 3, 6, 7, 8, 9, 10


@dc.dataclass(frozen=True)
class Field:
    """A field: sign, and predictor and encoding of I and of P frames."""

    name: str
    signed: int = 1
    i: tuple[int, int] = (0, SVB)
    p: tuple[int, int] = (1, SVB)


ITERATION = Field("loopIteration", 0, (0, UVB), (6, NULL))
TIME = Field("time", 0, (0, UVB), (2, SVB))
SLOW = (Field("flags", 0, (0, UVB)), *(Field(name, 0, (0, TAG2)) for name in ("a", "b", "c")))
GPS = (
    Field("time", 0, (10, UVB)),
    Field("GPS_numSat", 0, (0, UVB)),
    *(Field(f"GPS_coord[{i}]", 1, (7, SVB)) for i in (0, 1)),
)
HOME = tuple(Field(f"GPS_home[{i}]") for i in (0, 1))


@dc.dataclass
class Log:
    """One log. rows: (n, fields) integers of the main frames, in which loops that are not logged
    are no rows.

    beside: by row, the frames and events that are written behind it: a letter and its values, or
    bytes.
    """

    fields: Sequence[Field]
    rows: np.ndarray
    interval: int = 8
    settings: Mapping[str, str] = dc.field(default_factory=dict)
    beside: Mapping[int, Sequence[tuple[str, Sequence[int]] | bytes]] = dc.field(
        default_factory=dict
    )
    every: str = "1"
    kinds: Mapping[str, Sequence[Field]] = dc.field(
        default_factory=lambda: {"S": SLOW, "H": HOME, "G": GPS}
    )
    end: bytes = END

    def encode(self) -> bytes:
        """Return its bytes."""
        return self.header() + b"".join(self.frames()) + self.end

    def header(self) -> bytes:
        """Return the lines before the first frame."""
        lines = {"Product": PRODUCT, "Data version": "2"}
        for letter, fields in {"I": self.fields, **self.kinds}.items():
            lines |= {f"Field {letter} name": ",".join(f.name for f in fields)}
            lines |= {f"Field {letter} signed": ",".join(str(f.signed) for f in fields)}
            lines |= {f"Field {letter} predictor": ",".join(str(f.i[0]) for f in fields)}
            lines |= {f"Field {letter} encoding": ",".join(str(f.i[1]) for f in fields)}
        lines |= {"Field P predictor": ",".join(str(f.p[0]) for f in self.fields)}
        lines |= {"Field P encoding": ",".join(str(f.p[1]) for f in self.fields)}
        lines |= {
            "I interval": str(self.interval),
            "P interval": self.every,
            **SETTINGS,
            **self.settings,
        }
        return "".join(f"H {name}:{value}\n" for name, value in lines.items()).encode()

    def frames(self) -> list[bytes]:
        """Return the bytes of every row, with what is beside it."""
        out = []
        home = [0, 0]
        history: list[np.ndarray] = []
        for number, row in enumerate(self.rows):
            key = not history or row[0] % self.interval == 0
            residuals = self._residuals(self.fields, row, "i" if key else "p", history, home)
            history = [row, row] if key else [row, history[0]]
            out.append(
                (b"I" if key else b"P")
                + encoded(residuals, [(f.i if key else f.p)[1] for f in self.fields])
            )
            for extra in self.beside.get(number, ()):
                if isinstance(extra, bytes):
                    out[-1] += extra
                    continue
                letter, values = extra
                fields = self.kinds[letter]
                left = self._residuals(fields, values, "i", history, home)
                home = list(values) if letter == "H" else home
                out[-1] += letter.encode() + encoded(left, [f.i[1] for f in fields])
        return out

    def _residuals(self, fields, row, kind, history, home) -> list[int]:
        """Return what is written of a frame: values less their predictions."""
        settings = {**SETTINGS, **self.settings}
        names = [f.name for f in fields]
        out = []
        for i, field in enumerate(fields):
            predictor = getattr(field, kind)[0]
            one, two = (int(history[0][i]), int(history[1][i])) if kind == "p" else (0, 0)
            guess = {
                0: 0,
                1: one,
                2: 2 * one - two,
                3: int((one + two) / 2),
                4: int(settings["minthrottle"]),
                5: int(row[names.index("motor[0]")]) if "motor[0]" in names else 0,
                6: int(row[i]),
                7: home[int(field.name.endswith("[1]"))],
                8: 1500,
                9: int(settings["vbatref"]),
                10: int(history[0][1]) if history else 0,
                11: int(settings["motorOutput"].split(",")[0]),
            }[predictor]
            out.append((int(row[i]) - guess + (1 << 31)) % (1 << 32) - (1 << 31))
        return out


def write(path: Path, *logs: Log) -> None:
    """Write logs into one file."""
    path.write_bytes(b"".join(log.encode() for log in logs))


def unsigned(value: int) -> bytes:
    """Return a number of 32 bits, 7 in a byte."""
    value &= 0xFFFFFFFF
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    return bytes([*out, value])


def signed(value: int) -> bytes:
    """Return a number whose sign is its lowest bit."""
    return unsigned((value << 1) ^ (value >> 31))


def encoded(values: Sequence[int], encodings: Sequence[int]) -> bytes:
    """Return the bytes of the fields of one frame."""
    out, i = b"", 0
    while i < len(values):
        kind = encodings[i]
        count = {TAG2: 3, TAG2V: 3, TAG4: 4}.get(kind, 1)
        if kind == TAG8:
            while count < 8 and i + count < len(values) and encodings[i + count] == TAG8:
                count += 1
        part = list(values[i : i + count])
        if kind == SVB:
            out += signed(part[0])
        elif kind == UVB:
            out += unsigned(part[0])
        elif kind == NEG14:
            out += unsigned(-part[0] & 0x3FFF)
        elif kind == NULL:
            assert part == [0]
        elif kind == TAG8:
            tags = bytes([sum(bool(v) << k for k, v in enumerate(part))]) if count > 1 else b""
            out += tags + b"".join(signed(v) for v in part if v or count == 1)
        else:
            out += {TAG2: three, TAG2V: three_variable, TAG4: four}[kind](part)
        i += count
    return out


def bits(*parts: tuple[int, int]) -> bytes:
    """Return numbers side by side, the highest bit first: pairs of value and number of bits."""
    text = "".join(format(value & ((1 << count) - 1), f"0{count}b") for value, count in parts)
    text += "0" * (-len(text) % 8)
    return int(text, 2).to_bytes(len(text) // 8, "big")


def fits(values: Sequence[int], *sizes: int) -> bool:
    """Return whether signed numbers fit into these numbers of bits."""
    return all(-(1 << s - 1) <= v < 1 << s - 1 for v, s in zip(values, sizes, strict=True))


def three(v: Sequence[int]) -> bytes:
    """Return TAG2_3S32."""
    if fits(v, 2, 2, 2):
        return bits((0, 2), *((x, 2) for x in v))
    if fits(v, 4, 4, 4):
        return bits((1, 2), (0, 2), *((x, 4) for x in v))
    if fits(v, 6, 6, 6):
        return bits((2, 2), (v[0], 6), (0, 2), (v[1], 6), (0, 2), (v[2], 6))
    return _bytes_each(v)


def three_variable(v: Sequence[int]) -> bytes:
    """Return TAG2_3SVARIABLE."""
    if fits(v, 2, 2, 2):
        return bits((0, 2), *((x, 2) for x in v))
    if fits(v, 5, 5, 4):
        return bits((1, 2), (v[0], 5), (v[1], 5), (v[2], 4))
    if fits(v, 8, 7, 7):
        return bits((2, 2), (v[0], 8), (v[1], 7), (v[2], 7))
    return _bytes_each(v)


def _bytes_each(v: Sequence[int]) -> bytes:
    sizes = [next(size for size in (1, 2, 3, 4) if fits([x], 8 * size)) for x in v]
    tags = sum((size - 1) << (2 * k) for k, size in enumerate(sizes))
    return bytes([0xC0 | tags]) + b"".join(
        x.to_bytes(s, "little", signed=True) for x, s in zip(v, sizes, strict=True)
    )


def four(v: Sequence[int]) -> bytes:
    """Return TAG8_4S16 of version 2."""
    sizes = [0 if not x else next(s for s in (4, 8, 16) if fits([x], s)) for x in v]
    tags = sum((0, 4, 8, 16).index(size) << (2 * k) for k, size in enumerate(sizes))
    packed = [(x, s) for x, s in zip(v, sizes, strict=True) if s]
    return bytes([tags]) + (bits(*packed) if packed else b"")


EVENTS = {  # one of every kind that is known
    "beep": b"E\x00" + unsigned(123456),
    "adjusted": b"E\x0d\x05" + signed(-300),
    "adjusted to a float": b"E\x0d\x85" + struct.pack("<f", 1.5),
    "disarmed": b"E\x0f" + unsigned(4),
    "mode": b"E\x1e" + unsigned(5) + unsigned(1 << 31),
    "IMU failed": b"E\x28" + unsigned(1),
}


def resumed(iteration: int, time: int) -> bytes:
    """Return the event after a pause of the recorder."""
    return b"E\x0e" + unsigned(iteration) + unsigned(time)


def main_log(
    values: Mapping[str, np.ndarray], *, step: int = 2000, begin: int = 1_000_000, **options
) -> Log:
    """Return a log of signed fields (n,), whose rows are `step` us apart."""
    count = len(next(iter(values.values())))
    rows = np.column_stack([np.arange(count), begin + step * np.arange(count), *values.values()])
    fields = [ITERATION, TIME, *(Field(name, 1, (0, SVB), (3, SVB)) for name in values)]
    return Log(fields, np.round(rows).astype(np.int64), interval=32, **options)
