"""Step 3: the ring is dark whenever no host wants it lit."""

import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np
import pytest

from gellight.ring.enumerations import Dark
from gellight.ring.light_ring import LightRing, connect
from gellight.ring.transport import open_transport

pytestmark = pytest.mark.hardware
LIGHT = "import sys, time; from gellight.ring.light_ring import connect; import numpy as np\n" \
        "ring = connect(sys.argv[1]); ring.light(np.full((ring.led_count, 3), 8, np.uint8))\n" \
        "print('lit', flush=True); time.sleep(60)"  # fmt: skip


def test_a_silent_host_leaves_it_dark(url: str) -> None:
    with LightRing(open_transport(url), keep_alive_s=None) as silent:
        silent.set_leds(np.full((silent.led_count, 3), 8, np.uint8))
        time.sleep(silent.configuration().host_timeout_ms / 1e3 + 0.3)
        assert silent.status().dark == Dark.HOST_SILENT


def test_a_program_that_is_killed_leaves_it_dark(url: str) -> None:
    if url.startswith("sim://"):
        pytest.skip("needs real hardware: a simulated board ends with its program")
    program = subprocess.Popen([sys.executable, "-c", LIGHT, url], stdout=subprocess.PIPE, text=True)
    assert program.stdout is not None
    assert program.stdout.readline().strip() == "lit"
    program.kill()
    program.wait()
    program.stdout.close()
    time.sleep(1.3)
    with connect(url) as ring:
        status = ring.status()
        assert status.dark in (Dark.PORT_CLOSED, Dark.HOST_SILENT)
        assert status.time_us > 1e6  # it was darkened, not started anew


def test_a_pulled_plug_leaves_it_dark(ring: LightRing, dim: np.ndarray, ask: Callable[[str], str]) -> None:
    """By eye; with a supply of their own the LEDs need the load switch for this."""
    ring.light(dim)
    assert ask("Pull the USB plug of the board. Are the LEDs dark? Plug it in again. [y/n]") == "y"
