"""An input asks for no more memory than its budget."""

import os

import pytest

from np_drake.files.input_file import cell_budget, kept_json, parse_json, read_bytes, read_json, text_budget


def test_a_file_beyond_its_budget_is_refused(tmp_path):
    (tmp_path / "a.yaml").write_bytes(bytes(11))
    assert read_bytes(tmp_path / "a.yaml", 11) == bytes(11)
    with pytest.raises(ValueError, match=r"a\.yaml: must hold at most 1e-05 MB"):
        read_bytes(tmp_path / "a.yaml", 10)


def test_a_device_that_never_ends_is_refused():
    if not os.path.exists("/dev/zero"):
        pytest.skip("no such device")
    with pytest.raises(ValueError, match="must hold at most 1 MB"):
        read_bytes("/dev/zero", 10**6)


def test_json_that_is_nested_too_deeply_is_no_fault_of_the_program(tmp_path):
    (tmp_path / "a.json").write_text("[" * 10**5)
    for read in (lambda: parse_json("[" * 10**5), lambda: read_json(tmp_path / "a.json")):
        with pytest.raises(ValueError, match="nested"):
            read()


def test_a_file_of_ten_megabytes_stays_within_a_gigabyte(tmp_path):
    with (tmp_path / "a.csv.gz").open("wb") as file:
        file.truncate(10**7)
    assert (
        8 * cell_budget(tmp_path / "a.csv.gz") < 0.2e9
    )  # of numbers; readers hold up to three copies [byte]
    assert text_budget(tmp_path / "a.csv.gz") < 1e9  # read in blocks [byte]


@pytest.mark.parametrize("text", ["", "{", '{"a": 1', "\x00" * 40, "[" * 10**5])
def test_a_result_that_was_cut_off_is_made_again(tmp_path, text, caplog):
    (tmp_path / "a.json").write_text(text)
    assert kept_json(tmp_path / "a.json") is None
    assert "made again" in caplog.text
    assert kept_json(tmp_path / "none.json") is None
