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
        {"file": file.name, "bytes": file.stat().st_size, **difference(file)._asdict()} for file in files
    ]
    rows: list[tuple] = [
        (line["file"], line["bytes"], f"{line['relative']:.2g}", f"{line['from_zero']:.2g}") for line in lines
    ]
    title = f"largest differences from the packaged files; training flight of the demo, seed {SEED}, {SOLVER}"
    return Report(
        [(title, ["file", "size [B]", "over the packaged one [1]", "where that is zero [SI]"], rows)],
        config={"seed": SEED, "solver": SOLVER},
        metrics={"models": lines},
    )
