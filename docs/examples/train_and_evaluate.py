"""Trains the Neural Predictor on one flight and scores it on another.

Shows: a vehicle learnt from a flight log, on top of the packaged model; the three matrices of the
lifted linear system; and its forecast error against holding the last label. `np-drake train` and
`np-drake evaluate` do the same on files.
"""

from diagrams.loop.controller_config import NP_MODEL
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight_result import fly
from np_drake.payload_filter.model_file import PayloadFilterModel
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.payload_filter.training import opened_logs, train_payload_filter
from np_drake.skill.skill import score_flights
from np_drake.training_data.segments import Flight

HORIZONS = [5, 20, 40]  # steps of 0.02 s


def flight(name: str, duration: float, seed: int) -> Flight:
    """Log and vehicle of a simulated flight with nominal MPC."""
    config = load_experiment(name)
    config.controller.solver, config.duration = "sqp", duration
    return Flight(fly(config, seed=seed).log(), config.vehicle)


def main() -> None:
    """Trains on 10 s of a dithered circle, prints the force error on a lemniscate that it was not
    trained on.
    """
    learned, unseen = flight("training_circle", 10.0, seed=0), flight("lemniscate", 4.0, seed=1)
    packaged = PayloadFilterModel.load(NP_MODEL)
    model = train_payload_filter(opened_logs([learned]), step=0.02, prior=packaged)
    predictor = PayloadFilter(model)
    system = predictor.forecast(predictor.initial_memory(), horizon=20, stride=2)
    print(
        f"lifted linear system: A {system.A.shape}, B {system.B.shape}, C {system.C.shape}, "
        f"{model.summary['samples']} samples"
    )
    for row in score_flights(model, [unseen], HORIZONS, zeta="known"):
        if row["model"] in ("persistence", model.configuration):
            print(
                f"{row['model']:12} {row['horizon']:.1f} s ahead: force RMSE "
                f"{row['force_rmse']:.3f} N"
            )


if __name__ == "__main__":
    main()
