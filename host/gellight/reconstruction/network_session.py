"""The network of a bundle in ONNX Runtime on the CPU, its contract checked.

A row is one pixel or the mean of some: the change of its C channels and the place (px); the answer is the slope there.
The file of a network also answers the Jacobian, d(slope)/d(channels). One that an older GelLight wrote does not: its
Jacobian is taken by differences, equal to 1e-4 of its size, and costs as much as seven answers instead of three.
"""

from pathlib import Path

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from gellight.base.errors import BundleError, first_line
from gellight.reconstruction.network_file import check_network

Floats = NDArray[np.float32]

REMEDY = "train the network again with this GelLight and write a new bundle"
STEP_GREY = 0.25
"""of the differences: small against what bends the answer, large against the rounding of float32"""


class NetworkSession:
    """The network of one calibration bundle, for rows (N, C + 2) of its C channels and the place."""

    def __init__(self, network: bytes | Path, *, source: str, channels: int = 3) -> None:
        """Load an ONNX file or its content. source: the name of the bundle, for messages.

        Raises BundleError for a network that does not keep the contract.
        """
        self._source, self._channels = source, channels
        content = network if isinstance(network, bytes) else _read(network, source)
        check_network(content, source)
        self._session = _session(content, source)
        self.has_jacobian = _check_contract(self._session, source, channels)
        """whether the file answers the Jacobian itself"""

    def slopes(self, rows: Floats) -> Floats:
        """Return the (N, 2) slopes of (N, C + 2) rows; BundleError where they are not finite numbers."""
        return self._answers({"gradient": 2}, {"pixels": rows})[0]

    def slopes_and_jacobian(self, rows: Floats) -> tuple[Floats, Floats]:
        """Return the (N, 2) slopes of rows, and (N, 2 C) d(slope x)/d(channels), d(slope y)/d(channels)."""
        if self.has_jacobian:
            given = {"pixels": rows, "with_jacobian": np.array(True)}
            slopes, jacobian = self._answers({"gradient": 2, "jacobian": 2 * self._channels}, given)
            return slopes, jacobian
        steps = STEP_GREY * np.eye(self._channels, rows.shape[1], dtype=np.float32)
        columns = [(self.slopes(rows + step) - self.slopes(rows - step)) / (2 * STEP_GREY) for step in steps]
        return self.slopes(rows), np.stack(columns, axis=2).reshape(len(rows), -1)

    def _answers(self, columns: dict[str, int], given: dict[str, NDArray[np.generic]]) -> list[Floats]:
        """The outputs of these names, (N, columns) each for the N rows of "pixels"."""
        rows = len(given["pixels"])
        found: list[Floats] = self._session.run(list(columns), given)
        for answer, width in zip(found, columns.values(), strict=True):
            if answer.shape != (rows, width) or not np.isfinite(answer).all():
                what = "NaN or infinite slopes" if answer.shape == (rows, width) else f"shape {answer.shape}"
                raise BundleError(f"{self._source}: the network answers {what} to {rows} pixels: {REMEDY}")
        return found


def _read(path: Path, source: str) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise BundleError(f"{source}: the network cannot be loaded ({first_line(error)}): {REMEDY}") from error


def _session(content: bytes, source: str) -> onnxruntime.InferenceSession:
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 3
    # A thread that spins between the blocks takes the core from the camera and the dashboard.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # ONNX Runtime has no base class for its errors
        reason = first_line(error)[:200]
        raise BundleError(f"{source}: the network cannot be loaded ({reason}): {REMEDY}") from error


def _check_contract(session: onnxruntime.InferenceSession, source: str, channels: int) -> bool:
    """One input "pixels" (N, C + 2), an output "gradient" (N, 2), all float32, N free.

    Returns whether there is also the output "jacobian" (N, 2 C), with the input "with_jacobian" that asks for it.
    """
    try:
        found = {
            kind: [(value.name, value.type, list(value.shape)) for value in values]
            for kind, values in (
                ("input", session.get_inputs()),
                ("output", session.get_outputs()),
                ("option", session.get_overridable_initializers()),
            )
        }
    except UnicodeDecodeError as error:
        raise BundleError(f"{source}: a name in the network is no text: {REMEDY}") from error
    differentiates = found["option"] == [("with_jacobian", "tensor(bool)", [])]
    answers = {"gradient": 2, "jacobian": 2 * channels} if differentiates else {"gradient": 2}
    for kind, wanted in (("input", {"pixels": channels + 2}), ("output", answers)):
        if [*map(_columns, found[kind])] != list(wanted.items()):
            expected = ", ".join(f"{name!r} float32 (N, {columns})" for name, columns in wanted.items())
            raise BundleError(f"{source}: the network has the {kind} {found[kind]}, expected {expected}: {REMEDY}")
    return differentiates


def _columns(value: tuple[str, str, list[int | str]]) -> tuple[str, int | str | None]:
    """Name and columns of an input or output of float32 rows; None in their place for anything else."""
    name, kind, shape = value
    right = kind == "tensor(float)" and len(shape) == 2 and not isinstance(shape[0], int)
    return name, shape[1] if right else None
