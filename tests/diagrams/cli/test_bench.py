from diagrams.cli import output
from diagrams.cli.bench import _solver_tables
from diagrams.performance.solver_bench import SolverReport

REPORT = SolverReport(
    "acados", 200, 0.4712, 0.5723, 0.6234, 1030.5, 40, 40, 0.0012, 0.12, 0.01, 0.0234, 12.4
)


def test_the_solver_tables_stay_within_the_width(capsys):
    for title, header, rows in _solver_tables({"infeasible start": [REPORT]}):
        output.print_table(title, header, rows)
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= output.WIDTH
    assert all(
        name in "".join(lines)
        for name in ("p95", "p99", "to casadi", "to acados", "gap", "feedback")
    )


def test_a_peer_that_did_not_run_leaves_a_dash(capsys):
    report = SolverReport("sqp", 1, 1.0, 1.0, 1.0, 1.0, 0, 0, 0.0, 0.0, 0.0)
    times, _ = _solver_tables({"tracking": [report]})
    output.print_table(*times)
    assert capsys.readouterr().out.count("–") >= 2
