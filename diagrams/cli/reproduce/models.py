"""`np-drake reproduce models`: the model files that ship with the package, made anew."""

from diagrams.cli import options
from diagrams.cli.output import progress
from diagrams.cli.runner import Report, Run, reports


@reports("reproduce", seed=None, out=options.Out)
def models(run: Run) -> Report:
    """Make the packaged model files anew, and compare them with those in the package. --out DIR: the files."""
    from diagrams.tracking.packaged import SEED, SOLVER, difference, make_packaged_models

    with progress("packaged models", 1.0) as advance:
        files = make_packaged_models(
            run.folder, on_step=lambda done, total, text: advance(done / total, text)
        )
    lines = [
        {"file": file.name, "bytes": file.stat().st_size, "difference": difference(file)} for file in files
    ]
    rows: list[tuple] = [(line["file"], line["bytes"], f"{line['difference']:.2g}") for line in lines]
    title = f"training flight of the demo, seed {SEED}, {SOLVER}"
    return Report(
        [(title, ["file", "size [B]", "largest difference from the packaged one [1]"], rows)],
        config={"seed": SEED, "solver": SOLVER},
        metrics={"models": lines},
    )
