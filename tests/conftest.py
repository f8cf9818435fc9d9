"""Where the real flights lie, and what happens when they do not.

A test that takes the `neurobem` or `real_flights` fixture is skipped without its data folder. With
`--require-real-flights` a skipped one is a failure, and so is a run in which none was executed.
"""

import os
import signal
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from np_drake.autopilot.betaflight import AutopilotError, find_firmware

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy is loaded; its threads only cost here

# How fast examples are drawn and tried is the machine's, and no law.
settings.register_profile(
    "any machine", deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("any machine")

ROOT = Path(__file__).parents[1]
MARKER = "real_flights"
OPTION = "--require-real-flights"
NIGHTLY = "--nightly"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        OPTION, action="store_true", help="fail where a test on real flights does not run"
    )
    parser.addoption(NIGHTLY, action="store_true", help="run the long tests too")


def pytest_configure(config: pytest.Config) -> None:
    for number, handler in (
        (signal.SIGINT, signal.default_int_handler),
        (signal.SIGHUP, signal.SIG_DFL),
    ):
        if (
            signal.getsignal(number) == signal.SIG_IGN
        ):  # as nohup and jobs in the background leave it to children
            signal.signal(number, handler)
    config.addinivalue_line(
        "markers", f"{MARKER}: needs the folder of real flights (set by the fixture)"
    )
    config.addinivalue_line("markers", f"nightly: takes long, and runs by {NIGHTLY} alone")
    if config.getoption(OPTION) and not hasattr(config, "workerinput"):
        config.pluginmanager.register(RealFlightsRan(), "real_flights_ran")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not config.getoption(NIGHTLY):
        long = [item for item in items if item.get_closest_marker("nightly")]
        config.hook.pytest_deselected(items=long)
        items[:] = [item for item in items if item not in long]
    for item in items:
        if {"neurobem", "real_flights"} & set(getattr(item, "fixturenames", ())):
            item.add_marker(MARKER)


def neurobem_folder() -> Path:
    """NP_DRAKE_NEUROBEM, or `shared/neurobem` beside the repository."""
    return Path(os.environ.get("NP_DRAKE_NEUROBEM") or ROOT.parent / "shared" / "neurobem")


@pytest.fixture(scope="session")
def neurobem() -> Path:
    """The folder of real flights with csv/ and npy/."""
    folder = neurobem_folder()
    if not ((folder / "csv").is_dir() and (folder / "npy").is_dir()):
        pytest.skip(
            f"no real flights in {folder}: set NP_DRAKE_NEUROBEM to the folder of csv/ and npy/"
        )
    return folder


@pytest.fixture(scope="session")
def firmware() -> None:
    """Skip where Betaflight's firmware is not installed."""
    try:
        find_firmware()
    except AutopilotError as missing:
        pytest.skip(f"{missing} `make autopilot` runs these tests.")


def real_flights_folder() -> Path:
    """NP_DRAKE_REAL, or `shared/real` beside the repository."""
    return Path(os.environ.get("NP_DRAKE_REAL") or ROOT.parent / "shared" / "real")


@pytest.fixture(scope="session")
def real_flights() -> Path:
    """The folder of real flights with imrc/, neural_fly/ and ulog/."""
    folder = real_flights_folder()
    if not all((folder / name).is_dir() for name in ("imrc", "neural_fly", "ulog")):
        pytest.skip(
            f"no real flights in {folder}: set NP_DRAKE_REAL to the folder of imrc/, "
            f"neural_fly/ and ulog/"
        )
    return folder


COLUMN = 864.0  # width of a figure on a page of 1200 px, less margins (page.css) [px]


@pytest.fixture(scope="session")
def smallest_text():
    """Return a function of a figure: size of its smallest text on a page [px]."""
    from matplotlib.text import Text

    def smallest(figure) -> float:
        figure.draw_without_rendering()  # makes the numbers at the ticks
        sizes = [t.get_fontsize() for t in figure.findobj(Text) if t.get_text().strip()]
        return min(sizes) * COLUMN / (72 * figure.get_figwidth())

    return smallest


class RealFlightsRan:
    """Counts the tests on real flights (in the controlling process, also under xdist)."""

    def __init__(self) -> None:
        self.ran = 0
        self.skipped: list[str] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if MARKER not in report.keywords:
            return
        if report.skipped:
            self.skipped.append(report.nodeid)
        elif report.when == "call":
            self.ran += 1

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> None:
        if exitstatus == 0 and (self.skipped or not self.ran):
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if self.skipped or not self.ran:
            terminalreporter.section("real flights were required", red=True)
            terminalreporter.line(f"{self.ran} tests on them ran, {len(self.skipped)} were skipped")
