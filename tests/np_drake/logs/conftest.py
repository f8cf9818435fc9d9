"""Fixtures: a place for a log; files are read in a fresh process that has imported what reads them,
so that its peak memory is theirs.
"""

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

Read = Callable[[Path], tuple[list[str], int]]
SERVER = """
import os, resource, sys
{program}
for line in sys.stdin:
    child = os.fork()
    if not child:
        resource.setrlimit(resource.RLIMIT_CPU, ({seconds}, {seconds}))
        read(line.rstrip("\\n"))
        status = dict(line.split(":", 1) for line in open("/proc/self/status"))
        print(int(status["VmHWM"].split()[0]) // 1000, flush=True)
        os._exit(0)
    print("ended", os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@pytest.fixture(scope="module")
def log(tmp_path_factory) -> Path:
    """Return a place for a log."""
    return tmp_path_factory.mktemp("logs") / "log.bin"


@pytest.fixture(scope="session")
def fresh_reader() -> Iterator[Callable[[str, int], Read]]:
    """Return a function that starts such a process for a program that defines `read`, each file in
    a child of it.

    What it returns takes a path, and gives the lines that were printed and the peak memory [MB]. A
    file that takes more than the seconds of processor time, or ends its process, fails the test.
    """
    servers = []

    def start(program: str, seconds: int) -> Read:
        command = [sys.executable, "-c", SERVER.format(program=program, seconds=seconds)]
        server = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        servers.append(server)

        def read(path: Path) -> tuple[list[str], int]:
            server.stdin.write(f"{path}\n")
            server.stdin.flush()
            lines = []
            for line in server.stdout:
                if line.startswith("ended "):
                    break
                lines.append(line.rstrip("\n"))
            assert line == "ended 0\n", lines
            *said, peak = lines
            return said, int(peak)

        return read

    yield start
    for server in servers:
        server.stdin.close()
        server.wait()
        server.stdout.close()
