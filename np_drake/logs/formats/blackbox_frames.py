"""Frames of one blackbox log: the encodings of their fields, what each adds to its prediction, and
where the log is damaged.

A frame is the letter of its kind, then its fields: I alone, P on the frames before it; S, G and H
stand beside them and are passed over, E is an event. A reader takes the bytes of a log, the place
of its first byte and the place behind the last one, and returns the place behind what it read;
beyond that of the last byte: the bytes end within the value, or are none.
Source: Betaflight, "Blackbox logging internals", data version 2.
"""

from typing import NamedTuple

import numpy as np

from np_drake.compiled import compiled

SIGNED_VB = 0
UNSIGNED_VB = 1
NEG_14BIT = 3
TAG8_8SVB = 6
TAG2_3S32 = 7
TAG8_4S16 = 8
NULL = 9
TAG2_3SVARIABLE = 10
ENCODINGS = (0, 1, 3, 6, 7, 8, 9, 10)
LONGEST = 5  # bytes of a number of 32 bits, 7 in each
# Of three numbers in 1 to 3 bytes, by encoding and the two bits that tell: bytes, and of each
# number its lowest bit and how many it has.
PACKED = np.array(
    [
        [[1, 4, 2, 2, 2, 0, 2], [2, 8, 4, 4, 4, 0, 4], [3, 16, 6, 8, 6, 0, 6]],
        [[1, 4, 2, 2, 2, 0, 2], [2, 9, 5, 4, 5, 0, 4], [3, 14, 8, 7, 7, 0, 7]],
    ]
)

KINDS = "IPSGH"  # rows of the definitions below
I, P = range(2)
EVENT = 5
KIND_OF = np.full(256, -1)  # by the letter of a frame; -1: no frame begins so
KIND_OF[np.frombuffer(b"IPSGHE", np.uint8)] = range(6)
PREVIOUS, STRAIGHT_LINE, AVERAGE_2, MIN_THROTTLE, MOTOR_0, INCREMENT = range(1, 7)
STICK_CENTRE = 8
BATTERY = 9
MIN_MOTOR = 11
PREDICTORS = 12  # of which some add a number that the header tells
# Of two frames in turn; beyond, one of them is damaged. Source: the limits of Betaflight's viewer.
# [us, 1]
LONGEST_TIME = 10_000_000
MOST_ITERATIONS = 5000
# Numbers of an event: synchronous beep, resumed, disarmed, mode, failure of the IMU.
NUMBERS = np.zeros(256, np.int64)
NUMBERS[[0, 14, 15, 30, 40]] = 1, 2, 1, 2, 1
ADJUSTMENT = 13
RESUMED = 14
END = 255
END_TEXT = np.frombuffer(b"End of log", np.uint8)
ROWS, DAMAGED, LEFT_OUT, ENDED = range(4)  # what is counted; whether the log has its end
ENCODING, PREDICTOR, SIGNED, CONSTANT = range(4)  # tables of the fields
FIELDS, BEFORE, EARLIER = range(3)  # numbers of a main frame and of the two before it
ITERATION, TIME, OFFSET = range(3)  # of the last one [loops, us, us]


@compiled
def byte_at(data, at):
    """Return a byte as a signed integer, with which the others mix."""
    return np.int64(data[at])


@compiled
def unsigned_number(data, at, stop):
    """Return a number whose bytes have 7 bits each, the lowest first, and the place behind it."""
    value = 0
    for k in range(min(LONGEST, stop - at)):
        byte = byte_at(data, at + k)
        value |= (byte & 0x7F) << (7 * k)
        if byte < 0x80:
            return value & 0xFFFFFFFF, at + k + 1
    return 0, stop + 1


@compiled
def signed_number(data, at, stop):
    """Return a number whose lowest bit is its sign, and the place behind it."""
    value, at = unsigned_number(data, at, stop)
    return (value >> 1) ^ -(value & 1), at


@compiled
def _extended(value, bits):
    """Return the signed number that is in the lowest bits of a value."""
    value &= (1 << bits) - 1
    return value - (1 << bits) if value >> (bits - 1) else value


@compiled
def _three(data, at, stop, encoding, out, first, last):
    """Write three numbers whose sizes the two highest bits of their first byte tell."""
    lead = byte_at(data, at)
    size = lead >> 6
    if size == 3:
        at += 1
        for k in range(3):
            count = ((lead >> (2 * k)) & 3) + 1
            if at + count > stop:
                return stop + 1
            value = 0
            for i in range(count):
                value |= byte_at(data, at + i) << (8 * i)
            if first + k < last:
                out[first + k] = _extended(value, 8 * count)
            at += count
        return at
    packed = PACKED[int(encoding == TAG2_3SVARIABLE), size]
    if at + packed[0] > stop:
        return stop + 1
    value = 0
    for i in range(packed[0]):
        value = value << 8 | byte_at(data, at + i)
    for k in range(3):
        if first + k < last:
            out[first + k] = _extended(value >> packed[1 + 2 * k], packed[2 + 2 * k])
    return at + packed[0]


@compiled
def _four(data, at, stop, out, first, last):
    """Write four numbers of 0, 4, 8 or 16 bits, which a byte before them tells; they lie in half
    bytes.
    """
    selector = byte_at(data, at)
    nibble = 2 * (at + 1)
    for k in range(4):
        size = (selector >> (2 * k)) & 3
        count = size if size < 3 else 4
        if nibble + count > 2 * stop:
            return stop + 1
        value = 0
        for _ in range(count):
            byte = byte_at(data, nibble >> 1)
            value = (value << 4) | (byte & 15 if nibble & 1 else byte >> 4)
            nibble += 1
        if first + k < last:
            out[first + k] = _extended(value, 4 * count) if count else 0
    return (nibble + 1) >> 1


@compiled
def read_fields(data, at, stop, encodings, count, out):
    """Write the encoded numbers (m,) of one frame, which begins behind the letter of its kind, and
    return the place behind them.
    """
    i = 0
    while i < count:
        # the place behind the numbers that are read together
        encoding = encodings[i]
        last = i + 1
        if encoding == NULL:
            out[i] = 0
        elif at >= stop:
            return stop + 1
        elif encoding == SIGNED_VB:
            out[i], at = signed_number(data, at, stop)
        elif encoding == UNSIGNED_VB:
            out[i], at = unsigned_number(data, at, stop)
        elif encoding == NEG_14BIT:
            value, at = unsigned_number(data, at, stop)
            out[i] = -_extended(value, 14)
        elif encoding == TAG8_8SVB:
            while last < min(i + 8, count) and encodings[last] == TAG8_8SVB:
                last += 1
            tags = 1
            if last > i + 1:
                tags = byte_at(data, at)
                at += 1
            for k in range(i, last):
                out[k] = 0
                if tags & 1:
                    out[k], at = signed_number(data, at, stop)
                tags >>= 1
        elif encoding == TAG8_4S16:
            at = _four(data, at, stop, out, i, count)
            last = i + 4
        else:
            at = _three(data, at, stop, encoding, out, i, count)
            last = i + 3
        i = last
    return at


@compiled
def _event(data, at, stop):
    """Return the place behind an event, its kind, and the first two numbers that it holds."""
    if at >= stop:
        return stop + 1, 0, 0, 0
    kind = byte_at(data, at)
    at += 1
    first = 0
    second = 0
    if kind == END:
        behind = at + len(END_TEXT)
        complete = behind <= stop and np.array_equal(data[at:behind], END_TEXT)
        return behind if complete else stop + 1, kind, 0, 0
    if NUMBERS[kind]:
        first, at = unsigned_number(data, at, stop)
        if NUMBERS[kind] == 2:
            second, at = unsigned_number(data, at, stop)
    elif kind == ADJUSTMENT and at < stop:
        if data[at] < 128:
            _, at = signed_number(data, at + 1, stop)
        else:
            at += 5
    else:
        return stop + 1, kind, 0, 0
    return min(at, stop + 1), kind, first, second


class Frames(NamedTuple):
    """Definitions of the frames of one log.

    counts: (5,) of the fields of every kind of frame, as `KINDS`; 0: there is none.
    tables: (4, 5, m) of the fields: encoding, predictor, whether signed (1 or 0), and what a
        predictor adds that the header tells.
    iteration, time, motor: places of loop iteration, time and first motor in a main frame.
    interval: of I frames; numerator, denominator: of that of P frames [loops].
    """

    counts: np.ndarray
    tables: np.ndarray
    iteration: int
    time: int
    motor: int
    interval: int
    numerator: int
    denominator: int


@compiled
def _skipped(frames, iteration):
    """Return how many loops after one of a main frame are not logged, by the header's intervals."""
    if frames.denominator <= 0:
        return frames.interval - 1
    for k in range(frames.interval):
        loop = (iteration + 1 + k) % frames.interval + frames.numerator - 1
        if loop % frames.denominator < frames.numerator:
            return k
    return 0


@compiled
def _add_predictions(frames, kind, memory, skipped):
    """Add to the numbers of a main frame what is predicted for them."""
    fields = memory[FIELDS]
    before = memory[BEFORE]
    earlier = memory[EARLIER]
    for i in range(frames.counts[kind]):
        predictor = frames.tables[PREDICTOR, kind, i]
        if predictor == PREVIOUS:
            fields[i] += before[i]
        elif predictor == STRAIGHT_LINE:
            fields[i] += 2 * before[i] - earlier[i]
        elif predictor == AVERAGE_2:
            fields[i] += int((before[i] + earlier[i]) / 2)  # towards zero
        elif predictor == MOTOR_0:
            fields[i] += fields[frames.motor]
        elif predictor == INCREMENT:
            fields[i] = before[i] + 1 + skipped
        else:
            fields[i] += frames.tables[CONSTANT, kind, i]
        fields[i] &= 0xFFFFFFFF
        if frames.tables[SIGNED, kind, i]:
            fields[i] = _extended(fields[i], 32)


@compiled
def _follows(frames, kind, memory, clock):
    """Add the predictions to a main frame and return whether it follows the one before; if so, it
    is the one before the next.
    """
    before = memory[BEFORE]
    skipped = _skipped(frames, before[frames.iteration]) if kind == P else 0
    _add_predictions(frames, kind, memory, skipped)
    iteration = memory[FIELDS, frames.iteration]
    time = memory[FIELDS, frames.time]
    later = (time - clock[TIME]) & 0xFFFFFFFF
    loops = (iteration - clock[ITERATION]) & 0xFFFFFFFF
    if clock[ITERATION] >= 0 and (later >= LONGEST_TIME or loops >= MOST_ITERATIONS):
        clock[ITERATION] = -1
        clock[TIME] = -1
        return False
    if 0 <= time < clock[TIME]:
        clock[OFFSET] += 1 << 32
    clock[ITERATION] = iteration
    clock[TIME] = time
    memory[EARLIER] = memory[FIELDS] if kind == I else before
    memory[BEFORE] = memory[FIELDS]
    return True


@compiled
def _is_followed(data, at, stop):
    """Return whether a frame that ends at a place is read whole: another begins there, or none."""
    return at <= stop and (at == stop or KIND_OF[data[at]] >= 0)


@compiled
def _write(fields, wanted, clock, tally, out):
    """Write the wanted fields of a main frame, with its time before them, and count it."""
    row = tally[ROWS]
    out[0, row] = clock[TIME] + clock[OFFSET]
    for k in range(len(wanted)):
        out[k + 1, row] = fields[wanted[k]]
    tally[ROWS] += 1


@compiled
def read_frames(data, at, stop, frames, wanted, out):
    """Write the wanted fields of all main frames of one log, and return what is counted of it, as
    `ROWS` and so on.

    A damaged frame is passed over byte by byte up to one that reads; P frames behind it wait for
    the next I frame, as their prediction is lost.

    Args:
        data: (n,) bytes.
        at: place of its first frame.
        frames: `Frames` of the log.
        wanted: places of the fields that are written.
        out: (fields, rows) of these, with the time [us] before them.
    """
    tally = np.zeros(4, np.int64)
    memory = np.zeros((3, frames.tables.shape[2]), np.int64)
    clock = np.array([-1, -1, 0])
    # whether predictions, and the place, are known
    known = False
    lost = False
    while at < stop:
        start = at
        kind = KIND_OF[data[at]]
        good = False
        if kind == EVENT:
            at, event, first, second = _event(data, start + 1, stop)
            if at <= stop and event == END:
                tally[ENDED] = 1
                return tally
            good = _is_followed(data, at, stop) and not lost
            if good and event == RESUMED:
                clock[ITERATION] = first
                clock[TIME] = second
                known = False
        elif kind >= 0 and frames.counts[kind]:
            encodings = frames.tables[ENCODING, kind]
            at = read_fields(data, start + 1, stop, encodings, frames.counts[kind], memory[FIELDS])
            good = _is_followed(data, at, stop)
            if good and kind == P and not known:
                tally[LEFT_OUT] += 1
            elif good and kind <= P:
                good = _follows(frames, kind, memory, clock)
                if good:
                    _write(memory[FIELDS], wanted, clock, tally, out)
                    known = True
                    lost = False
        if not good:
            tally[DAMAGED] += not lost
            known = False
            lost = True
            at = start + 1
    tally[DAMAGED] -= lost  # it is cut there
    return tally
