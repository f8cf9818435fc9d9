"""Diagnoses the gap between a vehicle file and flight logs.

Shows: a case folder (here one that is simulated with a payload of which the vehicle file says
nothing), `diagnose` with the open-loop replay in Drake, and the parts of its answer. With a folder
of your own logs, call `answer` alone.
"""

from pathlib import Path

from diagrams.evidence.challenge.make import SetRequest, make
from diagrams.gap.drake_replay import DrakeReplay
from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.result import Diagnosis
from np_drake.logs.opening import open_case


def answer(folder: Path) -> Diagnosis:
    """The diagnosis of the case folder: vehicle.yaml, train_* and heldout* flight logs."""
    vehicle, train, held_out = open_case(folder)
    return diagnose(train, held_out, vehicle, DrakeReplay(vehicle))


def main() -> None:
    """Makes a case, diagnoses it, prints verdict, parameters, gap reduction and what these logs
    cannot tell.
    """
    make(Path("cases"), Path("truth"), SetRequest(cases=1, clean=0, seconds=10.0, seed=47))
    diagnosis = answer(next(Path("cases").iterdir()))
    print(
        "verdict:",
        diagnosis.verdict,
        " probability of something unknown:",
        round(diagnosis.unknown_probability, 2),
    )
    for cause in diagnosis.causes:
        for name, parameter in cause.parameters.items():
            low, high = parameter.ci95
            print(
                f"  {cause.identifier} {name} {parameter.value:.4f} [{low:.4f}, "
                f"{high:.4f}] {parameter.unit}"
            )
    gap_reduction = diagnosis.gap_reduction
    print(
        f"held-out residual: {gap_reduction.before:.2f} -> {gap_reduction.after:.2f} "
        f"(noise: {gap_reduction.floor:.2f})"
    )


if __name__ == "__main__":
    main()
