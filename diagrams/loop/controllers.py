"""Controllers by name: one MPC with different residual models, a cascade, or the user's own."""

import dataclasses as dc
from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import ConstantVectorSource, ZeroOrderHold

from diagrams.batch.run import require
from diagrams.loop.controller_config import FILTER_MODEL, NP_MODEL, ControllerConfig
from diagrams.loop.own_controller import (
    INPUTS,
    OUTPUTS,
    Factory,
    is_own,
    load_factory,
    make_own_controller,
)
from np_drake.command_delay import DelayFilter
from np_drake.labels import LabelConfig, ReadsLabels, labelled
from np_drake.lifting.model.lifted_model import load_model
from np_drake.mpc.controller import MpcController
from np_drake.mpc.solvers import make_solver
from np_drake.payload_filter.model_file import PAYLOAD_FILTER, SCHEMA
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.references.base import Reference
from np_drake.residual_model import ReadsPlan, ResidualModel
from np_drake.residual_models import motion_model
from np_drake.residual_models.hold import Constant, DisturbanceObserver, Hold
from np_drake.residual_models.lifted_predictor import LiftedLinearPredictor
from np_drake.residual_models.oracle import TrueModel
from np_drake.trained_model import Trained, origin_of, require_origin, schema_of
from np_drake.vehicle import Vehicle
from np_drake.vehicle.scaling import ratios
from systems import NeuralPredictor, NpMpc, ReferenceSource, WrenchEstimator
from systems.cascaded_controller import CascadedController, FlatTarget
from systems.delay_estimator import DelayEstimator
from systems.rate_loop import RateLoopTorque
from systems.residual_predictor import ResidualPredictor
from systems.wrench_oracle import WrenchOracle

SOLVER_SHARE = 0.5  # of the deadline, after which a solver wraps up with what it has [1]
# A command that feeds through is read just after the events of an instant and just before the
# recorder looks at it.
_AFTER = 5e-7  # [s]


def connect(builder: DiagramBuilder, source: System, target: System, *names: str) -> None:
    """Connect output ports of one system to the input ports of another that have their names."""
    for name in names:
        builder.Connect(source.GetOutputPort(name), target.GetInputPort(name))


def add_controller(
    builder: DiagramBuilder,
    config: ControllerConfig,
    vehicle: Vehicle,
    reference: Reference,
    rig: System,
    *,
    truth: tuple[System, TrueModel] | None = None,
    model: ResidualModel | None = None,
    factory: Factory | None = None,
    in_force: OutputPort | None = None,
) -> dict[str, OutputPort]:
    """Add reference source, estimator, predictor and MPC, and return their vector ports by signal
    name.

    Args:
        vehicle: nominal vehicle.
        reference: motion to follow.
        rig: has the measured `x`, `acceleration` and `rotor_speed`.
        truth: for the oracle alone, the real vehicle and what the nominal one leaves out.
        model: used in place of the one that `config` names.
        factory: makes a controller in the place of the one that `config` names.
        in_force: collective thrust and body rates that an autopilot follows; None: those of the
            MPC.
    Raises: ValueError: if an oracle lacks the real vehicle, or a controller of one's own does not
        fit.
    """
    believed = config.believed(vehicle)
    if factory is not None or is_own(config.kind):
        return _add_own(
            builder, factory or load_factory(config.kind), config, believed, reference, rig
        )
    if config.kind == "cascade":
        return _add_cascade(builder, believed, reference, rig, period=config.period)
    period = config.period
    rates = config.mpc.command == "rates"
    model = model or make_residual_model(config, believed)
    label = model.label if isinstance(model, ReadsLabels) else config.label
    source, estimator = _add_source_and_estimator(
        builder, config, labelled(believed, model), reference, rig, label, config.mpc.horizon
    )
    is_oracle = config.kind == "oracle" and model is None
    along_plan = is_oracle or isinstance(model, ReadsPlan)
    # A forecast along the planned inputs holds what the rotors' lag makes of them.
    planned = dc.replace(believed, rotor_time_constant=0.0) if along_plan else believed
    solver = make_solver(
        config.solver, planned, config.mpc, time_limit=SOLVER_SHARE * config.deadline
    )
    control = MpcController(planned, config.mpc, solver, period=period, deadline=config.deadline)
    mpc = builder.AddNamedSystem("np_mpc", NpMpc(control))
    connect(builder, rig, mpc, "x")
    connect(builder, source, mpc, "flat")
    ports = {name: mpc.GetOutputPort(name) for name in ("u", "status", "solve_time")}
    ports |= {
        "label": estimator.GetOutputPort("last_label"),
        "p_ref": source.GetOutputPort("position"),
    }
    if rates:
        ports["rates_thrust"] = mpc.GetOutputPort("rates_thrust")
        ports["u"] = _add_rate_loop(builder, believed, rig, in_force or ports["rates_thrust"])
    acting = ports["u"]
    timing = _delay_filter(config, believed, model, truth[1] if is_oracle and truth else None)
    delay = None
    if timing is not None:
        delay = builder.AddNamedSystem("delay_estimator", DelayEstimator(timing))
        connect(builder, rig, delay, "x", "acceleration")
        builder.Connect(acting, delay.GetInputPort("u"))
        ports["delay"], acting = delay.GetOutputPort("delay"), delay.GetOutputPort("acting")
        builder.Connect(ports["delay"], source.GetInputPort("lead"))
    builder.Connect(acting, estimator.GetInputPort("u"))
    predictor: System | None = None
    if is_oracle:
        predictor = _add_oracle(builder, config, truth, rig, is_delayed=delay is not None)
    elif model is not None or delay is not None:
        model = model or Constant(np.zeros(6), step=period, name="nominal")
        predictor = _add_predictor(builder, config, model, planned if delay else None)
        connect(builder, rig, predictor, "x")
        connect(builder, estimator, predictor, "label")
        builder.Connect(acting, predictor.GetInputPort("u"))
        ports["chi_hat"] = predictor.GetOutputPort("chi_hat")
    if predictor is not None:
        connect(builder, predictor, mpc, "forecast")
        if along_plan:
            connect(builder, mpc, predictor, "plan_u", "plan_x")
        if delay is not None:
            connect(builder, delay, predictor, "sent", "delay")
    return ports


def _add_oracle(
    builder: DiagramBuilder,
    config: ControllerConfig,
    truth: tuple[System, TrueModel] | None,
    rig: System,
    *,
    is_delayed: bool,
) -> System:
    """Add what knows the wrench to come.

    Args:
        is_delayed: whether commands act late, so that it needs the measured state.
    Raises: ValueError: without the real vehicle.
    """
    if truth is None:
        raise ValueError("controller: the oracle needs the real vehicle; there is none here.")
    oracle = WrenchOracle(truth[1], config.mpc, period=config.period)
    builder.AddNamedSystem("oracle", oracle)
    connect(builder, truth[0], oracle, "plant_state", "rotor_thrust")
    if is_delayed:
        connect(builder, rig, oracle, "x")
    return oracle


def _add_predictor(
    builder: DiagramBuilder, config: ControllerConfig, model: ResidualModel, vehicle: Vehicle | None
) -> System:
    """Add the LeafSystem of a residual model.

    Args:
        vehicle: that a forecast along a plan assumes; None: commands act at once.
    """
    kind: Any = NeuralPredictor if isinstance(model, LiftedLinearPredictor) else ResidualPredictor
    predictor = kind(model, horizon=config.mpc.horizon, stride=config.stride, vehicle=vehicle)
    return builder.AddNamedSystem("predictor", predictor)


def _delay_filter(
    config: ControllerConfig, vehicle: Vehicle, model: ResidualModel | None, truth: TrueModel | None
) -> DelayFilter | None:
    """Return what tells which command acts; None where all act at once.

    The oracle knows the delay by its `truth`. Others are given it, or have learned it (`delay` of
    the model); whoever has learned one follows it.
    """
    own = getattr(model, "delay", None)
    known = config.command_delay
    track = config.track_delay or own is not None
    if config.kind == "oracle" and model is None:
        known = truth.delay if truth is not None else 0.0
        track = False
    elif own is not None:
        known = known or own
    if known == 0.0 and not track:
        return None
    return DelayFilter(labelled(vehicle, model), step=config.period, known=known, track=track)


def _add_source_and_estimator(
    builder: DiagramBuilder,
    config: ControllerConfig,
    vehicle: Vehicle,
    reference: Reference,
    rig: System,
    label: LabelConfig,
    horizon: int,
) -> tuple[ReferenceSource, WrenchEstimator]:
    """Add the source of the reference and the estimator of wrenches, which still lacks its command.

    Args:
        vehicle: that the estimator assumes.
        horizon: MPC steps of the reference beyond now.
    """
    source = ReferenceSource(reference, horizon=horizon, step=config.mpc.step)
    estimator = WrenchEstimator(vehicle, label, step=config.period)
    builder.AddNamedSystem("reference", source)
    builder.AddNamedSystem("wrench_estimator", estimator)
    connect(builder, rig, estimator, "x", "acceleration")
    return source, estimator


def _add_rate_loop(
    builder: DiagramBuilder, vehicle: Vehicle, rig: System, rates_thrust: OutputPort
) -> OutputPort:
    """Add the rate loop that the controller assumes; return thrust and torque that it commands."""
    loop = builder.AddNamedSystem("believed_rate_loop", RateLoopTorque(vehicle))
    builder.Connect(rates_thrust, loop.GetInputPort("rates_thrust"))
    connect(builder, rig, loop, "x")
    return loop.get_output_port()


def _add_cascade(
    builder: DiagramBuilder, vehicle: Vehicle, reference: Reference, rig: System, *, period: float
) -> dict[str, OutputPort]:
    """Add reference source and cascaded controller, which runs twice a `period` [s]; nothing is
    solved or predicted.
    """
    source = builder.AddNamedSystem("reference", ReferenceSource(reference, horizon=0, step=period))
    target = builder.AddNamedSystem("target", FlatTarget(vehicle))
    cascade = builder.AddNamedSystem("cascade", CascadedController(vehicle, period=0.5 * period))
    builder.Connect(source.GetOutputPort("flat"), target.get_input_port())
    builder.Connect(target.get_output_port(), cascade.GetInputPort("target"))
    connect(builder, rig, cascade, "x")
    zero = builder.AddNamedSystem("nothing_solved", ConstantVectorSource([0.0])).get_output_port()
    ports = {"u": cascade.GetOutputPort("u"), "status": zero, "solve_time": zero}
    return {**ports, "p_ref": source.GetOutputPort("position")}


def _add_own(
    builder: DiagramBuilder,
    factory: Factory,
    config: ControllerConfig,
    vehicle: Vehicle,
    reference: Reference,
    rig: System,
) -> dict[str, OutputPort]:
    """Add a controller of the user's own with reference source and estimator of wrenches.

    A command that feeds through is read at multiples of `config.period`, and held.
    """
    command = "rates_thrust" if config.mpc.command == "rates" else "u"
    offered = {"vehicle": vehicle, "reference": reference, "period": config.period}
    controller = make_own_controller(factory, config.parameters, command, **offered)
    builder.AddNamedSystem("own_controller", controller)
    inputs = [name for name in INPUTS if controller.HasInputPort(name)]
    size = controller.GetInputPort("flat").size() if "flat" in inputs else INPUTS["flat"]
    source, estimator = _add_source_and_estimator(
        builder, config, vehicle, reference, rig, config.label, size // INPUTS["flat"] - 1
    )
    u = own = controller.GetOutputPort(command)
    if controller.HasDirectFeedthrough(own.get_index()):
        hold = ZeroOrderHold(config.period, OUTPUTS[command], _AFTER)
        builder.AddNamedSystem("held_command", hold)
        builder.Connect(own, hold.get_input_port())
        u = own = hold.get_output_port()
    if command == "rates_thrust":
        u = _add_rate_loop(builder, vehicle, rig, own)
    builder.Connect(u, estimator.GetInputPort("u"))
    label = estimator.GetOutputPort("last_label")
    for name in inputs:
        read = source if name == "flat" else rig
        port = label if name == "label" else read.GetOutputPort(name)
        builder.Connect(port, controller.GetInputPort(name))
    zero = builder.AddNamedSystem("nothing_solved", ConstantVectorSource([0.0])).get_output_port()
    given = {n: controller.GetOutputPort(n) for n in OUTPUTS if controller.HasOutputPort(n)}
    return {
        "status": zero,
        "solve_time": zero,
        **given,
        command: own,
        "u": u,
        "label": label,
        "p_ref": source.GetOutputPort("position"),
    }


def make_residual_model(config: ControllerConfig, vehicle: Vehicle) -> ResidualModel | None:
    """Return the residual model of a controller; None for nominal, cascade, and the oracle, which
    is no model.

    Raises: ValueError: where its model file is broken, does not fit or is for another kind.
    """
    if config.predictor:
        kind = kind_of_model(config.predictor)
        require(
            config.kind == kind,
            f"controller: {config.predictor} is for {kind}; {config.kind} cannot fly it. Name "
            f"--controller {kind}.",
        )
    make = MAKERS.get(config.kind)
    return None if make is None else make(config, vehicle)


def kind_of_model(path: str) -> str:
    """Return the kind of controller that flies a model file.

    Raises: ValueError: where it is no such file.
    """
    schema = schema_of(path)
    if schema == motion_model.SCHEMA:
        return motion_model.MotionModel.load(path).name
    if schema == SCHEMA:
        return PAYLOAD_FILTER
    load_model(path)
    return "np"


def _hold(config: ControllerConfig, vehicle: Vehicle) -> Hold:
    return Hold(step=config.period)


def _observer(config: ControllerConfig, vehicle: Vehicle) -> DisturbanceObserver:
    unit = ratios(vehicle).clock
    return DisturbanceObserver(
        vehicle, step=config.period, force_bandwidth=5.0 / unit, torque_bandwidth=1.0 / unit
    )


def _neural_predictor(config: ControllerConfig, vehicle: Vehicle) -> LiftedLinearPredictor:
    found = LiftedLinearPredictor.of(load_model(config.predictor or NP_MODEL))
    _require_fit(found.model, found.step, config, vehicle, found.label)
    return found


def _payload_filter(config: ControllerConfig, vehicle: Vehicle) -> PayloadFilter:
    """Return the filter with the lag of the vehicle file, as its labels have it, or that of its
    training.
    """
    found = PayloadFilter.load(config.predictor or FILTER_MODEL)
    _require_fit(found.model, found.step, config, vehicle, found.label)
    lag = vehicle.rotor_time_constant or found.rotor_lag
    return PayloadFilter(dc.replace(found.model, rotor_lag=lag))


def _motion_model(config: ControllerConfig, vehicle: Vehicle) -> motion_model.MotionModel:
    model = motion_model.MotionModel.load(config.predictor)
    _require_fit(model, model.step, config, vehicle)
    return model


MAKERS: dict[str, Callable[[ControllerConfig, Vehicle], ResidualModel]] = {
    "hold": _hold,
    "observer": _observer,
    "np": _neural_predictor,
    PAYLOAD_FILTER: _payload_filter,
    **dict.fromkeys(motion_model.REACTIONS, _motion_model),
}  # makers of residual models by kind of controller


def _require_fit(
    model: Trained,
    step: float,
    config: ControllerConfig,
    vehicle: Vehicle,
    label: LabelConfig | None = None,
) -> None:
    """Check that the model was trained for world axes, labels (default: those of config) and steps.

    In body axes its zeta would be R^T v, which is not linear in the predicted state: the lifted
    linear system could not be eliminated exactly.
    Raises: ValueError: if it was not.
    """
    frame = model.summary.get("origin", {}).get("frame", "world")
    require(
        frame == "world",
        f"controller: the predictor must be trained on wrenches in world axes; its are "
        f"in {frame} axes. Train it on a flight log.",
    )
    require_origin(model, origin_of("world", vehicle, label or config.label))
    require(
        abs(step - config.period) <= 1e-9,
        f"controller: the predictor's step must equal the period; got {step}, "
        f"{config.period} [s]. Train it with --step {config.period:g}.",
    )
