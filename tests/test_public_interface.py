"""Laws of the names that `import np_drake`, `systems` and `diagrams` offer."""

import subprocess
import sys
import time
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("np_drake", "np_drake.effects", "systems", "diagrams")


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_is_there_and_listed(package):
    module = import_module(package)
    for name in module.NAMES:
        assert getattr(module, name) is not None
        assert name in dir(module)


@pytest.mark.parametrize("package", PACKAGES)
def test_an_unknown_name_is_refused_with_those_there_are(package):
    module = import_module(package)
    with pytest.raises(AttributeError, match=next(iter(module.NAMES))):
        module.no_such_name  # noqa: B018


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
