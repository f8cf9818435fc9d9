"""Blackbox logs of Betaflight and Indiflight: `.bbl`, `.bfl`, `.txt`.

Streams are `main` (fields of I and P frames), `slow` (S frames), `gps` (G frames) and `body`
(`blackbox_body`). Times are those of the firmware's clock; a slow frame has that of the main frame
before it.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from np_drake.logs.errors import LogError
from np_drake.logs.formats import blackbox_body
from np_drake.logs.formats.blackbox_frames import DAMAGED, ENDED, LEFT_OUT, ROWS, read_frames
from np_drake.logs.formats.blackbox_header import MARK, REMEDY, STREAMS, Session, sessions
from np_drake.logs.formats.blackbox_map import default_map, motors
from np_drake.logs.formats.blackbox_values import GROUPS, NULL
from np_drake.logs.formats.format import Contents, Format, Progress, Recording, Scanned, Stream

# Settings that give columns their meaning: logs of one file that differ in them cannot share a map.
SCALES = (
    "Firmware revision",
    "gyro_scale",
    "blackbox_high_resolution",
    "acc_1G",
    "motorOutput",
    "motor_poles",
)
PROTOCOLS = (
    "PWM",
    "OneShot125",
    "OneShot42",
    "Multishot",
    "brushed",
    "DShot150",
    "DShot300",
    "DShot600",
    "ProShot1000",
)
FACTS = {  # by setting: name on the sheet
    "Firmware revision": "firmware",
    "Firmware date": "firmware date",
    "Craft name": "vehicle",
    "Board information": "board",
    "Log start datetime": "start",
    "motorOutput": "motorOutput",
    "motor_poles": "motor_poles",
    "acc_1G": "acc_1G",
    "gyro_scale": "gyro_scale",
    "blackbox_high_resolution": "blackbox_high_resolution",
    "dshot_bidir": "dshot_bidir",
    "mixer_type": "mixer_type",
    "vbat_scale": "vbat_scale",
}
REVISION = re.compile(r"(\w+) (\d{1,4})\.(\d{1,4})")


def _contents(path: Path) -> Contents:
    """Return the fields of every kind of frame; reads the headers only.

    Raises: LogError: if no header is whole.
    """
    session = _largest(sessions(path, path.read_bytes())[0])
    return Scanned(_columns(session), _parameters(session))


def _read(path: Path, wanted: Mapping[str, list[str]], progress: Progress) -> Recording:
    """Decode the wanted fields of all logs of a file that share their fields and scales.

    Raises: LogError: if no header is whole, a field is not there, or no log has a frame.
    """
    content = path.read_bytes()
    known, bad = sessions(path, content)
    session = _largest(known)
    columns = _columns(session)
    for stream, names in wanted.items():
        for name in names:
            if name not in columns.get(stream, ()):
                raise LogError(f"{path}: must hold the field {name} of {stream}; it does not.")
    alike = [s for s in known if _columns(s) == columns and _scales(s) == _scales(session)]
    others = [str(s.number) for s in known if s not in alike]
    said = [f"{line}; left out" for line in bad]
    if len(alike) > 1:
        said.append(f"{len(known)} logs in one file: each begins a part")
    if others:
        said.append(
            f"logs {', '.join(others)} of {len(known)} have other fields or scales than "
            f"{session.number}; left out"
        )
    parts: list[dict[str, Stream]] = []
    breaks: list[tuple[float, str]] = []
    notes: list[str] = []
    latest = -np.inf
    for own in alike:
        streams, told = _decoded(own, content, wanted)
        progress(own.stop / len(content))
        if told[ROWS]:
            parts.append(streams)
            times = np.concatenate([stream.t for stream in streams.values()])
            if latest < times.min(initial=np.inf) < np.inf and len(parts) > 1:
                breaks.append((float(times.min()), "another log begins"))
            latest = max(latest, times.max(initial=-np.inf))
        which = f"log {own.number}: " if len(known) > 1 else ""
        notes += [*_damage(which, told), *_untold(which, streams)]
    if not parts:
        raise LogError(
            f"{path}: must hold a whole I frame after its header; it has none. {REMEDY}."
        )
    streams = {name: _joined([part[name] for part in parts]) for name in wanted}
    return Recording(str(path), streams, _facts(session), tuple(notes), tuple(said), tuple(breaks))


def _largest(known: Sequence[Session]) -> Session:
    return max(known, key=lambda session: session.stop - session.first)


def _columns(session: Session) -> dict[str, tuple[str, ...]]:
    """Return the names of the columns of every stream that has any."""
    found = {stream: session.columns(stream) for stream in STREAMS}
    found[blackbox_body.STREAM] = blackbox_body.body_columns(found["main"])
    return {stream: names for stream, names in found.items() if names}


def _scales(session: Session) -> list[str]:
    return [session.settings.get(name, "") for name in SCALES]


def _parameters(session: Session) -> dict[str, float]:
    """Return the settings that are numbers, one of a list as `name[i]`, and the version by the name
    of the firmware.
    """
    found: dict[str, float] = {}
    for name in session.settings:
        values = session.numbers(name)
        found |= (
            {name: values[0]}
            if len(values) == 1
            else {f"{name}[{i}]": v for i, v in enumerate(values)}
        )
    match = REVISION.match(session.settings.get("Firmware revision", ""))
    if match:
        found[match[1].lower()] = int(match[2]) + int(match[3]) / 100
    found["P interval"] = float(session.intervals[2] / session.intervals[1])
    return found


def _decoded(
    session: Session, content: bytes, wanted: Mapping[str, list[str]]
) -> tuple[dict[str, Stream], np.ndarray]:
    """Return the wanted streams of one log, and what is counted of it."""
    main = list(wanted.get("main", ()))
    if blackbox_body.STREAM in wanted:
        main += [name for name in blackbox_body.needed(session.columns("main")) if name not in main]
    names = {**wanted, "main": main}
    places, outs = [], []
    for stream, kind in STREAMS.items():
        own = names.get(stream, ())
        places.append(np.array([session.names[kind].index(name) for name in own], np.int64))
        outs.append(np.empty((len(own) + 1, _most_rows(session, kind))))
    told = read_frames(
        np.frombuffer(content, np.uint8),
        session.first,
        session.stop,
        session.counts,
        session.encodings,
        session.predictors,
        session.signed,
        session.constants,
        session.places,
        session.intervals,
        tuple(places),
        tuple(outs),
    )
    streams = {}
    for row, stream in enumerate(STREAMS):
        values = outs[row][:, : told[row]]
        streams[stream] = Stream(
            values[0] * 1e-6, dict(zip(names.get(stream, ()), values[1:], strict=True))
        )
    if blackbox_body.STREAM in wanted:
        found = blackbox_body.body_values(streams["main"].columns) if told[ROWS] else {}
        streams[blackbox_body.STREAM] = Stream(
            streams["main"].t,
            {name: found.get(name, np.empty(0)) for name in wanted[blackbox_body.STREAM]},
        )
    return {stream: streams[stream] for stream in wanted}, told


def _most_rows(session: Session, kind: str) -> int:
    """Return how many frames of a kind the bytes of a log can hold, by the fewest that one
    takes.
    """
    fewest = session.stop - session.first + 1
    for letter in "IP" if kind == "I" else kind:
        row = "IPSGH".index(letter)
        size, i = 1, 0
        while i < session.counts[row]:
            encoding = int(session.encodings[row, i])
            size += encoding != NULL
            i += GROUPS.get(encoding, 1)
        fewest = min(fewest, size) if session.counts[row] else fewest
    return (session.stop - session.first) // fewest + 1


def _joined(parts: Sequence[Stream]) -> Stream:
    if len(parts) == 1:
        return parts[0]
    columns = parts[0].columns
    return Stream(
        np.concatenate([part.t for part in parts]),
        {name: np.concatenate([part.columns[name] for part in parts]) for name in columns},
    )


def _damage(which: str, told: np.ndarray) -> Iterator[str]:
    """Yield notes on what is damaged."""
    if told[DAMAGED]:
        yield (
            f"{which}damaged at {told[DAMAGED]} place{'s' if told[DAMAGED] > 1 else ''}; "
            f"the frames there, and "
            f"{told[LEFT_OUT]} behind up to the next I frame, are left out."
        )
    if not told[ENDED]:
        yield (
            f"{which}no end of the log (cut off, or the power was lost); its whole frames are kept."
        )


def _untold(which: str, streams: Mapping[str, Stream]) -> Iterator[str]:
    """Yield a note on the rows whose axes are not told."""
    body = streams.get(blackbox_body.STREAM)
    count = (
        int(np.sum(np.isnan(next(iter(body.columns.values())))))
        if body is not None and len(body)
        else 0
    )
    if count and body is not None:
        yield (
            f"{which}the first {body.t[count] - body.t[0]:.2f} s are before the turn of the "
            f"IMU is learnt; left out."
        )


def _facts(session: Session) -> dict[str, str]:
    """Return what the header says of vehicle, firmware and scales, and the rate of its rows."""
    found = {"clock": "time since the start of the firmware [s]"}
    found |= {
        title: session.settings[name] for name, title in FACTS.items() if session.settings.get(name)
    }
    protocol = session.numbers("motor_pwm_protocol")
    if protocol and 0 <= protocol[0] < len(PROTOCOLS):
        found["motor protocol"] = PROTOCOLS[int(protocol[0])]
    looptime, divisor = session.numbers("looptime"), session.numbers("pid_process_denom") or [1.0]
    if looptime and looptime[0] > 0 and divisor[0] > 0 and session.intervals[2] > 0:
        loop = looptime[0] * divisor[0]
        rate = 1e6 / loop * session.intervals[1] / session.intervals[2]
        every = (
            f"{session.intervals[1]} of {session.intervals[2]}"
            if session.intervals[2] > 1
            else "all"
        )
        found["loop"] = f"{looptime[0]:g} us x {divisor[0]:g}, {every} logged: {rate:.6g} Hz"
    return found


BLACKBOX = Format(
    "blackbox",
    "Betaflight or Indiflight blackbox",
    lambda path, start: MARK in start,
    _contents,
    default_map,
    _read,
    motors,
)
