"""`np-drake reproduce weights | pendulum`: how the MPC was tuned, and the tether's length from the payload's mode."""

from diagrams.batch.workers import failures
from diagrams.cli import options
from diagrams.cli.columns import tabulate
from diagrams.cli.runner import Report, Run, counting, reports


@reports("reproduce", seed=1000, out=options.OutOfCases, many=True)
def pendulum(run: Run) -> Report:
    """The tether's length from the payload's mode. For circles with and without dither."""
    from diagrams.payload.pendulum import EXPERIMENTS, LENGTHS, pendulum_table

    with counting("flights") as on_progress:
        lines = pendulum_table(seed=run.seed, workers=run.workers, on_progress=on_progress)
    columns = (
        ("flight", "flight"),
        ("tether [m]", "length"),
        ("found [m]", "found"),
        ("mode [Hz]", "frequency"),
        ("damping", "damping"),
        ("motion / noise", "motion"),
    )
    return Report(
        [tabulate(f"tether from the payload's mode, seed {run.seed}", lines, columns)],
        config={"experiments": EXPERIMENTS, "lengths": LENGTHS},
        metrics={"table": lines},
        lines=[f"{line['flight']}, {line['length']} m: {line['text']}" for line in lines],
        notes=failures(run.workers.finished),
    )


@reports("reproduce", seed=1000, out=options.OutOfCases, many=True)
def weights(run: Run) -> Report:
    """How the MPC's weights were chosen. On the vehicle without payload."""
    from diagrams.tracking.tuning import EFFORT, LAG, weight_table

    with counting("weights") as on_progress:
        lines = weight_table(seed=run.seed, workers=run.workers, on_progress=on_progress)
    title = f"factors on the frozen weights; lemniscate, no payload, motor lag {LAG} s, seed {run.seed}"
    columns = (
        ("position", "position"),
        ("torque", "torque"),
        ("E_xy [cm]", lambda line: round(100 * line["E_xy"], 2)),
        ("E_z [cm]", lambda line: round(100 * line["E_z"], 2)),
        ("torque RMS [N·m]", lambda line: round(line["torque_rms"], 4)),
        ("allowed", lambda line: "yes" if line["allowed"] else "no"),
    )
    config = {"allowed_torque_rms": EFFORT, "motor_lag": LAG}
    return Report(
        [tabulate(title, lines, columns)],
        config=config,
        metrics={"table": lines},
        notes=failures(run.workers.finished),
    )
