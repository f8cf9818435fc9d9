"""Workloads of the benchmark: recorded MPC problems, predictor, simulator, training."""

import dataclasses as dc
import time
from pathlib import Path

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator

from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_diagram import make_flight_diagram, make_simulator
from diagrams.tracking.tracking import training_flight
from np_drake.lifting.model.model_file import save_model
from np_drake.lifting.training.train import make_config
from np_drake.mpc.problem import MpcProblem, MpcSolution, MpcSolver
from np_drake.residual_model import Sample
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.residual_models.predictor_training import train_on_flights
from np_drake.training_data.training_segments import Flight
from systems.initial_state import set_hover
from systems.tethered_quadrotor import make_tethered_quadrotor


class RecordingSolver:
    """Solver that passes problems on to another one and keeps them."""

    def __init__(self, solver: MpcSolver):
        self.name, self._solver = solver.name, solver
        self.problems: list[MpcProblem] = []

    def solve(self, problem: MpcProblem, warm_start: MpcSolution | None = None) -> MpcSolution:
        """Keep the problem and return the wrapped solver's solution.

        Args:
            warm_start: an earlier plan, shifted to now; None: there is none.
        """
        self.problems.append(problem)
        return self._solver.solve(problem, warm_start)


def record_problems(
    count: int, *, seed: int, predictor: str = ""
) -> tuple[FlightConfig, list[MpcProblem]]:
    """Return the NP-MPC problems of `count` periods in a row on the lemniscate, from the end of the
    ramp on.

    Args:
        predictor: model file; the one that ships with the package by default.
    """
    config = load_experiment("lemniscate")
    config.controller.kind, config.controller.solver, config.controller.predictor = (
        "np",
        "sqp",
        predictor,
    )
    config.duration = count * config.controller.period
    simulator = make_simulator(make_flight_diagram(config), config, seed=seed)
    controller = simulator.get_system().GetSubsystemByName("np_mpc").controller
    controller.solver = recorder = RecordingSolver(controller.solver)
    simulator.AdvanceTo(config.end - 0.5 * config.controller.period)
    return config, recorder.problems[-count:]


def time_predictor(
    model: NeuralPredictor, *, horizon: int, stride: int, repeats: int = 500
) -> dict[str, float]:
    """Return median and p95 of one sample: lift, refit where there is one, and forecast [ms].

    Args:
        horizon: steps of the MPC [1].
        stride: steps of the predictor in one of them [1].
    """
    rng, memory, spent = np.random.default_rng(0), model.initial_memory(), []
    for _ in range(repeats + model.model.window):
        x = np.concatenate([np.zeros(3), [1.0, 0, 0, 0], rng.normal(size=6)])
        sample = Sample(x, np.zeros(4), rng.normal(size=6))
        start = time.perf_counter()
        memory = model.update(memory, sample)
        model.forecast(memory, horizon=horizon, stride=stride)
        spent.append(1e3 * (time.perf_counter() - start))
    tail = spent[-repeats:]
    return {"median": float(np.median(tail)), "p95": float(np.quantile(tail, 0.95))}


def real_time_factors(*, seconds: float, seed: int) -> dict[str, float]:
    """Return simulated over wall time of three simulations [1].

    They are the bare cable plant, the plant with every effect, and with NP-MPC (SQP) in the loop.

    Args:
        seconds: simulated time of each [s].
    """
    config = load_experiment("circle")
    bare = dc.replace(
        config, reality=dc.replace(config.reality, rotor_drag=0.0, motor_lag=0.0, thrust_scale=1.0)
    )
    config.controller.kind, config.controller.solver = "np", "sqp"
    config.duration = max(seconds / 4, 1.0)
    return {
        "plant": _plant_factor(bare, seconds),
        "plant_with_effects": _plant_factor(config, seconds),
        "closed_loop": _closed_loop_factor(config, seed),
    }


def _closed_loop_factor(config: FlightConfig, seed: int) -> float:
    """Return the factor of the scored part, by which time every compiled loop is loaded."""
    simulator = make_simulator(make_flight_diagram(config), config, seed=seed)
    simulator.AdvanceTo(config.reference.lead)
    start = time.perf_counter()
    simulator.AdvanceTo(config.end)
    return config.duration / (time.perf_counter() - start)


def _plant_factor(config: FlightConfig, seconds: float) -> float:
    reality = config.reality
    vehicle = make_tethered_quadrotor(
        config.vehicle,
        reality.payload,
        wrench_effects=reality.wrench_effects(),
        actuator_effects=reality.actuator_effects(),
    )
    simulator = Simulator(vehicle)
    ApplySimulatorConfig(config.simulator, simulator)
    context = simulator.get_mutable_context()
    weight = (config.vehicle.mass + reality.payload.mass) * config.vehicle.gravity
    vehicle.GetInputPort("u").FixValue(context, [weight, 0.0, 0.0, 0.0])
    plant = vehicle.GetSubsystemByName("plant")
    set_hover(plant, plant.GetMyMutableContextFromRoot(context), reality.payload, [0, 0, 2])
    simulator.Initialize()
    start = time.perf_counter()
    simulator.AdvanceTo(seconds)
    return seconds / (time.perf_counter() - start)


def time_training(folder: Path, *, seed: int) -> dict[str, float]:
    """Return the wall time of both configurations on the 3000 points of one training flight [s]."""
    flight = training_flight("training_circle", seed=seed, solver="sqp")
    walls = {}
    for configuration in ("lifted", "paper"):
        start = time.perf_counter()
        config, loop = make_config(configuration, seed=seed), flight.config.controller
        learnt = train_on_flights(
            [Flight(flight.log(), flight.config.vehicle)],
            config,
            step=loop.period,
            label=loop.label,
        )
        save_model(learnt.model, model_file(folder, configuration))
        walls[configuration] = time.perf_counter() - start
    return walls


def model_file(folder: Path, configuration: str) -> Path:
    """Return the path of a model of `time_training`.

    Args:
        folder: as of `time_training`.
    """
    return folder / f"{configuration}.safetensors"
