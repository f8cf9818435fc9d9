"""Laws of the compilation of inner loops."""

import errno
import importlib.util

import pytest
from numba.core.caching import IndexDataCacheFile

from np_drake import compiled


def test_it_is_compiled_where_no_folder_takes_what_was_compiled(monkeypatch):
    def read_only(function):
        raise RuntimeError("cannot cache function: no locator available")

    monkeypatch.setattr(compiled, "Cache", read_only)
    assert compiled.compiled(lambda x: 2 * x)(21) == 42


SOURCE = "def doubled(x):\n    return 2 * x\n"


@pytest.fixture
def doubled(tmp_path):
    """Return a function that compiles `doubled` as a new process would: (value, answers cached)."""
    path = tmp_path / "doubling.py"
    path.write_text(SOURCE)

    def run():
        spec = importlib.util.spec_from_file_location("doubling", path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        dut = compiled.compiled(module.doubled)
        return dut(21), sum(dut.stats.cache_hits.values())

    run()
    return run


@pytest.mark.parametrize("files", ["*.nbi", "*.nbc"])
@pytest.mark.parametrize("content", [b"", b"\x80garbage" * 40])
def test_damaged_machine_code_is_compiled_again(tmp_path, doubled, content, files):
    assert doubled() == (42, 1)
    for path in list(tmp_path.rglob(files)):
        path.write_bytes(content)
    assert doubled()[0] == 42


def test_a_full_disk_under_the_cache_costs_only_the_cache(monkeypatch, doubled, tmp_path):
    def full(self, filepath):
        raise OSError(errno.ENOSPC, "No space left on device")

    for path in tmp_path.rglob("*.nb?"):
        path.unlink()
    monkeypatch.setattr(IndexDataCacheFile, "_open_for_write", full)
    assert doubled() == (42, 0)
