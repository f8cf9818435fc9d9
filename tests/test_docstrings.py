"""Laws of docstrings: every public name has one, its first line is a statement that can be read alone, and a function
of two parameters or more says in `Args:` what they are (that such a section is complete, ruff sees: D417).
"""

import ast
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest
from pydrake.systems.framework import LeafSystem

ROOT = Path(__file__).parents[1]
PACKAGES = ("np_drake", "systems", "diagrams")
BEGINNINGS = ("Of ", "The same", "And ", "As ")  # of a line that leans on the one before
Definition = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def files() -> list[Path]:
    """Return the modules of the packages relative to the root."""
    found = sorted(path.relative_to(ROOT) for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
    return found


def public(node: Definition, name: str = "") -> Iterator[tuple[str, Definition]]:
    """Yield a module or class and all that is public in it, with dotted names; the module's own is empty."""
    yield name, node
    for child in [] if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) else node.body:
        if isinstance(child, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and child.name[0] != "_":
            yield from public(child, f"{name}.{child.name}" if name else child.name)


def faults(source: str) -> list[str]:
    """Return one line for every public docstring whose first line is missing or no statement of its own."""
    found = []
    for dotted, node in public(ast.parse(source)):
        name = dotted or "module"
        first = (ast.get_docstring(node) or "").split("\n")[0]
        if not first:
            found.append(f"{name}: has no docstring")
        elif first.endswith("?"):
            found.append(f"{name}: asks: {first}")
        elif not first.endswith("."):
            found.append(f"{name}: does not end in a period: {first}")
        elif first.startswith(BEGINNINGS):
            found.append(f"{name}: cannot be read alone: {first}")
    return found


def test_the_laws_hold_in_many_files():
    assert len(files()) > 100


def documented_methods() -> frozenset[str]:
    """Return the names of the methods that a protocol or a base class with subclasses describes by `Args:`."""
    classes = [
        node
        for path in files()
        for node in ast.walk(ast.parse((ROOT / path).read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef)
    ]
    bases = {ast.unparse(base).split("[")[0] for node in classes for base in node.bases}
    return frozenset(
        function.name
        for node in classes
        if node.name in bases or "Protocol" in {ast.unparse(base).split("[")[0] for base in node.bases}
        for function in node.body
        if isinstance(function, ast.FunctionDef) and "Args:" in (ast.get_docstring(function) or "")
    )


def without_args(source: str, interface: frozenset[str] = frozenset()) -> list[str]:
    """Return the public functions of two parameters or more, `self` not counted, that have no `Args:`.

    Those of a constructor may stand in its class; a method of the interface has those of its protocol or base class;
    options of the command line have their help.
    """
    found = []
    for dotted, node in public(ast.parse(source)):
        functions = [node] if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) else []
        if isinstance(node, ast.ClassDef):
            functions = [f for f in node.body if isinstance(f, ast.FunctionDef) and f.name == "__init__"]
        for function in functions:
            said = (ast.get_docstring(function) or "") + (ast.get_docstring(node) or "")
            told = overrides(function) or (function is node and "." in dotted and function.name in interface)
            if len(parameters(function)) > 1 and "Args:" not in said and not told:
                found.append(dotted)
    return found


def parameters(function: ast.FunctionDef | ast.AsyncFunctionDef) -> list[str]:
    """Return the names of the parameters without `self` and `cls`."""
    of = function.args
    every = [*of.posonlyargs, *of.args, *of.kwonlyargs, *(a for a in (of.vararg, of.kwarg) if a)]
    return [argument.arg for argument in every if argument.arg not in ("self", "cls")]


def overrides(function: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Return whether a function is described elsewhere: by Drake, an overload, or the help of its options."""
    if function.name[0] != "_" and hasattr(LeafSystem, function.name):
        return True
    words = {"overload", "Option", "Argument", "options"}  # the last: annotations of the command line
    described = [*function.decorator_list, *(a.annotation for a in function.args.args), *function.args.defaults]
    names = {getattr(n, "id", getattr(n, "attr", "")) for node in described if node for n in ast.walk(node)}
    return bool(names & words)


def breaches(law: Callable[[str], list[str]], paths: Iterable[Path]) -> dict[str, list[str]]:
    """Return by file what breaks a law of its source."""
    found = {str(path): law((ROOT / path).read_text(encoding="utf-8")) for path in paths}
    return {path: names for path, names in found.items() if names}


def test_every_public_docstring_begins_with_a_statement_of_its_own():
    assert breaches(faults, files()) == {}


def test_every_function_of_two_parameters_says_what_they_are():
    interface = documented_methods()
    assert breaches(lambda source: without_args(source, interface), files()) == {}


@pytest.mark.parametrize(
    "source",
    [
        "def f(a, *, b): ...",
        "class A:\n    def f(self, a, *b): ...",
        "class A:\n    def __init__(self, a, b): ...",
        "class A:\n    @classmethod\n    def f(cls, a, b=1, **c):\n        'Return a.'",
    ],
)
def test_the_law_sees_parameters_without_a_word(source):
    assert len(without_args(source)) == 1


@pytest.mark.parametrize(
    "source",
    [
        "def f(a): ...",
        "def _f(a, b): ...",
        "def f(a, b):\n    'Args: a: x.'",
        "class A:\n    'Args: a: x.'\n    def __init__(self, a, b): ...",
        "def f(a, b: Annotated[int, Option()] = 1): ...",
        "class A:\n    def DoCalcTimeDerivatives(self, a, b): ...",
        "class A:\n    def f(self, a): ...",
    ],
)
def test_the_law_asks_for_no_needless_word(source):
    assert without_args(source) == []


@pytest.mark.parametrize(
    "first", ["Is it a number?", "Of the rows.", "The same for gp.", "And back.", "As `check`.", "(n, 3) force [N]"]
)
def test_the_law_sees_a_breach(first):
    assert faults(f'"""A module."""\n\n\nclass A:\n    """A class."""\n\n    def f(self):\n        """{first}"""\n')


def test_the_law_sees_a_missing_docstring():
    assert faults('"""A module."""\n\n\ndef f():\n    pass\n') == ["f: has no docstring"]


def test_the_law_leaves_private_and_inner_functions_alone():
    assert faults('"""A module."""\n\n\ndef _f():\n    def g():\n        """Of it."""\n') == []
