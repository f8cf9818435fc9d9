"""Laws of the compilation of inner loops."""

import logging
import sys
from types import SimpleNamespace

import pytest
from numba import njit

from np_drake import compiled


def test_it_is_compiled_where_no_folder_takes_what_was_compiled(monkeypatch):
    def read_only(**how):
        if how.get("cache"):
            raise RuntimeError("cannot cache function: no locator available")
        return njit(**how)

    monkeypatch.setattr(compiled, "njit", read_only)
    assert compiled.compiled(lambda x: 2 * x)(21) == 42


@pytest.mark.parametrize(
    "module, looking, said",
    [
        ("np_drake.mpc", True, [logging.WARNING]),
        ("np_drake.mpc", False, [logging.INFO]),  # stderr is for errors alone
        ("elsewhere.code", True, []),
    ],
)
def test_a_wait_for_the_compiler_is_explained_once(monkeypatch, caplog, module, looking, said):
    monkeypatch.setattr(sys, "stderr", SimpleNamespace(isatty=lambda: looking))
    dut = compiled.Notice()
    function = SimpleNamespace(py_func=SimpleNamespace(__module__=module))
    with caplog.at_level(logging.INFO):
        for _ in range(2):
            dut.on_start(SimpleNamespace(data={"dispatcher": function}))
    assert [record.levelno for record in caplog.records] == said


def test_a_compilation_is_heard_of(monkeypatch):
    heard = []
    monkeypatch.setattr(compiled.Notice, "on_start", lambda self, event: heard.append(event.data["dispatcher"]))
    function = njit(lambda x: x + 1.0)
    function(1.0)
    assert heard == [function]
