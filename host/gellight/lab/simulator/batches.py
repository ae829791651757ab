"""Presses computed in batches by PyTorch, on a GPU where there is one, in a child process (`gelnet.pressed`)."""

import json
import subprocess
import sys
import tempfile
import weakref
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from types import SimpleNamespace
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.base.gelnet_child import gelnet_environment
from gellight.lab.simulator.choices import Computer
from gellight.lab.simulator.scene import SPACING_MM, Press
from sim_reference.deformation import Deformation
from sim_reference.geometry import SensorGeometry
from sim_reference.surface import Surface

Array = NDArray[np.float64]
BATCH = 16
"""presses that are asked for at once"""


class BatchComputer:
    """The child process that computes presses of one sensor; it ends with this object, or with this process."""

    def __init__(self, by: Computer, geometry: SensorGeometry, light: Array) -> None:
        """Start the child, `by` "torch" or "cuda", for pictures under (K, N, 3) light; InputError where it cannot."""
        self._complaints: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the child
        command = [sys.executable, "-m", "gelnet.pressed", "--by", by, "--batch", str(BATCH)]
        self._child = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._complaints, env=gelnet_environment(1)
        )
        weakref.finalize(self, _end, self._child, self._complaints)
        self._ask({"geometry": asdict(geometry), "light": light.tolist()})
        self.device = str(self._array())
        """what computes, by name"""

    def seen(self, presses: Sequence[Press]) -> Iterator[tuple[Array, Surface, Deformation]]:
        """Yield the (K, H, W, 3) irradiance of each press, and the gel; InputError where the child has ended."""
        self._ask([[press.object_name, press.depth_mm, press.x_mm, press.y_mm] for press in presses])
        for _ in presses:
            irradiance, depth, gradient, contact, deep, pressure = (self._array() for _ in range(6))
            yield irradiance, Surface(depth, gradient, contact), Deformation(deep, pressure, SPACING_MM)

    def _ask(self, said: object) -> None:
        assert self._child.stdin is not None
        try:
            self._child.stdin.write(json.dumps(said).encode() + b"\n")
            self._child.stdin.flush()
        except BrokenPipeError:
            raise self._ended() from None

    def _array(self) -> Any:
        assert self._child.stdout is not None
        pipe: Any = SimpleNamespace(read=self._child.stdout.read)  # what NumPy takes for a file it seeks in
        try:
            return np.lib.format.read_array(pipe, allow_pickle=False)
        except ValueError:
            raise self._ended() from None

    def _ended(self) -> InputError:
        status = self._child.wait()
        self._complaints.seek(0)
        said = self._complaints.read().decode(errors="replace").strip().splitlines() or ["it said nothing"]
        if "No module named 'torch'" in said[-1]:
            return InputError('PyTorch is not installed: pip install "gellight[torch]", or compute by numpy')
        if status == 2:
            return InputError(said[-1].removeprefix("gelnet.pressed: "))
        return InputError(f"what computes the presses ended with status {status}: {said[-1]}")


def _end(child: "subprocess.Popen[bytes]", complaints: IO[bytes]) -> None:
    child.kill()
    child.communicate()
    complaints.close()
