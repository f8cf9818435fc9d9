"""Laws of tables: what was written is read, whatever its delimiter; what is no table is named in
one line.
"""

import gzip

import numpy as np
import pytest

from np_drake.logs.columns import NAMES
from np_drake.logs.errors import LogError
from np_drake.logs.formats import text_table
from np_drake.logs.formats.format import Stream
from np_drake.logs.formats.known_formats import format_of
from np_drake.logs.formats.log_file import write_log
from np_drake.logs.formats.table import TABLE
from tests.np_drake.logs.formats.table_writer import write as write_table

SUFFIXES = (".csv", ".csv.gz", ".txt", ".tsv", ".parquet")


def read(path, *names):
    """Read the named columns, or all."""
    shares = []
    recording = TABLE.read(
        path, {"table": list(names) or list(TABLE.contents(path)["table"])}, shares.append
    )
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    return recording


@pytest.fixture
def made():
    draw = np.random.default_rng(0)
    return Stream(0.01 * np.arange(50), {"x": draw.normal(size=50), "y": draw.normal(size=50)})


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_what_was_written_is_read_bit_for_bit(made, tmp_path, suffix, delimiter):
    if suffix == ".parquet":
        pytest.importorskip("pyarrow", reason="Parquet needs pyarrow")
    path = tmp_path / f"made{suffix}"
    write_table(path, {"table": made}, delimiter)
    assert format_of(path) is TABLE
    dut = read(path, "y", "x").streams["table"]
    assert list(dut.columns) == ["y", "x"]
    np.testing.assert_array_equal(dut.t, made.t)
    np.testing.assert_array_equal(dut.columns["x"], made.columns["x"])
    np.testing.assert_array_equal(dut.columns["y"], made.columns["y"])


@pytest.mark.parametrize("suffix", [".csv", ".csv.gz"])
def test_lists_in_cells_become_columns_row_by_row(tmp_path, suffix):
    vectors, matrices = np.arange(12.0).reshape(4, 3), np.arange(36.0).reshape(4, 3, 3)
    path = tmp_path / f"made{suffix}"
    write_table(path, {"table": Stream(np.arange(4.0), {"p": vectors, "R": matrices})})
    names = ["t", *(f"p[{i}]" for i in range(3)), *(f"R[{i}]" for i in range(9))]
    assert TABLE.contents(path) == {"table": tuple(names)}
    dut = read(path, "p[2]", "R[5]").streams["table"]
    np.testing.assert_array_equal(dut.columns["p[2]"], vectors[:, 2])
    np.testing.assert_array_equal(dut.columns["R[5]"], matrices[:, 1, 2])


def test_a_list_that_is_absent_for_a_whole_block_is_nan(tmp_path):
    rows = ['0,"[1, 2]"'] * text_table.BLOCK_ROWS + ["0,nan"] * 10
    (tmp_path / "made.csv").write_text("\n".join(["t,a", *rows]))
    dut = read(tmp_path / "made.csv", "a[1]").streams["table"].columns["a[1]"]
    np.testing.assert_array_equal(dut[-11:], [2.0, *[np.nan] * 10])


@pytest.mark.parametrize(
    "first, second",
    [
        ('"[1, 2]"', '"[3,4]"'),
        ("[1 2]", " [ 3.  4. ]"),
        ('"[[1.]\n [2.]]"', '"[[3.]\n [4.]]"'),
        ('"(1, 2)"', '"(3, nan)"'),
        ('"[1, 2]"', ""),
    ],
)
def test_a_list_may_be_written_in_several_ways(tmp_path, first, second):
    (tmp_path / "made.csv").write_text(f"t,p\n0,{first}\n1,{second}\n")
    dut = read(tmp_path / "made.csv", "p[0]", "p[1]").streams["table"]
    last = [np.nan, np.nan] if not second else [3.0, np.nan if "nan" in second else 4.0]
    np.testing.assert_array_equal(
        np.stack([dut.columns["p[0]"], dut.columns["p[1]"]], axis=1), [[1, 2], last]
    )


def test_empty_cells_are_nan_and_truth_values_are_one_and_zero(tmp_path):
    (tmp_path / "made.csv").write_text(
        "t,x,y\n0,,true\n1,nan,FALSE\n2,NaN,True\n3,null,false\n\n4, 5 ,1\n\n"
    )
    dut = read(tmp_path / "made.csv", "x", "y").streams["table"]
    np.testing.assert_array_equal(dut.columns["x"], [np.nan] * 4 + [5])
    np.testing.assert_array_equal(dut.columns["y"], [1, 0, 1, 0, 1])


def test_headers_with_quotes_blanks_marks_and_no_name_are_read(tmp_path):
    (tmp_path / "made.csv").write_text(
        '\ufeff# t , "x, ahead",  y\n0,1,2\n'.replace(' "', '"'), "utf-8"
    )
    assert TABLE.contents(tmp_path / "made.csv")["table"] == ("t", "x, ahead", "y")
    (tmp_path / "other.csv").write_bytes(b",t,yaw [\xb0],\n0,0.5,2,\n1,0.6,3,\n")
    dut = read(tmp_path / "other.csv").streams["table"]
    np.testing.assert_array_equal(dut.t, [0.5, 0.6])
    assert [name.isprintable() for name in dut.columns] == [True, True]


STYLES = {  # of one table: t, the wanted column, and a third; what Excel and friends make of it
    "plain": "t,x,y\n0.5,1.25,0\n1.5,-2.5e1,1\n",
    "sep": "\ufeffsep=;\r\nt;x;y\r\n0.5;1.25;0\r\n1.5;-2.5e1;1\r\n",
    "sep of a tab": "sep=\t\nt\tx\ty\n0.5\t1.25\t0\n1.5\t-2.5e1\t1\n",
    "decimal commas": "t;x;y\n0,5;1,25;0\n1,5;-2,5e1;1\n",
    "decimal commas below whole numbers": "t;x;y\n0,5;1,25;0\n1,5;-25;1\n",
    (
        "quotes and a delimiter at the end"
    ): 'sep=;\n"t";"x";"y"\n"0,5";"1,25";"0";\n"1,5";"-2,5e1";"1";\n',
    "units": "t,x,y\ns,m/s,1\n0.5,1.25,0\n1.5,-2.5e1,1\n",
    "units in brackets": "t;x;y\n[s];[m/s];[-]\n0,5;1,25;0\n1,5;-2,5e1;1\n",
}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16"])
@pytest.mark.parametrize("style", STYLES)
def test_a_table_as_a_spreadsheet_exports_it_holds_its_numbers(tmp_path, style, encoding):
    text = STYLES[style].removeprefix("\ufeff").replace("y", "y (\u00b0/s)", 1)
    (tmp_path / "made.csv").write_bytes(text.encode(encoding))
    assert format_of(tmp_path / "made.csv") is TABLE
    dut = read(tmp_path / "made.csv", "x", "y (\u00b0/s)")
    stream = dut.streams["table"]
    np.testing.assert_array_equal(stream.t, [0.5, 1.5])
    np.testing.assert_array_equal(stream.columns["x"], [1.25, -25.0])
    np.testing.assert_array_equal(stream.columns["y (\u00b0/s)"], [0.0, 1.0])
    assert dut.units.get("x") == ("m/s" if "units" in style else None)
    assert any("line of units" in note for note in dut.notes) == ("units" in style)


FAULTS = {  # content: what the message says when x is wanted
    "word": (
        "t,x\n0,1\n1,hello\n",
        r"made\.csv, column x, row 2 \(line 3\): must be a number; got 'hello'",
    ),
    "decimal comma between commas": (
        't,x\n0,"1,5"\n',
        r"column x, row 1 \(line 2\): .*decimal point; got '1,5'",
    ),
    "comma and point": (
        "t;x\n0.5;1.5\n1.0;1,5\n",
        r"column x, row 2 \(line 3\): .*decimal point; got '1,5'",
    ),
    "Python's underscore": (
        "t,x\n0,1\n1,1_0\n",
        r"row 2 \(line 3\): must be a number in plain digits.*got '1_0'",
    ),
    "another script's digits": (
        "t,x\n0,\u0661\u0662\n",
        r"column x, row 1 .*in plain digits, 0 to 9; got",
    ),
    "lines above the header": (
        "sep=;\nt;x\ns;m\n0;1\n1;ho\n",
        r"column x, row 2 \(line 5\): .*got 'ho'",
    ),
    "list of another length": (
        't,x\n0,"[1,2]"\n1,"[1]"\n',
        r"column x, row 2 \(line 3\): .*list of 2",
    ),
    "list turned number": ('t,x\n0,"[1,2]"\n1,7\n', r"column x, row 2 .*list of 2"),
    "number turned list": (
        't,x\n0,7\n1,"[1,2]"\n',
        r"column x, row 2 .*must be a number; got '\[1,2\]'",
    ),
    "short row": (
        "t,x\n0,1\n1\n2,3\n",
        r"row 2 \(line 3\): must have 2 cells as the header does; got 1",
    ),
    "long row": ("t,x\n0,1\n1,2,3\n", r"row 2 \(line 3\): must have 2 cells .*got 3"),
    "blank lines are counted": ("t,x\n\n\n0,1\n1,ho\n", r"row 2 \(line 5\)"),
    "open quote": (
        't,x\n0,"1\n' + "1,2\n" * 50000,
        r"line \d+: must be a row of cells; field larger",
    ),
    "empty": ("", "its first line is empty"),
    "one column": ("x\n1\n", "comma-separated"),
    "no header": ("0,1\n2,3\n", "header line of column names"),
    "name twice": ("t,x,x\n0,1,2\n", "column x: must stand once"),
    "list and name": ('t,x[0],x\n0,1,"[1]"\n', r"column x\[0\]: must stand once"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_named_with_its_place_in_one_line(tmp_path, fault):
    text, message = FAULTS[fault]
    (tmp_path / "made.csv").write_text(text)
    with pytest.raises(LogError, match=message) as error:
        read(tmp_path / "made.csv")
    assert "\n" not in str(error.value)


def test_a_column_that_is_not_wanted_may_hold_anything(tmp_path):
    (tmp_path / "made.csv").write_text('t,mode,x,l\n0,manual,1,"[1]"\n1,"auto, 2",2,"[1, 2]"\n')
    np.testing.assert_array_equal(
        read(tmp_path / "made.csv", "x").streams["table"].columns["x"], [1, 2]
    )
    with pytest.raises(LogError, match="column mode, row 1"):
        read(tmp_path / "made.csv", "mode")


def test_a_last_row_that_is_cut_off_is_left_out_with_a_note(tmp_path):
    (tmp_path / "made.csv").write_text("t,x,y\n0,1,2\n1,3,4\n2,5")
    dut = read(tmp_path / "made.csv")
    assert len(dut.streams["table"]) == 2
    assert dut.notes == ("line 4, the last, is cut off: it has 2 of 3 cells; left out",)


def test_our_own_columns_need_no_map(flight, tmp_path):
    write_log(flight, tmp_path / "made.csv")
    contents = TABLE.contents(tmp_path / "made.csv")
    log_map = TABLE.default_map(contents)
    assert log_map is not None
    assert set(contents["table"]) < set(NAMES)
    assert set(log_map.names()) == set(contents["table"])
    assert log_map.command == "held_after"
    assert TABLE.default_map({"table": ("t", "px", "py", "pz")}) is None


def test_a_damaged_gzip_is_refused(tmp_path):
    content = gzip.compress(b"t,x\n" + b"0.125,2.5\n" * 40000, mtime=0)
    trailer = content[:-8] + bytes(8)
    for damaged in (content[: len(content) // 2], content[:-4], trailer):
        (tmp_path / "made.csv.gz").write_bytes(damaged)
        with pytest.raises(LogError, match="must be a whole gzip file"):
            read(tmp_path / "made.csv.gz", "x")
    (tmp_path / "made.csv.gz").write_bytes(content[:200] + bytes(20) + content[220:])
    with pytest.raises(LogError):  # what comes out is no row, or no gzip
        read(tmp_path / "made.csv.gz", "x")


def test_a_header_of_absurd_width_is_refused_at_once(tmp_path):
    (tmp_path / "made.csv").write_text(",".join(f"c{i}" for i in range(20000)) + "\n")
    with pytest.raises(LogError, match="at most 10000 columns"):
        TABLE.contents(tmp_path / "made.csv")
    (tmp_path / "list.csv").write_text('t,x\n0,"[' + "1 " * 20000 + ']"\n')
    with pytest.raises(LogError, match="at most 10000 numbers"):
        TABLE.contents(tmp_path / "list.csv")
