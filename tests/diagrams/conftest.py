"""Fixtures: what a replay page holds, read from its file as a browser would."""

import base64
import json
import re
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from diagrams.batch import campaign


@pytest.fixture
def in_this_process(monkeypatch):
    """Cases of campaigns run in this process, where a test can change what they call."""

    def here(work, cases, jobs):
        return ((number, work(case)) for number, case in enumerate(cases))

    monkeypatch.setattr(campaign, "as_they_finish", here)


SIZED = {0xC4: ">B", 0xC5: ">H", 0xC6: ">I", 0xC7: ">B", 0xC8: ">H", 0xC9: ">I"}  # bytes and extensions
SIZED |= {0xD9: ">B", 0xDA: ">H", 0xDB: ">I", 0xDC: ">H", 0xDD: ">I", 0xDE: ">H", 0xDF: ">I"}
NUMBER = {0xCA: ">f", 0xCB: ">d", 0xCC: ">B", 0xCD: ">H", 0xCE: ">I", 0xCF: ">Q"}
NUMBER |= {0xD0: ">b", 0xD1: ">h", 0xD2: ">i", 0xD3: ">q"}
PLAIN = {0xC0: None, 0xC2: False, 0xC3: True}


class MessagePack:
    """Reader of MessagePack, in which Meshcat writes its commands."""

    def __init__(self, data: bytes):
        self.data, self.at = data, 0

    def take(self, count: int) -> bytes:
        self.at += count
        return self.data[self.at - count : self.at]

    def number(self, form: str):
        return struct.unpack(form, self.take(struct.calcsize(form)))[0]

    def read(self):
        head = self.take(1)[0]
        if head in PLAIN:
            return PLAIN[head]
        if head in NUMBER:
            return self.number(NUMBER[head])
        if head < 0x80 or head >= 0xE0:
            return head if head < 0x80 else head - 0x100
        if 0xD4 <= head <= 0xD8:  # extension of fixed size, behind its type
            return self.take(1 + 2 ** (head - 0xD4))[1:]
        small = head < 0xC0
        size = head & (0x0F if head < 0xA0 else 0x1F) if small else self.number(SIZED[head])
        if head < 0x90 or head in (0xDE, 0xDF):
            return {self.read(): self.read() for _ in range(size)}  # keys are read first
        if head < 0xA0 or head in (0xDC, 0xDD):
            return [self.read() for _ in range(size)]
        if head in (0xC7, 0xC8, 0xC9):
            return self.take(1 + size)[1:]
        content = self.take(size)
        return content if head in (0xC4, 0xC5, 0xC6) else content.decode()


class ReplayPage:
    """Page of a replay.

    film: object -> property -> value by frame.   numbers: those of the read-outs.   objects: paths of all objects.
    """

    def __init__(self, path: Path):
        self.text, self.film = path.read_text(), {}
        embedded = re.findall(r'octet-binary;base64,([A-Za-z0-9+/=]+)"\)\s*\.then', self.text)
        commands = [MessagePack(base64.b64decode(part)).read() for part in embedded]
        self.objects = {c["path"].removeprefix("/drake/") for c in commands if c["type"] == "set_object"}
        for animated in (a for c in commands if c["type"] == "set_animation" for a in c["animations"]):
            tracks = {t["name"][1:]: np.array([k["value"] for k in t["keys"]]) for t in animated["clip"]["tracks"]}
            self.film[animated["path"].removeprefix("/drake/")] = tracks
        found = re.search(r'<script id="np-drake-data" type="application/json">(.*?)</script>', self.text, re.S)
        self.numbers = json.loads(found[1])


@pytest.fixture(scope="session")
def replay_page() -> Callable[[Path], ReplayPage]:
    """Reader of a page's file."""
    return ReplayPage
