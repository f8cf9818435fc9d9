"""Controllers by name: one MPC with different residual models."""

import numpy as np
from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import ConstantVectorSource

from diagrams.loop.controller_config import ControllerConfig
from diagrams.loop.controller_models import make_residual_model
from diagrams.loop.own_controller import (
    Factory,
    add_own_controller,
    is_own,
    load_factory,
    make_own_controller,
)
from np_drake.command_delay import DelayFilter
from np_drake.labels import ReadsLabels, labelled
from np_drake.mpc.controller import MpcController
from np_drake.mpc.solvers import make_solver
from np_drake.references.base import Reference
from np_drake.residual_model import KnowsDelay, ReadsPlan, ResidualModel
from np_drake.residual_models.hold import Constant
from np_drake.residual_models.neural_predictor import NeuralPredictor as NeuralPredictorModel
from np_drake.residual_models.oracle import TrueModel
from np_drake.vehicle import Vehicle
from systems.cascaded_controller import CascadedController, FlatTarget
from systems.delay_estimator import DelayEstimator
from systems.neural_predictor import NeuralPredictor
from systems.np_mpc import NpMpc
from systems.rate_loop import RateLoopTorque
from systems.reference_source import ReferenceSource
from systems.residual_predictor import ResidualPredictor
from systems.wrench_estimator import WrenchEstimator
from systems.wrench_oracle import WrenchOracle

SOLVER_SHARE = 0.5  # of the deadline, after which a solver wraps up with what it has [1]


def add_controller(
    builder: DiagramBuilder,
    config: ControllerConfig,
    vehicle: Vehicle,
    reference: Reference,
    rig: Diagram,
    *,
    truth: Diagram | None = None,
    true_model: TrueModel | None = None,
    model: ResidualModel | None = None,
    factory: Factory | None = None,
    in_force: OutputPort | None = None,
) -> dict[str, OutputPort]:
    """Add reference source, estimator, predictor and MPC, and return their vector ports by signal
    name.

    Args:
        builder: of the flight's Diagram.
        config: of the controller.
        vehicle: nominal vehicle.
        reference: motion to follow.
        rig: has the measured `x` and `acceleration`.
        truth: the real vehicle; for the oracle alone.
        true_model: what the nominal vehicle leaves out; likewise.
        model: used in place of the one that `config` names.
        factory: makes a controller in the place of the one that `config` names.
        in_force: collective thrust and body rates that an autopilot follows; None: those of the
            MPC.
    Raises: ValueError: if an oracle lacks the real vehicle, or a controller of one's own does not
        fit.
    """
    believed = config.believed(vehicle)
    if factory is not None or is_own(config.kind):
        command = "rates_thrust" if config.mpc.command == "rates" else "u"
        system = make_own_controller(
            factory or load_factory(config.kind),
            config.parameters,
            vehicle=believed,
            reference=reference,
            period=config.period,
            command=command,
        )
        times = {"period": config.period, "step": config.mpc.step}
        return add_own_controller(
            builder, system, believed, reference, rig, label=config.label, command=command, **times
        )
    if config.kind == "cascade":
        return _add_cascade(builder, believed, reference, rig, period=config.period)
    N, period = config.mpc.horizon, config.period
    model = model or make_residual_model(config, believed)
    source = builder.AddNamedSystem(
        "reference", ReferenceSource(reference, horizon=N, step=config.mpc.step)
    )
    label = model.label if isinstance(model, ReadsLabels) else config.label
    estimator = builder.AddNamedSystem(
        "wrench_estimator", WrenchEstimator(labelled(believed, model), label, step=period)
    )
    solver = make_solver(
        config.solver, believed, config.mpc, time_limit=SOLVER_SHARE * config.deadline
    )
    mpc = builder.AddNamedSystem(
        "np_mpc",
        NpMpc(MpcController(believed, config.mpc, solver, period=period, deadline=config.deadline)),
    )
    builder.Connect(rig.GetOutputPort("x"), mpc.GetInputPort("x"))
    builder.Connect(source.GetOutputPort("flat"), mpc.GetInputPort("flat"))
    u, rates_thrust = mpc.GetOutputPort("u"), mpc.GetOutputPort("rates_thrust")
    if config.mpc.command == "rates":
        loop = builder.AddNamedSystem("believed_rate_loop", RateLoopTorque(believed))
        builder.Connect(in_force or rates_thrust, loop.GetInputPort("rates_thrust"))
        builder.Connect(rig.GetOutputPort("x"), loop.GetInputPort("x"))
        u = loop.get_output_port()
    builder.Connect(rig.GetOutputPort("x"), estimator.GetInputPort("x"))
    builder.Connect(rig.GetOutputPort("acceleration"), estimator.GetInputPort("acceleration"))
    ports = {"u": u, "label": estimator.GetOutputPort("last_label")}
    timing = delay_filter(config, believed, model, true_model)
    delay = None if timing is None else _add_delay_estimator(builder, timing, rig, u, source)
    acting = u if delay is None else delay.GetOutputPort("acting")
    if delay is not None:
        ports["delay"] = delay.GetOutputPort("delay")
    builder.Connect(acting, estimator.GetInputPort("u"))
    if config.kind == "oracle" and model is None:
        if truth is None or true_model is None:
            raise ValueError("controller: the oracle needs the real vehicle; there is none here.")
        oracle = _add_oracle(builder, true_model, config, truth, mpc)
        _connect_delay(builder, delay, oracle, rig)
    elif model is not None or delay is not None:
        model = model or Constant(np.zeros(6), step=period, name="nominal")
        system = _make_predictor(model, config, believed if delay else None)
        predictor = _add_predictor(
            builder, system, model, acting, rig=rig, estimator=estimator, mpc=mpc
        )
        _connect_delay(builder, delay, predictor)
        ports["chi_hat"] = predictor.GetOutputPort("chi_hat")
    ports |= {name: mpc.GetOutputPort(name) for name in ("status", "solve_time")}
    if config.mpc.command == "rates":
        ports["rates_thrust"] = rates_thrust
    ports["p_ref"] = source.GetOutputPort("position")
    return ports


def _add_cascade(
    builder: DiagramBuilder, vehicle: Vehicle, reference: Reference, rig, *, period: float
) -> dict[str, OutputPort]:
    """Add reference source and cascaded controller, which runs twice a `period` [s]; nothing is
    solved or predicted.
    """
    source = builder.AddNamedSystem("reference", ReferenceSource(reference, horizon=0, step=period))
    target = builder.AddNamedSystem("target", FlatTarget(vehicle))
    cascade = builder.AddNamedSystem("cascade", CascadedController(vehicle, period=0.5 * period))
    builder.Connect(source.GetOutputPort("flat"), target.get_input_port())
    builder.Connect(target.get_output_port(), cascade.GetInputPort("target"))
    builder.Connect(rig.GetOutputPort("x"), cascade.GetInputPort("x"))
    zero = builder.AddNamedSystem("nothing_solved", ConstantVectorSource([0.0])).get_output_port()
    ports = {"u": cascade.GetOutputPort("u"), "status": zero, "solve_time": zero}
    return {**ports, "p_ref": source.GetOutputPort("position")}


def delay_filter(
    config: ControllerConfig,
    vehicle: Vehicle,
    model: ResidualModel | None,
    true_model: TrueModel | None,
) -> DelayFilter | None:
    """Return what tells which command acts; None where all act at once.

    The oracle knows the delay. Others are given it, or have learned it; whoever has learned one
    follows it.

    Args:
        config: of the controller.
        vehicle: that it assumes.
        model: its residual model.
        true_model: all that acts on the real vehicle; for the oracle alone.
    """
    lagged = labelled(vehicle, model)
    if config.kind == "oracle" and model is None:
        known = true_model.delay if true_model is not None else 0.0
        return (
            DelayFilter(lagged, step=config.period, known=known, track=False) if known > 0 else None
        )
    learns = isinstance(model, KnowsDelay)
    known = config.command_delay or (model.delay if isinstance(model, KnowsDelay) else 0.0)
    if known == 0.0 and not (config.track_delay or learns):
        return None
    return DelayFilter(lagged, step=config.period, known=known, track=config.track_delay or learns)


def _add_delay_estimator(
    builder, timing: DelayFilter, rig, u: OutputPort, source
) -> DelayEstimator:
    """Add the estimator of the delay between sensors, controller and reference."""
    system = builder.AddNamedSystem("delay_estimator", DelayEstimator(timing))
    for name in ("x", "acceleration"):
        builder.Connect(rig.GetOutputPort(name), system.GetInputPort(name))
    builder.Connect(u, system.GetInputPort("u"))
    builder.Connect(system.GetOutputPort("delay"), source.GetInputPort("lead"))
    return system


def _connect_delay(builder, delay: DelayEstimator | None, system, rig=None) -> None:
    """Tell `system` which commands are on their way, and the measured state where a rig is
    given.
    """
    if delay is None:
        return
    for name in ("sent", "delay"):
        builder.Connect(delay.GetOutputPort(name), system.GetInputPort(name))
    if rig is not None:
        builder.Connect(rig.GetOutputPort("x"), system.GetInputPort("x"))


def _make_predictor(
    model: ResidualModel, config: ControllerConfig, vehicle: Vehicle | None
) -> ResidualPredictor:
    """Return the LeafSystem of a model; see it for `vehicle`."""
    horizon, stride = config.mpc.horizon, config.stride
    if isinstance(model, NeuralPredictorModel):
        return NeuralPredictor(model, horizon=horizon, stride=stride, vehicle=vehicle)
    return ResidualPredictor(model, horizon=horizon, stride=stride, vehicle=vehicle)


def _add_predictor(
    builder,
    system: ResidualPredictor,
    model: ResidualModel,
    acting: OutputPort,
    *,
    rig,
    estimator,
    mpc,
) -> ResidualPredictor:
    """Add the residual model between estimator and MPC."""
    predictor = builder.AddNamedSystem("predictor", system)
    builder.Connect(rig.GetOutputPort("x"), predictor.GetInputPort("x"))
    builder.Connect(acting, predictor.GetInputPort("u"))
    builder.Connect(estimator.GetOutputPort("label"), predictor.GetInputPort("label"))
    if isinstance(model, ReadsPlan):
        _connect_plan(builder, mpc, predictor)
    builder.Connect(predictor.GetOutputPort("forecast"), mpc.GetInputPort("forecast"))
    return predictor


def _add_oracle(
    builder, model: TrueModel, config: ControllerConfig, truth: Diagram, mpc
) -> WrenchOracle:
    """Add the oracle between the real vehicle and the MPC."""
    oracle = builder.AddNamedSystem("oracle", WrenchOracle(model, config.mpc, period=config.period))
    for name in ("plant_state", "rotor_thrust"):
        builder.Connect(truth.GetOutputPort(name), oracle.GetInputPort(name))
    _connect_plan(builder, mpc, oracle)
    builder.Connect(oracle.GetOutputPort("forecast"), mpc.GetInputPort("forecast"))
    return oracle


def _connect_plan(builder, mpc, system) -> None:
    for name in ("plan_u", "plan_x"):
        builder.Connect(mpc.GetOutputPort(name), system.GetInputPort(name))
