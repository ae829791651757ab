"""A real board at --hardware URL; what only a hand can do is asked for. The order of the steps: docs/bring-up.md."""

import sys
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from gellight.base.errors import BoardError
from gellight.ring.light_ring import LightRing, connect

DIM = 8
BACK_S = 30.0
"""a board that was unplugged, or a computer that slept, is back by then"""
Ask = Callable[[str], str]
Lit = Callable[..., np.ndarray]


@pytest.fixture
def url(request: pytest.FixtureRequest) -> str:
    return str(request.config.getoption("--hardware"))


@pytest.fixture
def ring(url: str) -> Iterator[LightRing]:
    with connect(url) as opened:
        yield opened


@pytest.fixture
def dim(ring: LightRing) -> np.ndarray:
    return np.full((ring.led_count, 3), DIM, np.uint8)


@pytest.fixture
def ask(pytestconfig: pytest.Config) -> Ask:
    """Ask somebody who sits at the board to do something, and return the answer."""
    capture = pytestconfig.pluginmanager.getplugin("capturemanager")

    def ask_(text: str) -> str:
        if not sys.stdin or not sys.stdin.isatty():
            pytest.skip("needs real hardware and a hand: run it with -s in a terminal")
        with capture.global_and_fixture_disabled():
            return input(f"\n{text} ").strip().lower()

    return ask_


@pytest.fixture
def reopened(url: str) -> Callable[[], LightRing]:
    """Open the board as soon as it is back."""

    def open_() -> LightRing:
        end_s = time.monotonic() + BACK_S
        while True:
            try:
                return connect(url)
            except BoardError:
                if time.monotonic() > end_s:
                    raise
                time.sleep(0.2)

    return open_
