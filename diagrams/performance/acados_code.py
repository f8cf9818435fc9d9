"""Compiled solvers of acados: generated once, kept in a cache folder, loaded again later.

`comma-deps-acados` brings a `casadi` of its own, which lies over an installed one. So acados may
stand in a folder of its own (`pip install --no-deps --target DIR comma-deps-acados`) that
NP_DRAKE_ACADOS names; nothing here puts that folder on the path of this process.
"""

import ctypes
import dataclasses as dc
import hashlib
import importlib.util
import json
import logging
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from diagrams.performance import acados_model
from np_drake.mpc.problem import MpcConfig
from np_drake.vehicle import Vehicle

FOLDER = "NP_DRAKE_ACADOS"  # environment variable: folder that holds the package `acados`
FLAGS = [
    "-O2",
    "-march=native",
    "-fPIC",
    "-shared",
    "-w",
]  # for this machine, as numba compiles too
_LIBRARIES = ("blasfeo", "hpipm", "qpOASES_e", "acados")  # each needs those before it
_STEP = Path(__file__).with_name("acados_step.c")
_log = logging.getLogger(__name__)


def find_acados() -> Path:
    """Return the folder of the package `acados`.

    Raises: ImportError: if it is missing.
    """
    named = os.environ.get(FOLDER)
    if named:
        package = Path(named).resolve() / "acados"
        if (package / "install").is_dir():
            return package
        raise ImportError(
            f"AcadosSolver: {FOLDER} must name a folder that holds `acados`; got {named}."
        )
    spec = importlib.util.find_spec("acados")
    if spec is None or not spec.origin or not Path(spec.origin).with_name("install").is_dir():
        raise ImportError(
            "AcadosSolver: acados must be installed: pip install --no-deps --target DIR "
            "comma-deps-acados, "
            f"and {FOLDER}=DIR."
        )
    return Path(spec.origin).parent


def find_compiler() -> str:
    """Return the C compiler: that of the environment variable CC, or cc, gcc or clang.

    Raises: FileNotFoundError: if there is none.
    """
    named = os.environ.get("CC")
    for name in [named] if named else ["cc", "gcc", "clang"]:
        found = shutil.which(name)
        if found:
            return found
    raise FileNotFoundError(
        f"AcadosSolver: a C compiler must be on the PATH (cc, gcc or clang), or named by "
        f"CC; got {named}."
    )


def cache_folder() -> Path:
    """Return the folder of compiled solvers, under XDG_CACHE_HOME or ~/.cache."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "np_drake" / "acados"


def load(vehicle: Vehicle, config: MpcConfig, K: int, options: Mapping[str, Any]) -> ctypes.CDLL:
    """Return the compiled solver for lifted states of K entries, from the cache where it is there.

    Args:
        options: of acados' solver, as `acados_model.solver_options` gives them.
    Raises: ImportError: without acados or CasADi.
    FileNotFoundError: without a C compiler.
    RuntimeError: if code generation or compilation fails.
    """
    package = find_acados()
    target = cache_folder() / _key(package, vehicle, config, K, options) / "peer.so"
    if not target.exists():
        job = {"packages": str(package.parent), "K": K, "options": dict(options)}
        _build(target, package, job | {"vehicle": dc.asdict(vehicle), "config": dc.asdict(config)})
    for name in _LIBRARIES:
        ctypes.CDLL(str(package / "install" / "lib" / f"lib{name}.so"), mode=ctypes.RTLD_GLOBAL)
    return ctypes.CDLL(str(target))


def _key(
    package: Path, vehicle: Vehicle, config: MpcConfig, K: int, options: Mapping[str, Any]
) -> str:
    """Return a hash of all that the compiled solver depends on."""
    code = [Path(__file__), Path(acados_model.__file__), _STEP]
    library = (package / "install" / "lib" / "libacados.so").read_bytes()
    content = [dc.asdict(vehicle), dc.asdict(config), K, dict(options), FLAGS, _processor()]
    parts = [repr(content).encode(), library, *(file.read_bytes() for file in code)]
    return hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()[
        :20
    ]


def _processor() -> str:
    """Return the features of this machine's processor, for which the code is compiled."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    return next((line for line in lines if line.startswith("flags")), "")


def _build(target: Path, package: Path, job: dict[str, Any]) -> None:
    """Write the compiled solver to `target`; it appears there only when complete."""
    compiler = find_compiler()
    _log.info("compiling acados' solver into %s", target.parent)
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent) as name:
        folder = Path(name)
        _generate(folder, package, job)
        code = folder / "code"
        sources = [file for file in code.rglob("*.c") if _needed(file)]
        include = package / "install" / "include"
        folders = [code, include, include / "blasfeo" / "include", include / "hpipm" / "include"]
        _run(
            [
                compiler,
                *FLAGS,
                *(f"-I{f}" for f in folders),
                *sources,
                _STEP,
                "-o",
                folder / "peer.so",
            ]
        )
        os.replace(folder / "peer.so", target)


def _needed(file: Path) -> bool:
    """Return whether the solver is made of this file; the rest are examples, a simulator, and exact
    Hessians.
    """
    example = file.name.startswith(("main_", "acados_sim_"))
    return not example and not (file.stem.endswith("_hess") and "_cost_" not in file.stem)


def _generate(folder: Path, package: Path, job: dict[str, Any]) -> None:
    """Write acados' code to `folder`/code, in a process of its own."""
    source = folder / "source"  # as acados' own tree is laid out
    links = {
        "interfaces/acados_template/acados_template": package / "acados_template",
        "bin": package / "install" / "bin",
        "include": package / "install" / "include",
        "lib": package / "install" / "lib",
    }
    for link, to in links.items():
        (source / link).parent.mkdir(parents=True, exist_ok=True)
        (source / link).symlink_to(to)
    given = {"ACADOS_SOURCE_DIR": str(source), "PYTHONPATH": os.pathsep.join(_search_path())}
    _run(
        [sys.executable, "-m", acados_model.__name__],
        cwd=folder,
        env=os.environ | given,
        input=json.dumps(job).encode(),
    )


def _search_path() -> list[str]:
    """Return the path of this process, absolute."""
    return [os.path.abspath(entry) for entry in sys.path]


def _run(command: list[Any], **options: Any) -> None:
    """Run a command.

    Raises: RuntimeError: with the last line that it wrote, if it fails.
    """
    done = subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False, **options
    )
    if done.returncode:
        said = done.stdout.decode(errors="replace").strip().splitlines() or ["nothing"]
        raise RuntimeError(f"AcadosSolver: {command[0]} must succeed; it says: {said[-1]}")
