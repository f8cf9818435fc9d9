"""Controller of the user's own: a Drake system in the place of the project's controllers."""

import importlib
import inspect
import re
import sys
from collections.abc import Callable, Mapping
from functools import lru_cache
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any

from pydrake.systems.framework import System

from diagrams.batch.run import one_line, require

# Maker of a new system a flight: called with those of `vehicle` (that the controller assumes),
# `reference` (the motion to follow) and `period` [s] that it names, and with its own parameters.
Factory = Callable[..., System]

# that it may have, and their sizes
INPUTS = {"x": 13, "acceleration": 6, "rotor_speed": 4, "label": 6, "flat": 15}
# That it may have: the command, or that of an autopilot, must be there; the others are recorded.
OUTPUTS = {"u": 4, "rates_thrust": 4, "chi_hat": 6, "status": 1, "solve_time": 1}
COMMANDS = {
    "u": "the command [f_u, tau_m]",
    "rates_thrust": "collective thrust and body rates for the autopilot",
}


def is_own(kind: str) -> bool:
    """Return whether a kind of controller is one's own: MODULE:NAME or FILE.py:NAME."""
    return ":" in kind


def kind_of(factory: Factory) -> str:
    """Return the kind MODULE:NAME of a factory, for messages, tables and names of files."""
    known = getattr(factory, "func", factory)  # of functools.partial
    name = re.sub(r"\W", "", getattr(known, "__name__", type(known).__name__)) or "own"
    return f"{getattr(known, '__module__', '__main__')}:{name}"


def with_file(kind: str, folder: Path) -> str:
    """Return the kind with its file, where that lies in `folder`."""
    module, _, name = kind.rpartition(":")
    file = folder / (module if module.endswith(".py") else f"{module.replace('.', '/')}.py")
    return f"{file}:{name}" if file.is_file() else kind


def load_factory(kind: str) -> Factory:
    """Return the factory that a kind names, from the current folder or an installed module.

    Raises: ValueError: one line, where there is none, or its module cannot be imported.
    """
    place, _, name = with_file(kind, Path()).rpartition(":")
    of_file = place.endswith(".py")
    require(
        bool(place) and name.isidentifier(),
        f"controller: must be MODULE:NAME or FILE.py:NAME of one of your own; got {kind!r}.",
    )
    require(
        not of_file or Path(place).is_file(),
        f"controller: there is no file {place}. Name it relative to the current folder.",
    )
    try:
        if of_file:
            module = _module_of_file(place, Path(place).stat().st_mtime_ns)
        else:
            module = importlib.import_module(place)
    except (Exception, SystemExit) as error:  # whatever the user's module raises
        why = one_line(error)
        if isinstance(error, ModuleNotFoundError) and error.name == place.split(".")[0]:
            why = (
                f"there is no {place.replace('.', '/')}.py beside the scenario or in the "
                f"current folder, and no installed module {place}"
            )
        raise ValueError(f"controller: {place} cannot be imported: {why}.") from error
    factory: Any = getattr(module, name, None)
    require(factory is not None, f"controller: {place} has no {name}.")
    require(
        callable(factory),
        f"controller: {kind} must be a class or a function; got {type(factory).__name__}.",
    )
    return factory


@lru_cache
def _module_of_file(file: str, version: int) -> ModuleType:
    """Return the module of a file as of its `version`; its neighbours can be imported meanwhile.

    Its name is its own, so that the file may be called like an installed module.
    """
    path = Path(file).resolve()
    module = ModuleType(f"own_{path.stem}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module
    sys.path.insert(0, str(path.parent))
    try:
        SourceFileLoader(module.__name__, str(path)).exec_module(module)
    finally:
        sys.path.remove(str(path.parent))
    return module


def make_own_controller(
    factory: Factory, parameters: Mapping[str, float], command: str, **offered: Any
) -> System:
    """Return the system that a factory makes of its own parameters and of what it names of
    `offered`, with its ports checked.

    Args:
        command: its port, u or that of an autopilot, rates_thrust.
    Raises: ValueError: one line, where it makes none, or its ports do not fit.
    """
    who = f"controller {kind_of(factory).rpartition(':')[2]}"
    require(
        callable(factory) and not isinstance(factory, System),
        f"{who}: must be a class or function that makes a new system each flight; got "
        f"{type(factory).__name__}. Name the class, or write lambda: Mine(…).",
    )
    known = [*inspect.signature(factory).parameters.values()]
    named = [
        p.name
        for p in known
        if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY) and p.name not in offered
    ]
    strange = sorted({*parameters} - {*named})
    require(
        not strange or any(p.kind == p.VAR_KEYWORD for p in known),
        f"{who}: has no parameter {', '.join(strange)}; it has {', '.join(named) or 'none'}.",
    )
    given = {p.name: offered[p.name] for p in known if p.name in offered}
    try:
        system = factory(**given, **parameters)
    except (Exception, SystemExit) as error:  # whatever the user's code raises
        raise ValueError(f"{who}: cannot be made: {one_line(error)}.") from error
    require(
        isinstance(system, System),
        f"{who}: must make a Drake system; it made a {type(system).__name__}.",
    )
    _check_ports(who, system, command)
    return system


def _check_ports(who: str, system: System, command: str) -> None:
    """Check names and sizes of the ports.

    Raises: ValueError: where one does not fit.
    """
    ins = map(system.get_input_port, range(system.num_input_ports()))
    outs = map(system.get_output_port, range(system.num_output_ports()))
    inputs = {port.get_name(): port.size() for port in ins}
    outputs = {port.get_name(): port.size() for port in outs}
    require(
        command in outputs,
        f"{who}: must have an output port {command} of 4, {COMMANDS[command]}; it has "
        f"{', '.join(outputs) or 'none'}.",
    )
    for name, size in inputs.items():
        require(name in INPUTS, f"{who}: has an input port {name}; known are {', '.join(INPUTS)}.")
        is_horizon = name == "flat" and size > 0 and size % INPUTS[name] == 0
        more = " times the points of a horizon" if name == "flat" else ""
        require(
            is_horizon or size == INPUTS[name],
            f"{who}: input port {name} must have size {INPUTS[name]}{more}; got {size}.",
        )
    for name, size in outputs.items():
        fits = OUTPUTS.get(name, size)
        require(size == fits, f"{who}: output port {name} must have size {fits}; got {size}.")
