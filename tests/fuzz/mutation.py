"""Random changes of bytes, lines and words, for a fuzzer without coverage."""

import random

NUMBERS = b"nan inf -inf 1e999 -0 99999999999999999999 0x10 null true".split()
MARKS = b'[] {} [[ &a *a !!python/object:os.system !x << --- ,,, "'.split()
BLANKS = [b"", b" ", b"\t", b"\r\n", b"\n\n"]
BITS = [b"\xff\xfe", b"\x00", b"\x00" * 4, b"\xff" * 4, b"\xff\xff\xff\x7f"]
WORDS = [*NUMBERS, *MARKS, *BLANKS, *BITS]


def mutate(data: bytes, rng: random.Random, most: int = 8) -> bytes:
    """Return the data after one to `most` random changes."""
    for _ in range(rng.randint(1, most)):
        data = rng.choice(_CHANGES)(data, rng)
    return data


def _flip(data: bytes, rng: random.Random) -> bytes:
    if not data:
        return data
    at = rng.randrange(len(data))
    return data[:at] + bytes([data[at] ^ (1 << rng.randrange(8))]) + data[at + 1 :]


def _cut(data: bytes, rng: random.Random) -> bytes:
    first, last = sorted(rng.randrange(len(data) + 1) for _ in range(2))
    return data[:first] + data[last:]


def _double(data: bytes, rng: random.Random) -> bytes:
    first, last = sorted(rng.randrange(len(data) + 1) for _ in range(2))
    return data[:last] + data[first:last] + data[last:]


def _insert(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.choice(WORDS) + data[at:]


def _replace_word(data: bytes, rng: random.Random) -> bytes:
    """Replace what stands between two separators."""
    cuts = [i for i, byte in enumerate(data) if byte in b',:\n []{}"']
    if len(cuts) < 2:
        return _insert(data, rng)
    k = rng.randrange(len(cuts) - 1)
    return data[: cuts[k] + 1] + rng.choice(WORDS) + data[cuts[k + 1] :]


def _truncate(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


_CHANGES = (_flip, _flip, _cut, _double, _insert, _replace_word, _replace_word, _truncate)
