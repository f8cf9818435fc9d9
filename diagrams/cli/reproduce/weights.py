"""`np-drake reproduce weights | pendulum`: how the MPC was tuned, and the tether's length from the payload's mode."""

from diagrams.cli import options
from diagrams.cli.output import counted, progress, require_files, say, show, write_metrics


def pendulum(seed: options.Seed = 1000, json: options.Json = None, markdown: options.Markdown = None) -> None:
    """The tether's length from the payload's mode. For circles with and without dither."""
    require_files(json, markdown)
    from diagrams.payload.pendulum import EXPERIMENTS, LENGTHS, pendulum_table

    with progress("flights", 1.0) as advance:
        lines = pendulum_table(seed=seed, on_progress=counted(advance))
    say(*(f"{line['flight']}, {line['length']} m: {line['text']}" for line in lines))
    config = {"experiments": EXPERIMENTS, "lengths": LENGTHS}
    write_metrics(json, "reproduce", seed=seed, config=config, table=lines)
    keys = ("flight", "length", "found", "frequency", "damping", "motion")
    header = ["flight", "tether [m]", "found [m]", "mode [Hz]", "damping", "motion / noise"]
    rows = [tuple(line[k] for k in keys) for line in lines]
    show(markdown, (f"tether from the payload's mode, seed {seed}", header, rows))


def weights(
    jobs: options.Jobs = 2,
    seed: options.Seed = 1000,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """How the MPC's weights were chosen. On the vehicle without payload."""
    require_files(json, markdown)
    from diagrams.tracking.tuning import EFFORT, LAG, weight_table

    with progress("weights", 1.0) as advance:
        lines = weight_table(seed=seed, jobs=jobs, on_progress=counted(advance))
    rows = [
        (
            line["position"],
            line["torque"],
            round(100 * line["E_xy"], 2),
            round(100 * line["E_z"], 2),
            round(line["torque_rms"], 4),
            "yes" if line["allowed"] else "no",
        )
        for line in lines
    ]
    header = ["position", "torque", "E_xy [cm]", "E_z [cm]", "torque RMS [N·m]", "allowed"]
    title = f"factors on the frozen weights; lemniscate, no payload, motor lag {LAG} s, seed {seed}"
    config = {"allowed_torque_rms": EFFORT, "motor_lag": LAG}
    write_metrics(json, "reproduce", seed=seed, config=config, table=lines)
    show(markdown, (title, header, rows))
