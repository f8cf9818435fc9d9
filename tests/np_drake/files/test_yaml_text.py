"""No YAML text takes more than its budget, or makes an object of another program."""

import time

import pytest

from np_drake.files.yaml_text import read_yaml, require_modest

LAUGHS = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 10)
)
BOMBS = {
    "aliases of aliases": (LAUGHS, r"at most 50000 values, aliases expanded \(line 5\)"),
    "too many values": ("[" + "1," * 60_000 + "1]", "at most 50000 values"),
    "too deep": ("[" * 20_000 + "]" * 20_000, "nested at most 50 deep"),
    "too deep by fields": ("{a: " * 3000 + "1" + "}" * 3000, "nested at most 50 deep"),
    "too long a value": (f"a: {'1' * 20_000}", "at most 10000 characters"),
    "an object": (
        'a: !!python/object/apply:os.system ["true"]',
        r"got the tag !!python/object/apply:os\.system ",
    ),
    "an unknown tag": ("a: !foo bar", r"got the tag !foo \(line 1\)\. Leave it out"),
    "bytes": ("\na: !!binary aGVsbG8=", r"got the tag !!binary \(line 2\)"),
    "a broken text": ("a: [", r"in line \d+"),
}


@pytest.mark.parametrize("bomb", BOMBS)
def test_a_text_beyond_its_budget_is_refused_at_once(tmp_path, bomb):
    text, message = BOMBS[bomb]
    (tmp_path / "a.yaml").write_text(text)
    start = time.process_time()
    with pytest.raises(ValueError, match=message) as found:
        read_yaml(tmp_path / "a.yaml")
    assert (
        time.process_time() - start < 2.0
    )  # [s]; a reader without a budget takes minutes, or never ends
    assert "\n" not in str(found.value)


def test_a_large_file_is_refused_before_it_is_read(tmp_path):
    (tmp_path / "a.yaml").write_text("#" * 10**6 + "\n")
    with pytest.raises(ValueError, match=r"a\.yaml: must hold at most 1 MB"):
        read_yaml(tmp_path / "a.yaml")


def test_bytes_that_are_no_text_are_refused(tmp_path):
    (tmp_path / "a.yaml").write_bytes(b"a: \xff\xfe")
    with pytest.raises(ValueError, match="UTF-8"):
        read_yaml(tmp_path / "a.yaml")


@pytest.mark.parametrize(
    "text", ["", "a: &a [1, 2]\nb: [*a, *a]", "a: !!str 1", "a: &a [*a]", "b: {<<: {c: 1}}"]
)
def test_what_yaml_means_by_itself_passes(text):
    require_modest(text)
