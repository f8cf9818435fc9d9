"""The three floors: diagrams -> systems -> np_drake; inside a floor, rooms in order."""

import ast
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FLOORS = ("np_drake", "systems", "diagrams")  # from the ground up
FILES = sorted(path.relative_to(ROOT) for floor in FLOORS for path in (ROOT / floor).rglob("*.py"))
# From the ground up: a module imports from its own room and from those before it.
DIAGNOSIS = (
    *("options", "residuals", "result", "forward_model", "effect_prior"),
    *("regressors", "swing_fit", "rotor_balance"),
    *("fitting", "calibration", "held_out", "selection", "slow_force", "gusts", "decision"),
    *("gap", "doctor", "report", "diagnose"),
)
GROUND = (
    *("lazy_names", "attitude", "compiled", "checks", "finding", "files", "metrics", "vehicle"),
    *("flight_log", "rigid_body", "rotor_input", "residual_model", "command_delay", "labels"),
    *(
        "trained_model",
        "training_data",
        "estimation",
        "effects",
        "identification",
        "logs",
        "references",
        "diagnosis",
    ),
    *("mpc", "control", "autopilot"),
    *("payload_filter", "lifting", "residual_models", "skill", "__main__"),
)
EXPERIMENTS = (
    *("batch", "loop"),
    *("random_flights", "training", "gap", "identification_page", "certify", "exports"),
    *("autopilot", "evidence", "demo", "cli"),
)
MOST_IMPORTS = 10  # of modules of the diagnosis by one of them; `diagnose` strings them together
SIMULATOR = ("pydrake.systems", "pydrake.multibody", "pydrake.geometry", "pydrake.visualization")


def test_any_module_of_the_logs_can_be_the_first_that_is_imported():
    paths = [p for p in FILES if p.parts[:2] == ("np_drake", "logs") and p.stem != "__init__"]
    code = (
        "import importlib, sys\n"
        f"for name in {[str(path.with_suffix('')).replace('/', '.') for path in paths]}:\n"
        "    importlib.import_module(name)\n"
        "    for own in [own for own in sys.modules if own.startswith('np_drake.logs')]:\n"
        "        del sys.modules[own]\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)


@cache
def source_of(path: Path) -> str:
    return (ROOT / path).read_text(encoding="utf-8")


@cache
def imports(source: str) -> set[str]:
    """Every module that the source imports, and every name taken from one, with dots."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            module = "." * node.level + (node.module or "")
            found |= {module, *(f"{module}.{alias.name}" for alias in node.names)}
    return found


def within(name: str, package: str) -> bool:
    return name == package or name.startswith(f"{package}.")


def faults(path: Path, source: str) -> list[str]:
    """What this file imports and its floor forbids."""
    names = imports(source)
    floor = FLOORS.index(path.parts[0])
    forbidden = [*FLOORS[floor + 1 :], "pydrake.all", "tests"]
    if floor == 0:
        forbidden += SIMULATOR
    return sorted(
        name
        for name in names
        if name.startswith(".") or any(within(name, package) for package in forbidden)
    )


def test_imports_run_downwards():
    found = {str(path): faults(path, source_of(path)) for path in FILES}
    assert {path: names for path, names in found.items() if names} == {}


@pytest.mark.parametrize(
    "path, source",
    [
        ("np_drake/x.py", "def f():\n    import systems.rotors"),
        ("np_drake/x.py", "from pydrake.systems.framework import LeafSystem"),
        ("np_drake/x.py", "from pydrake import multibody"),
        ("np_drake/x.py", "from . import y"),
        ("systems/x.py", "from diagrams.evidence.studies.tracking import run"),
        ("systems/x.py", "from pydrake.all import *"),
        ("diagrams/x.py", "import pydrake.all"),
    ],
)
def test_the_law_sees_a_breach(path, source):
    assert faults(Path(path), source)


def modules(package: str) -> dict[str, Path]:
    """Modules of a package by dotted name."""
    files = [path for path in FILES if within(".".join(path.parts), package)]
    return {".".join(path.with_suffix("").parts).removesuffix(".__init__"): path for path in files}


def arrows(package: str) -> dict[str, set[str]]:
    """Modules of the package that each of them imports, a package standing for its `__init__`."""
    known = modules(package)
    found = {}
    for name, path in known.items():
        taken = imports(source_of(path))
        direct = {other for other in taken if other in known}
        found[name] = (
            direct
            - {other for other in direct if any(d.startswith(f"{other}.") for d in direct)}
            - {name}
        )
    return found


def room(module: str, package: str) -> str:
    return module.removeprefix(f"{package}.").split(".")[0]


@pytest.mark.parametrize(
    "package, order",
    [("np_drake", GROUND), ("np_drake.diagnosis", DIAGNOSIS), ("diagrams", EXPERIMENTS)],
)
def test_inside_a_floor_imports_run_downwards(package, order):
    upward = [
        (module, other)
        for module, others in arrows(package).items()
        for other in others
        if package not in (module, other)
        if order.index(room(other, package)) > order.index(room(module, package))
    ]
    assert upward == []


@pytest.mark.parametrize("floor", FLOORS)
def test_no_modules_import_each_other_in_a_circle(floor):
    graph = arrows(floor)
    while graph:
        leaves = {module for module, others in graph.items() if not others & graph.keys()}
        assert leaves, sorted(graph)
        graph = {module: others for module, others in graph.items() if module not in leaves}


def test_no_module_of_the_diagnosis_knows_too_many_others():
    package = "np_drake.diagnosis"
    files = modules(package)
    many = {module for module, others in arrows(package).items() if len(others) > MOST_IMPORTS}
    assert {m for m in many if files[m].stem != "__init__"} <= {f"{package}.diagnose"}


ASKS = {"startswith", "endswith", "removeprefix", "split", "partition", "find", "index", "count"}


def looped(nodes: list[ast.AST], lists: set[str]) -> set[str]:
    """Names of the items of such attributes in loops."""
    loops = [n for n in nodes if isinstance(n, ast.For | ast.comprehension)]
    return {getattr(n.target, "id", "") for n in loops if getattr(n.iter, "attr", "") in lists}


def branches_on_text(source: str) -> list[int]:
    """Lines that ask what the text of a finding says, or its line."""
    nodes = list(ast.walk(ast.parse(source)))
    findings = {"finding", *looped(nodes, {"findings", "problems"})}
    lines = looped(nodes, {"notes", "shown"})

    def for_people(node: ast.AST) -> bool:
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "str":
            return getattr(node.args[0], "id", "") in findings
        return getattr(node, "attr", "") == "text" or getattr(node, "id", None) in lines

    calls = [n for n in nodes if isinstance(n, ast.Call) and n.args]
    compared = [n for n in nodes if isinstance(n, ast.Compare)]
    asked = [(n, n.func.value) for n in calls if getattr(n.func, "attr", "") in ASKS]
    asked += [(n, own) for n in compared for own in (n.left, *n.comparators)]
    return [node.lineno for node, own in asked if for_people(own)]


def test_nothing_branches_on_the_text_of_a_finding():
    found = {str(path): branches_on_text(source_of(path)) for path in FILES}
    assert {path: lines for path, lines in found.items() if lines} == {}


@pytest.mark.parametrize(
    "source",
    [
        "x = finding.text.startswith('no flight')",
        "x = 'clips' in str(finding)",
        "x = [note for note in log.notes if note.startswith('fits')]",
        "x = [f for f in log.findings if str(f) == 'no flight']",
    ],
)
def test_the_law_on_text_sees_a_breach(source):
    assert branches_on_text(source)
