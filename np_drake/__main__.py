"""`python -m np_drake`: the command line `np-drake`, found by its entry point."""

from importlib.metadata import distribution


def main() -> None:
    """Run the console script `np-drake` of the installed distribution."""
    (script,) = distribution("np_drake").entry_points.select(group="console_scripts", name="np-drake")
    script.load()()


if __name__ == "__main__":
    main()
