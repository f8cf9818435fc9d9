"""Controllers by name: one MPC with different residual models, a cascade, or the user's own."""

import dataclasses as dc
from collections.abc import Callable
from typing import Any, NamedTuple

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
from diagrams.loop.reality import REAL_VEHICLE
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

Ports = dict[str, OutputPort]  # by signal name
SOLVER_SHARE = 0.5  # of the deadline, after which a solver wraps up with what it has [1]
# A command that feeds through is read just after the events of an instant and just before the
# recorder looks at it.
_AFTER = 5e-7  # [s]


def connect(builder: DiagramBuilder, source: System, target: System, *names: str) -> None:
    """Connect output ports of one system to the input ports of another that have their names."""
    for name in names:
        builder.Connect(source.GetOutputPort(name), target.GetInputPort(name))


class Loop(NamedTuple):
    """What a controller is made of.

    vehicle: that it assumes. sensors: has the measured `x`, `acceleration` and `rotor_speed`.
    """

    builder: DiagramBuilder
    config: ControllerConfig
    vehicle: Vehicle
    reference: Reference
    sensors: System

    def add(self, name: str, system: Any) -> Any:
        """Add a system by its name, and return it."""
        return self.builder.AddNamedSystem(name, system)

    def connect(self, source: System, target: System, *names: str) -> None:
        """Connect ports by their names."""
        connect(self.builder, source, target, *names)


def add_controller(
    builder: DiagramBuilder,
    config: ControllerConfig,
    vehicle: Vehicle,
    reference: Reference,
    sensors: System,
    *,
    model: ResidualModel | TrueModel | None = None,
    factory: Factory | None = None,
) -> Ports:
    """Add reference source, estimator, predictor and MPC, and return their vector ports by signal
    name.

    Args:
        vehicle: nominal vehicle.
        reference: motion to follow.
        sensors: has the measured `x`, `acceleration` and `rotor_speed`, and `in_force` where an
            autopilot tells the collective thrust and the body rates that it follows; else it
            follows those of the MPC.
        model: used in place of the one that `config` names; an oracle needs what the nominal
            vehicle leaves out, and the real one as `REAL_VEHICLE` in the diagram.
        factory: makes a controller in the place of the one that `config` names.
    Raises: ValueError: if an oracle lacks the real vehicle, or a controller of one's own does not
        fit.
    """
    loop = Loop(builder, config, config.believed(vehicle), reference, sensors)
    if factory is not None or is_own(config.kind):
        return _add_users(loop, factory or load_factory(config.kind))
    if config.kind == "cascade":
        return _add_cascade(loop)
    require(
        config.kind != "oracle" or model is not None,
        "controller: the oracle needs the real vehicle; there is none here.",
    )
    truth = model if isinstance(model, TrueModel) else None
    residual = None if isinstance(model, TrueModel) else model
    return _add_mpc(loop, residual or make_residual_model(config, loop.vehicle), truth)


def _add_mpc(loop: Loop, model: ResidualModel | None, truth: TrueModel | None) -> Ports:
    """Add the MPC with a residual model, or with the oracle where `truth` is given."""
    builder, config, believed, _, sensors = loop
    label = model.label if isinstance(model, ReadsLabels) else config.label
    source, estimator = _add_source_and_estimator(
        loop, labelled(believed, model), label, config.mpc.horizon
    )
    along_plan = truth is not None or isinstance(model, ReadsPlan)
    # A forecast along the planned inputs holds what the rotors' lag makes of them.
    planned = dc.replace(believed, rotor_time_constant=0.0) if along_plan else believed
    mpc = _add_solver(loop, planned)
    loop.connect(source, mpc, "flat")
    ports = {name: mpc.GetOutputPort(name) for name in ("u", "status", "solve_time")}
    ports["label"] = estimator.GetOutputPort("last_label")
    ports["p_ref"] = source.GetOutputPort("position")
    if config.mpc.command == "rates":
        ports["rates_thrust"] = mpc.GetOutputPort("rates_thrust")
        reports = sensors.HasOutputPort("in_force")
        followed = sensors.GetOutputPort("in_force") if reports else ports["rates_thrust"]
        ports["u"] = _add_rate_loop(loop, followed)
    acting = ports["u"]
    timing = _delay_filter(config, believed, model, truth)
    delay = None if timing is None else _add_delay(loop, timing, acting, source)
    if delay is not None:
        ports["delay"] = delay.GetOutputPort("delay")
        acting = delay.GetOutputPort("acting")
    builder.Connect(acting, estimator.GetInputPort("u"))
    predictor: System | None = None
    if truth is not None:
        predictor = _add_oracle(loop, truth, is_delayed=delay is not None)
    elif model is not None or delay is not None:
        predictor = _add_predictor(loop, model, planned if delay else None)
        loop.connect(estimator, predictor, "label")
        builder.Connect(acting, predictor.GetInputPort("u"))
        ports["chi_hat"] = predictor.GetOutputPort("chi_hat")
    if predictor is not None:
        loop.connect(predictor, mpc, "forecast")
        if along_plan:
            loop.connect(mpc, predictor, "plan_u", "plan_x")
        if delay is not None:
            loop.connect(delay, predictor, "sent", "delay")
    return ports


def _add_solver(loop: Loop, vehicle: Vehicle) -> NpMpc:
    """Add the MPC, which plans for a vehicle."""
    config = loop.config
    solver = make_solver(
        config.solver, vehicle, config.mpc, time_limit=SOLVER_SHARE * config.deadline
    )
    control = MpcController(
        vehicle, config.mpc, solver, period=config.period, deadline=config.deadline
    )
    mpc = loop.add("np_mpc", NpMpc(control))
    loop.connect(loop.sensors, mpc, "x")
    return mpc


def _add_delay(
    loop: Loop, timing: DelayFilter, command: OutputPort, source: ReferenceSource
) -> DelayEstimator:
    """Add what tells which command acts, by which the reference is looked ahead."""
    delay = loop.add("delay_estimator", DelayEstimator(timing))
    loop.connect(loop.sensors, delay, "x", "acceleration")
    loop.builder.Connect(command, delay.GetInputPort("u"))
    loop.builder.Connect(delay.GetOutputPort("delay"), source.GetInputPort("lead"))
    return delay


def _add_oracle(loop: Loop, truth: TrueModel, *, is_delayed: bool) -> System:
    """Add what knows the wrench to come.

    Args:
        is_delayed: whether commands act late, so that it needs the measured state.
    """
    config = loop.config
    oracle = loop.add("oracle", WrenchOracle(truth, config.mpc, period=config.period))
    real = loop.builder.GetSubsystemByName(REAL_VEHICLE)
    loop.connect(real, oracle, "plant_state", "rotor_thrust")
    if is_delayed:
        loop.connect(loop.sensors, oracle, "x")
    return oracle


def _add_predictor(loop: Loop, model: ResidualModel | None, vehicle: Vehicle | None) -> System:
    """Add the LeafSystem of a residual model, which is zero where there is none.

    Args:
        vehicle: that a forecast along a plan assumes; None: commands act at once.
    """
    config = loop.config
    kind: Any = NeuralPredictor if isinstance(model, LiftedLinearPredictor) else ResidualPredictor
    model = model or Constant(np.zeros(6), step=config.period, name="nominal")
    system = kind(model, horizon=config.mpc.horizon, stride=config.stride, vehicle=vehicle)
    predictor = loop.add("predictor", system)
    loop.connect(loop.sensors, predictor, "x")
    return predictor


def _delay_filter(
    config: ControllerConfig, vehicle: Vehicle, model: ResidualModel | None, truth: TrueModel | None
) -> DelayFilter | None:
    """Return what tells which command acts; None where all act at once.

    The oracle knows the delay by its `truth`. Others are given it, or have learned it (`delay` of
    the model); whoever has learned one follows it.
    """
    learned = getattr(model, "delay", None)
    known = config.command_delay
    track = config.track_delay or learned is not None
    if truth is not None:
        known = truth.delay
        track = False
    elif learned is not None:
        known = known or learned
    if known == 0.0 and not track:
        return None
    return DelayFilter(labelled(vehicle, model), step=config.period, known=known, track=track)


def _add_source_and_estimator(
    loop: Loop, vehicle: Vehicle, label: LabelConfig, horizon: int
) -> tuple[ReferenceSource, WrenchEstimator]:
    """Add the source of the reference and the estimator of wrenches, which still lacks its command.

    Args:
        vehicle: that the estimator assumes.
        horizon: MPC steps of the reference beyond now.
    """
    config = loop.config
    source = ReferenceSource(loop.reference, horizon=horizon, step=config.mpc.step)
    loop.add("reference", source)
    estimator = loop.add("wrench_estimator", WrenchEstimator(vehicle, label, step=config.period))
    loop.connect(loop.sensors, estimator, "x", "acceleration")
    return source, estimator


def _add_rate_loop(loop: Loop, rates_thrust: OutputPort) -> OutputPort:
    """Add the rate loop that the controller assumes; return thrust and torque that it commands."""
    rate_loop = loop.add("believed_rate_loop", RateLoopTorque(loop.vehicle))
    loop.builder.Connect(rates_thrust, rate_loop.GetInputPort("rates_thrust"))
    loop.connect(loop.sensors, rate_loop, "x")
    return rate_loop.get_output_port()


def _add_cascade(loop: Loop) -> Ports:
    """Add reference source and cascaded controller, which runs twice a period; nothing is solved or
    predicted.
    """
    builder, config, vehicle, reference, sensors = loop
    source = loop.add("reference", ReferenceSource(reference, horizon=0, step=config.period))
    target = loop.add("target", FlatTarget(vehicle))
    cascade = loop.add("cascade", CascadedController(vehicle, period=0.5 * config.period))
    builder.Connect(source.GetOutputPort("flat"), target.get_input_port())
    builder.Connect(target.get_output_port(), cascade.GetInputPort("target"))
    loop.connect(sensors, cascade, "x")
    return {
        **_nothing_solved(loop),
        "u": cascade.GetOutputPort("u"),
        "p_ref": source.GetOutputPort("position"),
    }


def _nothing_solved(loop: Loop) -> Ports:
    """Add status and time of a solve for a controller that has none."""
    zero = loop.add("nothing_solved", ConstantVectorSource([0.0])).get_output_port()
    return {"status": zero, "solve_time": zero}


def _add_users(loop: Loop, factory: Factory) -> Ports:
    """Add a controller of the user's own with reference source and estimator of wrenches.

    A command that feeds through is read at multiples of `config.period`, and held.
    """
    builder, config, vehicle, reference, sensors = loop
    name = "rates_thrust" if config.mpc.command == "rates" else "u"
    offered = {"vehicle": vehicle, "reference": reference, "period": config.period}
    controller = make_own_controller(factory, config.parameters, name, **offered)
    loop.add("own_controller", controller)
    inputs = [port for port in INPUTS if controller.HasInputPort(port)]
    size = controller.GetInputPort("flat").size() if "flat" in inputs else INPUTS["flat"]
    source, estimator = _add_source_and_estimator(
        loop, vehicle, config.label, size // INPUTS["flat"] - 1
    )
    command = controller.GetOutputPort(name)
    if controller.HasDirectFeedthrough(command.get_index()):
        hold = loop.add("held_command", ZeroOrderHold(config.period, OUTPUTS[name], _AFTER))
        builder.Connect(command, hold.get_input_port())
        command = hold.get_output_port()
    u = _add_rate_loop(loop, command) if name == "rates_thrust" else command
    builder.Connect(u, estimator.GetInputPort("u"))
    label = estimator.GetOutputPort("last_label")
    for port in inputs:
        measured = source if port == "flat" else sensors
        signal = label if port == "label" else measured.GetOutputPort(port)
        builder.Connect(signal, controller.GetInputPort(port))
    outputs = {n: controller.GetOutputPort(n) for n in OUTPUTS if controller.HasOutputPort(n)}
    return {
        **_nothing_solved(loop),
        **outputs,
        name: command,
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
    predictor = LiftedLinearPredictor.of(load_model(config.predictor or NP_MODEL))
    _require_fit(predictor.model, predictor.step, config, vehicle, predictor.label)
    return predictor


def _payload_filter(config: ControllerConfig, vehicle: Vehicle) -> PayloadFilter:
    """Return the filter with the lag of the vehicle file, as its labels have it, or that of its
    training.
    """
    predictor = PayloadFilter.load(config.predictor or FILTER_MODEL)
    _require_fit(predictor.model, predictor.step, config, vehicle, predictor.label)
    lag = vehicle.rotor_time_constant or predictor.rotor_lag
    return PayloadFilter(dc.replace(predictor.model, rotor_lag=lag))


def _motion_model(config: ControllerConfig, vehicle: Vehicle) -> motion_model.MotionModel:
    model = motion_model.MotionModel.load(config.predictor)
    _require_fit(model, model.step, config, vehicle, config.label)
    return model


MAKERS: dict[str, Callable[[ControllerConfig, Vehicle], ResidualModel]] = {
    "hold": _hold,
    "observer": _observer,
    "np": _neural_predictor,
    PAYLOAD_FILTER: _payload_filter,
    **dict.fromkeys(motion_model.REACTIONS, _motion_model),
}  # makers of residual models by kind of controller


def _require_fit(
    model: Trained, step: float, config: ControllerConfig, vehicle: Vehicle, label: LabelConfig
) -> None:
    """Check that the model was trained for world axes, these labels and the steps of config.

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
    require_origin(model, origin_of("world", vehicle, label))
    require(
        abs(step - config.period) <= 1e-9,
        f"controller: the predictor's step must equal the period; got {step}, "
        f"{config.period} [s]. Train it with --step {config.period:g}.",
    )
