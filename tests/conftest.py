"""Options and rules that hold for every test."""

import os
import shutil
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import settings
from xdist.scheduler import LoadFileScheduling

from tests.helpers.places import is_here

# Before NumPy is loaded, and for all children: several processes share the processors, and threads of one small product
# of matrices that wait for each other spin.
for threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(threads, "1")

settings.register_profile("untimed", deadline=None)  # processors are shared: no example is timed
settings.load_profile("untimed")
ALLOWED_SKIPS = ("needs real hardware", "needs a GPU")
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
NO_CHROMIUM = "needs Chromium: sudo apt-get install chromium"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--hardware", metavar="URL", help="run the tests marked `hardware` on the sensor at this URL")
    parser.addoption("--again", action="store_true", help="run once more what failed last, if all of it is in AGAIN")


TESTS = Path(__file__).parent
LONGEST = (
    "vm", "test_first_hour.py", "firmware/test_mutants.py", "soak/test_soak.py", "firmware/test_fuzz.py",
    "host/lab/calibration/test_routine.py", "host/daemon/test_matrix.py",
    "host/cli/test_calibrate.py", "host/dashboard/test_page_scan.py",
    "host/cli/test_signals.py", "host/lab/training/labelling/test_circles.py", "touch/test_environments.py",
    "design/test_studies.py", "host/stream/test_record_and_export.py", "host/lab/calibration/test_like.py",
    "host/daemon/test_running_states.py", "host/sensor/lighting/test_sequenced.py", "host/dashboard/test_page.py",
    "host/dashboard/test_page_in_use.py", "host/watch/test_monitor.py", "host/daemon/test_mode_change.py",
    "scan/test_scan.py", "touch/test_mujoco_carry.py", "benchmarks/test_integrators.py",
    "host/lab/optics/lights/test_channel_fit.py", "host/cli/test_demo.py", "host/reconstruction/test_native_path.py",
    "host/watch/test_rezero.py", "host/stream/test_recorder.py", "host/stream/test_subscription.py",
    "host/cli/test_service.py", "host/stream/test_lerobot.py", "host/stream/test_examples.py",
    "touch/test_examples.py", "soak/test_kills.py", "sim_reference/test_fem_gel.py",
    "sim_reference/test_fem_dragging.py", "sim_reference/test_fem_contact.py",
)  # fmt: skip
"""files, and the virtual machine, that take a process longest: several processes begin with them"""


AGAIN = {
    "vm": "a kernel on an emulated processor, whose time limits are those of a real one",
    "soak": "a sensor through faults, each with a time in which it has to be back",
}
"""what may be run once more, alone, after it failed beside others on shared processors, and why; nothing else may"""


def may_run_again(nodeid: str) -> bool:
    """Return whether a test is named in AGAIN."""
    return any(Path(nodeid.split("::")[0]).is_relative_to(Path("tests") / name) for name in AGAIN)


class ByFile(LoadFileScheduling):
    """Keep the tests of a file in one process, and all that share the virtual machine; in the order they come."""

    def _split_scope(self, nodeid: str) -> str:
        if "test_matrix.py" in nodeid:  # its rows know nothing of each other, and take minutes
            return nodeid
        return "vm" if nodeid.startswith("tests/vm/") else super()._split_scope(nodeid)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> LoadFileScheduling:
    config.option.loadscopereorder = False  # by the number of tests, which says little of how long they take
    return ByFile(config, log)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what a folder says of its tests; leave out what needs hardware, a browser, or images that are not there."""
    for gone in (name for name in LONGEST if not (TESTS / name).exists()):
        raise pytest.UsageError(f"tests/conftest.py names {gone}, which is not there: say where it is")
    if config.getoption("--again"):
        failed = config.cache.get("cache/lastfailed", {})
        if unnamed := [nodeid for nodeid in failed if not may_run_again(nodeid)]:
            raise pytest.UsageError(f"not run again, for AGAIN does not name it: {', '.join(unnamed)}")
        items[:] = [item for item in items if item.nodeid in failed]
    if hasattr(config, "workerinput"):  # one process runs a room in its own order, and shows its own fault first
        items.sort(key=place)
    no_browser = not any(map(shutil.which, BROWSERS))
    for item in items:
        if (folder := item.path.relative_to(TESTS).parts[0]) in FOLDER_MARKS:
            item.add_marker(FOLDER_MARKS[folder])
        if item.get_closest_marker("hardware") and not config.getoption("--hardware"):
            item.add_marker(pytest.mark.skip(reason="needs real hardware: --hardware URL"))
        if item.get_closest_marker("browser") and no_browser:
            item.add_marker(pytest.mark.skip(reason=NO_CHROMIUM))
        needed = {name for marker in item.iter_markers("real_images") for name in marker.args}
        if gone := sorted(name for name in needed if not is_here(name)):
            why = f"needs pictures of real sensors: python -m tests.data.fetch {' '.join(gone)}"
            item.add_marker(pytest.mark.skip(reason=why))


FOLDER_MARKS = {"style": "style", "vm": "nightly"}
"""what is true of every test of a folder"""


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say what was left out and why, one line a file and reason; one for all that need a browser."""
    left_out: Counter[tuple[str, str]] = Counter()
    for report in terminalreporter.stats.get("skipped", []):
        reason = reason_of(report)
        left_out["the page" if reason == NO_CHROMIUM else report.nodeid.split("::")[0], reason] += 1
    for (what, reason), count in sorted(left_out.items()):
        terminalreporter.write_line(f"left out: {what}, {count} test{'s' * (count > 1)}: {reason}")


def reason_of(report: pytest.TestReport) -> str:
    reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
    return reason.removeprefix("Skipped: ")


def place(item: pytest.Item) -> int:
    path = item.path.relative_to(TESTS)
    return next((n for n, name in enumerate(LONGEST) if path.is_relative_to(name)), len(LONGEST))


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item):
    """In continuous integration a skipped test is a failed one, unless what it lacks is hardware."""
    outcome = yield
    report = outcome.get_result()
    if report.skipped and os.environ.get("GELLIGHT_NO_SKIPS") and not hasattr(report, "wasxfail"):
        reason = reason_of(report)
        if not any(allowed in reason for allowed in ALLOWED_SKIPS):
            report.outcome = "failed"
            report.longrepr = f"skipped where nothing may be skipped: {reason}"
