"""Encodings of the fields of a blackbox frame.
Source: Betaflight, "Blackbox logging internals", data version 2.

A reader takes the bytes of a log, the place of its first byte and the place behind the last one,
and returns the place behind what it read; beyond that of the last byte: the bytes end within the
value, or are none.
"""

import numpy as np

from np_drake.compiled import compiled

SIGNED_VB, UNSIGNED_VB, NEG_14BIT, TAG8_8SVB, TAG2_3S32, TAG8_4S16, NULL, TAG2_3SVARIABLE = (
    0,
    1,
    3,
    6,
    7,
    8,
    9,
    10,
)
ENCODINGS = (
    SIGNED_VB,
    UNSIGNED_VB,
    NEG_14BIT,
    TAG8_8SVB,
    TAG2_3S32,
    TAG8_4S16,
    NULL,
    TAG2_3SVARIABLE,
)
GROUPS = {
    TAG8_8SVB: 8,
    TAG2_3S32: 3,
    TAG8_4S16: 4,
    TAG2_3SVARIABLE: 3,
}  # fields that are encoded together, at most
LONGEST = 5  # bytes of a number of 32 bits, 7 in each


@compiled
def byte_at(data, at):
    """Return a byte as a signed integer, with which the others mix.

    Args:
        data: (n,) bytes.
    """
    return np.int64(data[at])


@compiled
def unsigned_number(data, at, stop):
    """Return a number whose bytes have 7 bits each, the lowest first, and the place behind it.

    Args:
        data: (n,) bytes.
    """
    value, shift = 0, 0
    for k in range(LONGEST):
        if at + k >= stop:
            break
        byte = byte_at(data, at + k)
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value & 0xFFFFFFFF, at + k + 1
        shift += 7
    return 0, stop + 1


@compiled
def signed_number(data, at, stop):
    """Return a number whose lowest bit is its sign, and the place behind it.

    Args:
        data: (n,) bytes.
    """
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
    a, b, c = 0, 0, 0
    length = size + 1
    if size == 3:
        length = 4
        for k in range(3):
            length += (lead >> (2 * k)) & 3
    elif encoding == TAG2_3S32 and size == 1:
        length = 2
    if at + length > stop:
        return stop + 1
    if size == 0:
        a, b, c = _extended(lead >> 4, 2), _extended(lead >> 2, 2), _extended(lead, 2)
    elif size == 3:
        place = at + 1
        for k in range(3):
            count = ((lead >> (2 * k)) & 3) + 1
            value = 0
            for i in range(count):
                value |= byte_at(data, place + i) << (8 * i)
            place += count
            value = _extended(value, 8 * count)
            if k == 0:
                a = value
            elif k == 1:
                b = value
            else:
                c = value
    elif encoding == TAG2_3S32:
        if size == 1:
            second = byte_at(data, at + 1)
            a, b, c = _extended(lead, 4), _extended(second >> 4, 4), _extended(second, 4)
        else:
            a, b, c = (
                _extended(lead, 6),
                _extended(byte_at(data, at + 1), 6),
                _extended(byte_at(data, at + 2), 6),
            )
    else:
        second = byte_at(data, at + 1)
        if size == 1:
            a, b, c = (
                _extended(lead >> 1, 5),
                _extended((lead << 4) | (second >> 4), 5),
                _extended(second, 4),
            )
        else:
            third = byte_at(data, at + 2)
            a, b, c = (
                _extended((lead << 2) | (second >> 6), 8),
                _extended((second << 1) | (third >> 7), 7),
                _extended(third, 7),
            )
    out[first] = a
    if first + 1 < last:
        out[first + 1] = b
    if first + 2 < last:
        out[first + 2] = c
    return at + length


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
    """Write the encoded numbers of one frame, and return the place behind them.

    Args:
        data: (n,) bytes.
        at: place of its first byte, behind the letter of its kind.
        encodings: (m,) of the fields.
        out: (m,) integers.
    """
    i = 0
    while i < count:
        encoding = encodings[i]
        if encoding == NULL:
            out[i] = 0
            i += 1
            continue
        if at >= stop:
            return stop + 1
        if encoding == SIGNED_VB:
            out[i], at = signed_number(data, at, stop)
            i += 1
        elif encoding == UNSIGNED_VB:
            out[i], at = unsigned_number(data, at, stop)
            i += 1
        elif encoding == NEG_14BIT:
            value, at = unsigned_number(data, at, stop)
            out[i] = -_extended(value, 14)
            i += 1
        elif encoding == TAG8_8SVB:
            last = i + 1
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
            i = last
        elif encoding == TAG8_4S16:
            at = _four(data, at, stop, out, i, count)
            i += 4
        else:
            at = _three(data, at, stop, encoding, out, i, count)
            i += 3
    return at
