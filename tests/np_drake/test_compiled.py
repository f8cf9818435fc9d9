"""Laws of the compilation of inner loops."""

from numba import njit

from np_drake import compiled


def test_it_is_compiled_where_no_folder_takes_what_was_compiled(monkeypatch):
    def read_only(**how):
        if how.get("cache"):
            raise RuntimeError("cannot cache function: no locator available")
        return njit(**how)

    monkeypatch.setattr(compiled, "njit", read_only)
    assert compiled.compiled(lambda x: 2 * x)(21) == 42
