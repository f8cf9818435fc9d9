"""Trains the Neural Predictor on one flight and scores it on another.

Shows: training segments from a flight log, `train`, the three matrices of the lifted linear system,
and its forecast error against holding the last label. `np-drake train` and `np-drake evaluate` do
the same on files.
"""

from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight_result import fly
from np_drake.lifting.training.train import make_config, train
from np_drake.residual_model import ResidualModel
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.skill.skill import skill_table
from np_drake.training_data.segments import Segment, training_segments

HORIZONS = [5, 20, 40]  # steps of 0.02 s


def flight(name: str, duration: float, seed: int) -> Segment:
    """The labels and the motion of a simulated flight with nominal MPC."""
    config = load_experiment(name)
    config.controller.solver, config.duration = "sqp", duration
    result = fly(config, seed=seed)
    (segment,) = training_segments(result.log(), config.vehicle)
    return segment


def main() -> None:
    """Trains on 10 s of a dithered circle, prints the force error on a lemniscate that it was not
    trained on.
    """
    learned, unseen = flight("training_circle", 10.0, seed=0), flight("lemniscate", 4.0, seed=1)
    model = train([learned], make_config("lifted", seed=0)).model
    A, B, C = model.system.A, model.system.B, model.system.C
    print(
        f"lifted linear system: A {A.shape}, B {B.shape}, C {C.shape}, "
        f"{model.summary['samples']} samples"
    )
    models: dict[str, ResidualModel] = {"np": NeuralPredictor(model)}
    mean = learned.goal.mean(axis=0)
    table = skill_table(
        models, unseen.chi, unseen.zeta, horizons=HORIZONS, mean=mean, target=unseen.goal
    )
    for row in table:
        if row["model"] in ("persistence", "np"):
            print(
                f"{row['model']:12} {row['horizon'] * learned.step:.1f} s ahead: force RMSE "
                f"{row['force_rmse']:.3f} N"
            )


if __name__ == "__main__":
    main()
