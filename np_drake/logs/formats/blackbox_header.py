"""Header of a blackbox log: its settings, and the fields of its frames.

A file holds one log or several, each from its own header on. A header is lines `H name:value`;
those named `Field I name`, `Field P encoding` and so on tell the fields. Source: Betaflight,
"Blackbox logging internals".
"""

import dataclasses as dc
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from np_drake.logs.errors import LogError
from np_drake.logs.formats.blackbox_frames import (
    BATTERY,
    CONSTANTS,
    HOME,
    KINDS,
    MIN_MOTOR,
    MIN_THROTTLE,
    STICK_CENTRE,
)
from np_drake.logs.formats.blackbox_values import ENCODINGS

MARK = b"H Product:Blackbox flight data recorder"
STREAMS = {"main": "I", "slow": "S", "gps": "G"}  # by name, the frames whose fields they hold
MOST_FIELDS = 4096  # of a kind of frame, own choice: Indiflight has 200
MOST_LOOPS = 1 << 14  # between two frames, own choice: 2 s at 8 kHz; the firmware has 256
LONGEST_LINE = 1 << 16  # [bytes], own choice
FIELD = re.compile(r"Field ([A-Z]) (\w+)")
NUMBER = re.compile(r"[+-]?\d+(\.\d+)?")
REMEDY = "Copy it again from the vehicle"


@dc.dataclass(frozen=True)
class Session:
    """One log of a file.

    number: from 1.   settings: of its header, by name.   names: of the fields by kind of frame.
    first, stop: place of its first frame and behind its last byte.
    The others are arguments of `read_frames`.
    """

    number: int
    settings: Mapping[str, str]
    names: Mapping[str, tuple[str, ...]]
    first: int
    stop: int
    counts: np.ndarray
    encodings: np.ndarray
    predictors: np.ndarray
    signed: np.ndarray
    constants: np.ndarray
    places: np.ndarray
    intervals: np.ndarray

    def columns(self, stream: str) -> tuple[str, ...]:
        """Return the names of the columns of a stream."""
        return tuple(name for name in self.names.get(STREAMS[stream], ()) if name != "time")

    def numbers(self, name: str) -> list[float]:
        """Return the numbers of a setting; none where it holds another text, or is not there."""
        return as_numbers(self.settings.get(name, ""))


def as_numbers(text: str) -> list[float]:
    """Return the numbers of a setting; a float whose bits are written in hexadecimal is one,
    too.
    """
    found = []
    for part in text.split(","):
        if re.fullmatch(r"0x[0-9a-fA-F]{1,8}", part.strip()):
            found.append(float(np.uint32(int(part, 16)).view(np.float32)))
        elif NUMBER.fullmatch(part.strip()):
            found.append(float(part))
        else:
            return []
    return found if np.all(np.isfinite(found)) else []


def sessions(path: Path, content: bytes) -> tuple[list[Session], list[str]]:
    """Return the logs of a file, and what is wrong with the headers of others.
    Raises: LogError: if there is none, or none whose header is whole and of the version that is
        known.
    """
    starts = [match.start() for match in re.finditer(re.escape(MARK), content)]
    if not starts:
        raise LogError(
            f"{path}: must hold the header of a blackbox log ({MARK.decode()}); it has "
            f"none. {REMEDY}."
        )
    found, bad = [], []
    for number, (start, stop) in enumerate(
        zip(starts, [*starts[1:], len(content)], strict=True), start=1
    ):
        place = f"header of log {number}" if len(starts) > 1 else "header"
        try:
            settings, first = _settings(content, start, stop)
            found.append(_session(number, settings, first, stop))
        except ValueError as error:
            bad.append(f"{place}: {error}")
    if not found:
        raise LogError(f"{path}, {bad[0]}. {REMEDY}.")
    return found, bad


def _settings(content: bytes, start: int, stop: int) -> tuple[dict[str, str], int]:
    """Return the lines of a header by name, and the place behind it.

    Raises: ValueError: if a line is cut or damaged.
    """
    found: dict[str, str] = {}
    while content.startswith(b"H ", start, stop):
        end = content.find(b"\n", start, min(start + LONGEST_LINE, stop))
        line = content[start + 2 : end]
        if end < 0 or not line.isascii() or b":" not in line:
            last = next(reversed(found), "none")
            raise ValueError(
                f"lines must be `H name:value`; that behind {last!r} is cut or damaged"
            )
        name, _, value = line.decode("ascii").partition(":")
        found[name.strip()] = value.strip()
        start = end + 1
    return found, start


def _session(number: int, settings: Mapping[str, str], first: int, stop: int) -> Session:
    version = settings.get("Data version", "")
    if version != "2":
        raise ValueError(f"Data version must be 2; got {version!r}")
    told: dict[str, dict[str, list[str]]] = {kind: {} for kind in KINDS}
    for name, value in settings.items():
        match = FIELD.fullmatch(name)
        if match and match[1] in told:
            told[match[1]][match[2]] = value.split(",")
    told["P"] = {
        **{key: told["I"][key] for key in ("name", "signed") if key in told["I"]},
        **told["P"],
    }
    names = {
        kind: tuple(own["name"])
        for kind, own in told.items()
        if "predictor" in own and "name" in own
    }
    if not {"I", "P"} <= set(names):
        raise ValueError("must tell name, predictor and encoding of the fields of I and P frames")
    width = max(len(own) for own in names.values())
    if width > MOST_FIELDS:
        raise ValueError(f"a frame must have at most {MOST_FIELDS} fields; got {width}")
    tables = {
        key: np.zeros((len(KINDS), width), np.int64)
        for key in ("encoding", "predictor", "signed", "constant")
    }
    counts = np.array([len(names.get(kind, ())) for kind in KINDS])
    for row, kind in enumerate(KINDS):
        for key in ("encoding", "predictor", "signed") if counts[row] else ():
            tables[key][row, : counts[row]] = _column(
                kind, key, told[kind].get(key, []), counts[row]
            )
        for i, name in enumerate(names.get(kind, ())):
            tables["constant"][row, i] = _constant(tables["predictor"][row, i], name, settings)
    if "loopIteration" not in names["I"] or "time" not in names["I"]:
        raise ValueError("Field I name must have loopIteration and time")
    motor0 = names["I"].index("motor[0]") if "motor[0]" in names["I"] else 0
    gps_time = names["G"].index("time") if "time" in names.get("G", ()) else -1
    places = np.array(
        [names["I"].index("loopIteration"), names["I"].index("time"), motor0, gps_time]
    )
    return Session(
        number,
        settings,
        names,
        first,
        stop,
        counts,
        tables["encoding"],
        tables["predictor"],
        tables["signed"],
        tables["constant"],
        places,
        _intervals(settings),
    )


def _column(kind: str, key: str, texts: list[str], count: int) -> np.ndarray:
    """Return the numbers of one line on the fields of a kind of frame.

    Raises: ValueError: if they are not as many as the fields, or not known.
    """
    known = {"encoding": ENCODINGS, "predictor": tuple(range(CONSTANTS)), "signed": (0, 1)}[key]
    if len(texts) != count:
        raise ValueError(
            f"Field {kind} {key} must have {count} numbers, one for each name; got {len(texts)}"
        )
    values = [int(text) if text.isascii() and text.isdecimal() else -1 for text in texts]
    for text, value in zip(texts, values, strict=True):
        if value not in known:
            raise ValueError(
                f"Field {kind} {key} must be of {', '.join(map(str, known))}; got {text[:20]!r}"
            )
    return np.array(values)


def _constant(predictor: int, name: str, settings: Mapping[str, str]) -> int:
    """Return what a predictor adds that the header tells; of the home, its coordinate."""
    if predictor == HOME:
        return int(name.endswith("[1]"))
    if predictor == STICK_CENTRE:
        return 1500
    setting = {MIN_THROTTLE: "minthrottle", BATTERY: "vbatref", MIN_MOTOR: "motorOutput"}.get(
        int(predictor)
    )
    if setting is None:
        return 0
    values = as_numbers(settings.get(setting, ""))
    if not values or not abs(values[0]) < 1 << 31:
        raise ValueError(
            f"{setting} must be a number, which {name} begins from; got "
            f"{settings.get(setting, '')[:20]!r}"
        )
    return int(values[0])


def _intervals(settings: Mapping[str, str]) -> np.ndarray:
    """Return the interval of I frames, numerator and denominator of that of P frames [loops]."""
    interval = as_numbers(settings.get("I interval", "1"))
    numerator, _, denominator = settings.get("P interval", "1").rpartition("/")
    values = [*interval[:1], *as_numbers(numerator or "1")[:1], *as_numbers(denominator)[:1]]
    if len(values) != 3 or not all(
        least <= v <= MOST_LOOPS for v, least in zip(values, (1, 1, 0), strict=True)
    ):
        raise ValueError("I interval and P interval must be numbers of loops")
    return np.array(values).astype(np.int64)
