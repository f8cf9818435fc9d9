"""Laws of `np-drake reproduce`."""

import pytest

from diagrams.cli.main import run

BAD = {  # arguments: what the line must say
    "unknown": (
        ["nothing"],
        "must be one of tracking, configurations, weights, gap, mhe, theorem, pendulum, estimation, sample-eff",
    ),
    "unknown row": (
        ["configurations", "--only", "np"],
        "must name rows of the table (nominal; hold; np: default",
    ),
    "no flights": (["theorem"], "NP_DRAKE_NEUROBEM"),
    "no folder": (["theorem", "--neurobem", "nowhere"], "nowhere"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line(case, monkeypatch, capsys):
    monkeypatch.delenv("NP_DRAKE_NEUROBEM", raising=False)
    arguments, message = BAD[case]
    assert run(["reproduce", *arguments]) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("np-drake reproduce: ")
    assert message in last
