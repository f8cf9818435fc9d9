"""Laws of the names that `import np_drake`, `systems` and `diagrams` offer."""

import subprocess
import sys
import time
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

import pytest
from mypy import api

ROOT = Path(__file__).parents[1]
PACKAGES = ("np_drake", "np_drake.effects", "systems", "diagrams")


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_is_there_and_listed(package):
    module = import_module(package)
    for name in module.__all__:
        assert getattr(module, name) is not None
        assert name in dir(module)


@pytest.mark.parametrize("package", PACKAGES)
def test_an_unknown_name_is_refused_with_those_there_are(package):
    module = import_module(package)
    with pytest.raises(AttributeError, match=module.__all__[0]):
        module.no_such_name  # noqa: B018


def test_a_type_checker_knows_every_public_name():
    known = [f"{package}.{name}" for package in PACKAGES for name in import_module(package).__all__]
    asked = ["reveal_type(np_drake.diagnose)", "from np_drake import nope"]
    code = "\n".join([*(f"import {package}" for package in PACKAGES), *known, *asked])
    out, _, status = api.run(["--config-file=", "--follow-imports=silent", "-c", code])
    assert status == 1
    assert 'has no attribute "nope"' in out
    assert out.count(": error:") == 1
    assert "def (" in out  # of diagnose, and not Any


@pytest.mark.parametrize("package", PACKAGES)
def test_importing_a_package_loads_neither_drake_nor_torch(package):
    code = f"import sys, {package}; print(not {{'pydrake', 'torch', 'numpy'}} & set(sys.modules))"
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert done.stdout == "True\n"
    assert time.perf_counter() - start < 3.0  # [s]; a tenth of it on a quiet machine


def test_the_module_is_the_command_line():
    command = [sys.executable, "-m", "np_drake", "--version"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == f"np-drake {version('np_drake')}\n"
