"""Law of the table that `np-drake bench` prints."""

from diagrams.cli import verb as output
from diagrams.cli.reproduce import ANSWERS, TIMES
from diagrams.studies.columns import tabulate

LINE = {"suite": "N = 20, K = 24", "name": "acados", "problems": 200, "median_ms": 0.4712}
LINE |= {"p95_ms": 0.5723, "p99_ms": 0.6234, "max_ms": 1030.5, "failures": 40, "fallbacks": 40}
LINE |= {"gap_median": 0.0012, "gap_max": 0.12, "violation_max": 0.01}
LINE |= {"ratio_to_casadi": 0.0234, "ratio_to_acados": None}


def test_the_solver_tables_stay_within_the_width(capsys):
    for columns in (TIMES, ANSWERS):
        output.print_table(*tabulate("title", [LINE], columns))
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= output.WIDTH
    assert any("–" in line for line in lines)
