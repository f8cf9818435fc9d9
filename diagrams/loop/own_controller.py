"""Controller of the user's own: a Drake system in the place of the project's controllers."""

import difflib
import hashlib
import importlib
import importlib.util
import inspect
import re
import sys
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from types import ModuleType

from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import ConstantVectorSource, ZeroOrderHold

from diagrams.batch.failed_run import one_line
from np_drake.labels import LabelConfig
from np_drake.references.base import Reference
from np_drake.vehicle import Vehicle
from systems.rate_loop import RateLoopTorque
from systems.reference_source import ReferenceSource
from systems.wrench_estimator import WrenchEstimator

Factory = Callable[..., System]
"""Maker of a new system a flight: called with those of `vehicle` (that the controller assumes), `reference` (the motion
to follow) and `period` [s] that it names, and with its own parameters."""  # noqa: E501

SYSTEM = "own_controller"  # its name as a subsystem of a flight
INPUTS = {
    "x": 13,
    "acceleration": 6,
    "rotor_speed": 4,
    "label": 6,
    "flat": 15,
}  # that it may have, and their sizes
# That it may have: the command, or that of an autopilot, must be there; the others are recorded.
OUTPUTS = {"u": 4, "rates_thrust": 4, "chi_hat": 6, "status": 1, "solve_time": 1}
COMMANDS = {
    "u": "the command [f_u, tau_m]",
    "rates_thrust": "collective thrust and body rates for the autopilot",
}
# A command that feeds through is read just after the events of an instant and just before the
# recorder looks at it.
_AFTER = 5e-7  # [s]
_PRIVATE = re.compile(r"own_[0-9a-f]{32}\.?")  # name of the package of a file, in messages


def is_own(kind: str) -> bool:
    """Return whether a kind of controller is one's own: MODULE:NAME or FILE.py:NAME."""
    return ":" in kind


def kind_of(factory: Factory) -> str:
    """Return the kind MODULE:NAME of a factory, for messages, tables and names of files."""
    known = getattr(factory, "func", factory)  # of functools.partial
    name = re.sub(r"\W", "", getattr(known, "__name__", type(known).__name__)) or "own"
    return f"{getattr(known, '__module__', '__main__')}:{name}"


def beside(kind: str, folder: Path) -> str:
    """Return the kind with its file, where that lies in `folder`."""
    module, _, name = kind.rpartition(":")
    stem = module.replace(".", "/")
    names = (module,) if module.endswith(".py") else (f"{stem}.py", f"{stem}/__init__.py")
    return next((f"{folder / file}:{name}" for file in names if (folder / file).is_file()), kind)


def load_factory(kind: str) -> Factory:
    """Return the factory that a kind names, from the current folder or an installed module.

    Raises: ValueError: one line, where there is none, or its module cannot be imported.
    """
    place, _, name = beside(kind, Path()).rpartition(":")
    if not place or not name.isidentifier():
        raise ValueError(
            f"controller: must be MODULE:NAME or FILE.py:NAME of one of your own; got {kind!r}."
        )
    if place.endswith(".py") and not Path(place).is_file():
        raise ValueError(
            f"controller: there is no file {place}. Name it relative to the current folder."
        )
    try:
        module = (
            _module_of_file(place, Path(place).stat().st_mtime_ns)
            if place.endswith(".py")
            else _installed(place)
        )
    except Exception as error:  # whatever the user's module raises
        raise ValueError(
            f"controller: {place} cannot be imported: {_PRIVATE.sub('', one_line(error))}."
        ) from error
    factory = getattr(module, name, None)
    if factory is None:
        near = difflib.get_close_matches(
            name, [n for n in vars(module) if not n.startswith("_")], n=1
        )
        raise ValueError(
            f"controller: {place} has no {name}{f'; did you mean {near[0]}' if near else ''}."
        )
    if not callable(factory):
        raise ValueError(
            f"controller: {kind} must be a class or a function; got {type(factory).__name__}."
        )
    return factory


@lru_cache
def _module_of_file(file: str, version: int) -> ModuleType:
    """Return the module of a file as of its `version`, within its package; its neighbours can be
    imported meanwhile.

    It stands in a package of its own name, so that the user's may be called like an installed one.
    """
    path = Path(file).resolve()
    key = f"own_{hashlib.md5(f'{path}{version}'.encode()).hexdigest()}"
    home = path.parent
    while (home / "__init__.py").is_file():
        home = home.parent
    around = ModuleType(key)
    around.__path__ = [str(home)]
    sys.modules[key] = around
    sys.path[:0] = added = [str(path.parent), str(home)]
    importlib.invalidate_caches()
    try:
        *folders, stem = path.relative_to(home).with_suffix("").parts
        package = importlib.import_module(".".join([key, *folders]))
        if stem == "__init__":
            return package
        name = f"{package.__name__}.{stem}"
        if name not in sys.modules:  # which the package has not imported itself
            spec = importlib.util.spec_from_file_location(name, path)
            assert spec is not None
            assert spec.loader is not None
            sys.modules[name] = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(sys.modules[name])
        return sys.modules[name]
    finally:
        for folder in added:
            sys.path.remove(folder)


def _installed(name: str) -> ModuleType:
    """Return an installed module.

    Raises: ValueError: where there is none of this name.
    """
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is None or name.split(".")[0] != error.name.split(".")[0]:
            raise
        raise ValueError(
            f"there is no {name.replace('.', '/')}.py beside the scenario or in the "
            f"current folder, and no installed "
            f"module {name}"
        ) from error


def make_own_controller(
    factory: Factory,
    parameters: Mapping[str, float],
    *,
    vehicle: Vehicle,
    reference: Reference,
    period: float,
    command: str = "u",
) -> System:
    """Return the system that a factory makes, with its ports checked.

    Args:
        period: at whose multiples the command is recorded [s].
        command: its port, u or that of an autopilot, rates_thrust.
    Raises: ValueError: one line, where it makes none, or its ports do not fit.
    """
    who = f"controller {kind_of(factory).rpartition(':')[2]}"
    if isinstance(factory, str):
        raise ValueError(
            f"controller: must be a class or function; got {factory!r}. Name it in "
            f"config.controller.kind."
        )
    if isinstance(factory, System) or not callable(factory):
        raise ValueError(
            f"{who}: must be a class or function that makes a new system each flight; got "
            f"{type(factory).__name__}. "
            "Name the class, or write lambda: Mine(…)."
        )
    offered = {"vehicle": vehicle, "reference": reference, "period": period}
    try:
        known = inspect.signature(factory).parameters.values()
    except ValueError:  # of compiled code
        known = {}.values()  # type: ignore[assignment]
    own = [
        p.name
        for p in known
        if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY) and p.name not in offered
    ]
    if not any(p.kind == p.VAR_KEYWORD for p in known) and (
        strange := sorted(set(parameters) - {*own})
    ):
        raise ValueError(
            f"{who}: has no parameter {', '.join(strange)}; it has {', '.join(own) or 'none'}."
        )
    try:
        system = factory(
            **{p.name: offered[p.name] for p in known if p.name in offered}, **parameters
        )
    except Exception as error:  # whatever the user's code raises
        raise ValueError(f"{who}: cannot be made: {one_line(error)}.") from error
    if not isinstance(system, System):
        raise ValueError(f"{who}: must make a Drake system; it made a {type(system).__name__}.")
    _check_ports(who, system, command)
    return system


def _check_ports(who: str, system: System, command: str) -> None:
    """Check names and sizes of the ports.

    Raises: ValueError: where one does not fit.
    """
    inputs = {
        p.get_name(): p.size() for p in map(system.get_input_port, range(system.num_input_ports()))
    }
    outputs = {
        p.get_name(): p.size()
        for p in map(system.get_output_port, range(system.num_output_ports()))
    }
    if command not in outputs:
        found, what = ", ".join(outputs) or "none", COMMANDS[command]
        raise ValueError(f"{who}: must have an output port {command} of 4, {what}; it has {found}.")
    for name, size in inputs.items():
        if name not in INPUTS:
            raise ValueError(f"{who}: has an input port {name}; known are {', '.join(INPUTS)}.")
        if size != INPUTS[name] and (name != "flat" or size == 0 or size % INPUTS[name]):
            sizes = f"{INPUTS[name]}{' times the points of a horizon' if name == 'flat' else ''}"
            raise ValueError(f"{who}: input port {name} must have size {sizes}; got {size}.")
    for name, size in outputs.items():
        if size != OUTPUTS.get(name, size):
            raise ValueError(
                f"{who}: output port {name} must have size {OUTPUTS[name]}; got {size}."
            )


def add_own_controller(
    builder: DiagramBuilder,
    system: System,
    vehicle: Vehicle,
    reference: Reference,
    rig: Diagram,
    *,
    label: LabelConfig,
    period: float,
    step: float,
    command: str = "u",
) -> dict[str, OutputPort]:
    """Add a controller with reference source and estimator of wrenches, and return its ports by
    signal name.

    Args:
        system: of `make_own_controller`.
        rig: has the measured `x`, `acceleration` and `rotor_speed`.
        period: at whose multiples a command that feeds through is read, and held [s].
        step: between the points of a horizon [s].
        command: its port, u or that of an autopilot, rates_thrust.
    """
    controller = builder.AddNamedSystem(SYSTEM, system)
    inputs = {
        p.get_name(): p for p in map(controller.get_input_port, range(controller.num_input_ports()))
    }
    points = inputs["flat"].size() // INPUTS["flat"] if "flat" in inputs else 1
    source = builder.AddNamedSystem(
        "reference", ReferenceSource(reference, horizon=points - 1, step=step)
    )
    estimator = builder.AddNamedSystem(
        "wrench_estimator", WrenchEstimator(vehicle, label, step=period)
    )
    u = own = controller.GetOutputPort(command)
    if controller.HasDirectFeedthrough(own.get_index()):
        hold = builder.AddNamedSystem(
            "held_command", ZeroOrderHold(period, OUTPUTS[command], _AFTER)
        )
        builder.Connect(own, hold.get_input_port())
        u = own = hold.get_output_port()
    if command == "rates_thrust":
        loop = builder.AddNamedSystem("believed_rate_loop", RateLoopTorque(vehicle))
        builder.Connect(own, loop.GetInputPort("rates_thrust"))
        builder.Connect(rig.GetOutputPort("x"), loop.GetInputPort("x"))
        u = loop.get_output_port()
    for name in ("x", "acceleration"):
        builder.Connect(rig.GetOutputPort(name), estimator.GetInputPort(name))
    builder.Connect(u, estimator.GetInputPort("u"))
    for name, port in inputs.items():
        read = {"flat": source, "label": estimator}.get(name, rig)
        builder.Connect(read.GetOutputPort("last_label" if name == "label" else name), port)
    zero = builder.AddNamedSystem("nothing_solved", ConstantVectorSource([0.0])).get_output_port()
    given = {
        name: controller.GetOutputPort(name) for name in OUTPUTS if controller.HasOutputPort(name)
    }
    more = {command: own, "u": u, "label": estimator.GetOutputPort("last_label")}
    more |= {"p_ref": source.GetOutputPort("position")}
    return {"status": zero, "solve_time": zero} | given | more
