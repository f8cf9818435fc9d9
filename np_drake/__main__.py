"""`python -m np_drake`: the command line `np-drake`, found by its entry point."""

from np_drake.files.interruption import end_at_once


def main() -> None:
    """Run the console script `np-drake` of the installed distribution."""
    end_at_once()
    from importlib.metadata import distribution

    (script,) = distribution("np_drake").entry_points.select(
        group="console_scripts", name="np-drake"
    )
    script.load()()


if __name__ == "__main__":
    main()
