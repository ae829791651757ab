"""Options and rules that hold for every test."""

import os
from pathlib import Path

import pytest
from xdist.scheduler import LoadFileScheduling

ALLOWED_SKIPS = ("needs real hardware", "needs a GPU")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--hardware", metavar="URL", help="run the tests marked `hardware` on the sensor at this URL")


VM = Path(__file__).parent / "vm"


class ByFile(LoadFileScheduling):
    """Keep the tests of a file in one process, and all that share the virtual machine."""

    def _split_scope(self, nodeid: str) -> str:
        return "vm" if nodeid.startswith("tests/vm/") else super()._split_scope(nodeid)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> LoadFileScheduling:
    return ByFile(config, log)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Begin with the virtual machine, which takes longest; leave out what needs hardware."""
    items.sort(key=lambda item: VM not in item.path.parents)
    if config.getoption("--hardware"):
        return
    skip = pytest.mark.skip(reason="needs real hardware: --hardware URL")
    for item in items:
        if item.get_closest_marker("hardware"):
            item.add_marker(skip)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item):
    """In continuous integration a skipped test is a failed one, unless what it lacks is hardware."""
    outcome = yield
    report = outcome.get_result()
    if report.skipped and os.environ.get("GELLIGHT_NO_SKIPS") and not hasattr(report, "wasxfail"):
        reason = str(report.longrepr[2]) if isinstance(report.longrepr, tuple) else str(report.longrepr)
        if not any(allowed in reason for allowed in ALLOWED_SKIPS):
            report.outcome = "failed"
            report.longrepr = f"skipped where nothing may be skipped: {reason}"
