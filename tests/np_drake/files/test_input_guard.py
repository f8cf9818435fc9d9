"""A file that a run reads is not written by it, by whatever name."""

import pytest

from np_drake.files.atomic_file import require_writable, write_text
from np_drake.files.input_file import kept_json, read_json
from np_drake.files.input_guard import guard_inputs, note_input


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("1")
    return path


@pytest.mark.parametrize("kind", ["itself", "detour", "symbolic link", "hard link"])
def test_no_name_of_an_input_is_written(log, kind):
    name = log.with_name("other.json")
    if kind == "itself":
        name = log
    elif kind == "detour":
        name = log.parent / ".." / log.parent.name / log.name
    elif kind == "symbolic link":
        name.symlink_to(log)
    else:
        name.hardlink_to(log)
    with guard_inputs([log]):
        for write in (require_writable, lambda path: write_text(path, "2")):
            with pytest.raises(FileExistsError, match=r"must not be a file that is read.*Choose another"):
                write(name)
    assert log.read_text() == "1"


def test_a_file_is_an_input_once_it_is_read(log):
    with guard_inputs([]):
        read_json(log)
        with pytest.raises(FileExistsError):
            write_text(log, "2")


def test_an_output_is_refused_when_it_is_read_and_not_first_when_it_is_written(log):
    link = log.with_name("other.json")
    link.symlink_to(log)
    with guard_inputs([]):
        require_writable(link)
        with pytest.raises(FileExistsError, match=r"other\.json: must not be a file that is read .*log\.csv"):
            read_json(log)


def test_an_output_that_is_written_already_may_be_read(log):
    with guard_inputs([]):
        require_writable(log)
        write_text(log, "2")
        read_json(log)
        write_text(log, "3")


def test_a_result_that_is_kept_may_be_written_again(log):
    with guard_inputs([]):
        kept_json(log)
        write_text(log, "2")


def test_a_file_of_the_run_itself_may_be_read_and_written_again(log):
    with guard_inputs([]):
        write_text(log, "2")
        note_input(log)
        write_text(log, "3")
    assert log.read_text() == "3"


def test_without_a_guard_a_library_writes_what_it_is_told_to(log):
    note_input(log)
    write_text(log, "2")
    assert log.read_text() == "2"
