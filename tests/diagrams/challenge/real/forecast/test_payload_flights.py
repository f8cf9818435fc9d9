"""Laws of `np-drake reproduce payload-flights` before its long work: bad input is one line and exit
code 2.
"""

import pytest

from diagrams.cli.main import run


@pytest.mark.parametrize(
    "arguments, word",
    [([], "NP_DRAKE_REAL"), (["nowhere"], "not there"), (["nowhere", "--only", "x"], "--only")],
)
def test_bad_input_is_one_line(capfd, monkeypatch, arguments, word):
    monkeypatch.delenv("NP_DRAKE_REAL", raising=False)
    assert run(["reproduce", "payload-flights", *arguments]) == 2
    (line,) = [text for text in capfd.readouterr().err.splitlines() if text]
    assert word in line
