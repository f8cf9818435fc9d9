"""Frames of one blackbox log: what each field adds to its prediction, and where the log is damaged.

A frame is the letter of its kind, then its fields: I alone, P on the frames before it, S, G and H
beside them; E is an event. Source: Betaflight, "Blackbox logging internals", data version 2.
"""

import numpy as np

from np_drake.compiled import compiled
from np_drake.logs.formats.blackbox_values import (
    byte_at,
    read_fields,
    signed_number,
    unsigned_number,
)

KINDS = "IPSGH"  # rows of the definitions below
I, P, S, G, H = range(5)
LETTERS = np.frombuffer(b"IPSGH", np.uint8)
EVENT = ord("E")
(
    NOTHING,
    PREVIOUS,
    STRAIGHT_LINE,
    AVERAGE_2,
    MIN_THROTTLE,
    MOTOR_0,
    INCREMENT,
    HOME,
    STICK_CENTRE,
    BATTERY,
    MAIN_TIME,
    MIN_MOTOR,
) = range(12)
CONSTANTS = 12  # predictors, of which some add a number that the header tells
# Of two frames in turn; beyond, one of them is damaged. Source: the limits of Betaflight's viewer.
LONGEST_TIME, MOST_ITERATIONS = 10_000_000, 5000  # [us, 1]
FIXED = np.full(
    256, -1
)  # bytes of an event behind its kind, of those that have no number of own length
FIXED[[10, 11, 12]] = 5, 4, 8  # of automatic tuning
NUMBERS = np.zeros(
    256, np.int64
)  # of an event: synchronous beep, resumed, disarmed, mode, failure of the IMU
NUMBERS[[0, 14, 15, 30, 40]] = 1, 2, 1, 2, 1
ADJUSTMENT, TUNED, RESUMED, END = 13, 20, 14, 255
END_TEXT = np.frombuffer(b"End of log", np.uint8)
# Of what is counted: rows of the main, S and G frames, damaged places, frames left out; whether the
# log has its end.
ROWS, SLOW_ROWS, GPS_ROWS, DAMAGED, LEFT_OUT, ENDED = range(6)


@compiled
def _is_letter(byte):
    """Return whether a byte begins a frame."""
    found = byte == EVENT
    for letter in LETTERS:
        found = found or byte == letter
    return found


@compiled
def _event(data, at, stop):
    """Return the place behind an event, its kind, and the first two numbers that it holds."""
    if at >= stop:
        return stop + 1, 0, 0, 0
    kind = byte_at(data, at)
    at += 1
    first, second = 0, 0
    if kind == END:
        if at + len(END_TEXT) > stop:
            return stop + 1, kind, 0, 0
        for k in range(len(END_TEXT)):
            if data[at + k] != END_TEXT[k]:
                return stop + 1, kind, 0, 0
        return at + len(END_TEXT), kind, 0, 0
    if NUMBERS[kind]:
        first, at = unsigned_number(data, at, stop)
        if NUMBERS[kind] == 2:
            second, at = unsigned_number(data, at, stop)
    elif FIXED[kind] >= 0:
        at += FIXED[kind]
    elif kind == ADJUSTMENT and at < stop:
        if data[at] < 128:
            _, at = signed_number(data, at + 1, stop)
        else:
            at += 5
    elif kind == TUNED:
        _, at = signed_number(data, at + 1, stop)
        at += 2
    else:
        return stop + 1, kind, 0, 0
    return min(at, stop + 1), kind, first, second


@compiled
def _within(value, signed):
    """Return a sum in 32 bits."""
    value &= 0xFFFFFFFF
    return value - (1 << 32) if signed and value >> 31 else value


@compiled
def _halved(value):
    """Return the half of an integer, towards zero."""
    return value // 2 if value >= 0 else -(-value // 2)


@compiled
def _skipped(iteration, interval, numerator, denominator):
    """Return how many loops after one of a main frame are not logged, by the header's intervals."""
    if denominator <= 0:
        return interval - 1
    for k in range(interval):
        if ((iteration + 1 + k) % interval + numerator - 1) % denominator < numerator:
            return k
    return 0


@compiled
def _add_predictions(
    fields, kind, count, predictors, signed, constants, before, earlier, home, skipped, motor0, time
):
    """Add to the numbers of a frame what is predicted for them."""
    for i in range(count):
        predictor = predictors[kind, i]
        if predictor == PREVIOUS:
            fields[i] += before[i]
        elif predictor == STRAIGHT_LINE:
            fields[i] += 2 * before[i] - earlier[i]
        elif predictor == AVERAGE_2:
            fields[i] += _halved(before[i] + earlier[i])
        elif predictor == MOTOR_0:
            fields[i] += fields[motor0]
        elif predictor == INCREMENT:
            fields[i] = before[i] + 1 + skipped
        elif predictor == HOME:
            fields[i] += home[constants[kind, i]]
        elif predictor == MAIN_TIME:
            fields[i] += time
        else:
            fields[i] += constants[kind, i]
        fields[i] = _within(fields[i], signed[kind, i])


@compiled
def _put(out, row, time, fields, wanted):
    """Write the time and the wanted fields of a frame."""
    out[0, row] = time
    for k in range(len(wanted)):
        out[k + 1, row] = fields[wanted[k]]


@compiled
def read_frames(
    data,
    at,
    stop,
    counts,
    encodings,
    predictors,
    signed,
    constants,
    places,
    intervals,
    wanted,
    outs,
):
    """Write the wanted fields of all frames of one log, and return what is counted of it, as `ROWS`
    and so on.

    A damaged frame is passed over byte by byte up to one that reads; P frames behind it wait for
    the next I frame, as their prediction is lost.

    Args:
        data: (n,) bytes.
        at: place of its first frame.
        counts: (5,) of the fields of every kind of frame, as `KINDS`; 0: there is none.
        encodings: (5, m) of the fields.
        predictors: (5, m).
        signed: (5, m), 1 or 0.
        constants: (5, m) what a predictor adds that the header tells; of `HOME`, which of its
            coordinates.
        places: of loop iteration, time and first motor in a main frame, and of the time in a G
            frame (-1: none).
        intervals: of I frames, numerator and denominator of those of P frames [loops].
        wanted: places of the fields that are written, of the main, S and G frames.
        outs: (fields, rows) of these, with the time [us] before them.
    """
    iteration_at, time_at, motor0, gps_time_at = places
    told = np.zeros(6, np.int64)
    width = encodings.shape[1]
    fields, before, earlier = (
        np.zeros(width, np.int64),
        np.zeros(width, np.int64),
        np.zeros(width, np.int64),
    )
    home = np.zeros(2, np.int64)
    known, lost, located = False, False, False  # whether predictions, the place, and home are known
    iteration, time, offset = -1, -1, 0
    while at < stop:
        start = at
        letter = byte_at(data, at)
        kind = -1
        for k in range(5):
            if letter == LETTERS[k] and counts[k]:
                kind = k
        good = False
        if letter == EVENT:
            at, event, first, second = _event(data, start + 1, stop)
            if at <= stop and event == END:
                told[ENDED] = 1
                return told
            good = at <= stop and (at == stop or _is_letter(data[at])) and not lost
            if good and event == RESUMED:
                iteration, time = first, second
                known = False
        elif kind >= 0:
            at = read_fields(data, start + 1, stop, encodings[kind], counts[kind], fields)
            good = at <= stop and (at == stop or _is_letter(data[at]))
            if good and kind == P and not known:
                told[LEFT_OUT] += 1
            elif good and (kind <= P or not lost):
                skipped = (
                    _skipped(before[iteration_at], intervals[0], intervals[1], intervals[2])
                    if kind == P
                    else 0
                )
                main_time = max(time, 0)
                _add_predictions(
                    fields,
                    kind,
                    counts[kind],
                    predictors,
                    signed,
                    constants,
                    before,
                    earlier,
                    home,
                    skipped,
                    motor0,
                    main_time,
                )
                if kind <= P:
                    later = (fields[time_at] - time) & 0xFFFFFFFF
                    loops = (fields[iteration_at] - iteration) & 0xFFFFFFFF
                    good = iteration < 0 or (later < LONGEST_TIME and loops < MOST_ITERATIONS)
                    if good and 0 <= fields[time_at] < time:
                        offset += 1 << 32
                    iteration, time = (fields[iteration_at], fields[time_at]) if good else (-1, -1)
                if good and kind <= P:
                    earlier[:] = fields if kind == I else before
                    before[:] = fields
                    _put(outs[0], told[ROWS], time + offset, fields, wanted[0])
                    told[ROWS] += 1
                    known, lost = True, False
                elif kind == H:
                    home[0], home[1] = fields[0], fields[1] if counts[H] > 1 else 0
                    located = True
                elif kind == S and time >= 0:
                    _put(outs[1], told[SLOW_ROWS], time + offset, fields, wanted[1])
                    told[SLOW_ROWS] += 1
                elif kind == G and time >= 0 and (located or not counts[H]):
                    own = fields[gps_time_at] if gps_time_at >= 0 else time
                    _put(outs[2], told[GPS_ROWS], own + offset, fields, wanted[2])
                    told[GPS_ROWS] += 1
        if not good:
            told[DAMAGED] += not lost
            known, lost = False, True
            at = start + 1
    told[DAMAGED] -= lost  # it is cut there
    return told
