"""The network of a bundle in ONNX Runtime on the CPU, its contract checked.

A row is one pixel or the mean of some: the change of its channels and the place (px); the answer
is the slope there. Where the network can be differentiated (`jacobian`), a second session answers that too.
"""

import logging
from pathlib import Path

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from gellight.base.errors import BundleError
from gellight.reconstruction.jacobian import NotAChainError, with_jacobian

logger = logging.getLogger(__name__)
Floats = NDArray[np.float32]

REMEDY = "train the network again with this GelLight and write a new bundle"


class NetworkSession:
    """The network of one calibration bundle, for rows (N, C + 2) of its C channels and the place."""

    def __init__(self, network: bytes | Path, *, threads: int, source: str, channels: int = 3) -> None:
        """Load an ONNX file or its content. source: the name of the bundle, for messages.

        Raises BundleError for a network that does not keep the contract.
        """
        self.source, self._threads = source, threads
        self._content = network if isinstance(network, bytes) else _read(network, source)
        self._session = _session(self._content, threads, source)
        _check_contract(self._session, source, channels + 2)

    def slopes(self, rows: Floats) -> Floats:
        """Return the (N, 2) slopes of (N, C + 2) rows; BundleError where they are not finite numbers."""
        answer: Floats = self._session.run(["gradient"], {"pixels": rows})[0]
        if answer.shape != (len(rows), 2) or not np.isfinite(answer).all():
            what = "NaN or infinite slopes" if answer.shape == (len(rows), 2) else f"shape {answer.shape}"
            raise BundleError(f"{self.source}: the network answers {what} to {len(rows)} pixels: {REMEDY}")
        return answer

    def differentiated(self) -> "JacobianSession":
        """Return the session that answers the Jacobian too; NotAChainError where that cannot be derived."""
        return JacobianSession(_session(with_jacobian(self._content), self._threads, self.source), self.source)


class JacobianSession:
    """The network and its Jacobian in the colours."""

    def __init__(self, session: onnxruntime.InferenceSession, source: str) -> None:
        """Take a session of the network that `jacobian.with_jacobian` made; source: of the bundle, for messages."""
        self._session, self._source = session, source

    def answer(self, rows: Floats) -> tuple[Floats, Floats]:
        """Return the (N, 2) slopes of (N, 5) rows, and (N, 6) d(slope x)/d(colours), d(slope y)/d(colours)."""
        slopes, jacobian = self._session.run(["gradient", "jacobian"], {"pixels": rows})
        if not (np.isfinite(slopes).all() and np.isfinite(jacobian).all()):
            raise BundleError(f"{self._source}: the network answers NaN or infinite slopes: {REMEDY}")
        return slopes, np.ascontiguousarray(np.broadcast_to(jacobian, (len(rows), 6)))


def jacobian_session(network: NetworkSession) -> JacobianSession | None:
    """Return the differentiated session; None, with a line in the log, for a network that has another form."""
    try:
        return network.differentiated()
    except NotAChainError as reason:
        logger.warning("%s: slow, every touched pixel goes through the network one by one: %s", network.source, reason)
        return None


def _read(path: Path, source: str) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise BundleError(f"{source}: the network cannot be loaded ({error}): {REMEDY}") from error


def _session(content: bytes, threads: int, source: str) -> onnxruntime.InferenceSession:
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 3
    # A thread that spins between the blocks takes the core from the camera and the dashboard.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # ONNX Runtime has no base class for its errors
        reason = str(error).splitlines()[0][:200]
        raise BundleError(f"{source}: the network cannot be loaded ({reason}): {REMEDY}") from error


def _check_contract(session: onnxruntime.InferenceSession, source: str, inputs: int) -> None:
    """One input "pixels" (N, inputs) float32, one output "gradient" (N, 2) float32, N free."""
    for kind, found, wanted, columns in (
        ("input", session.get_inputs(), "pixels", inputs),
        ("output", session.get_outputs(), "gradient", 2),
    ):
        try:
            values = [(value.name, value.type, list(value.shape)) for value in found]
        except UnicodeDecodeError as error:
            raise BundleError(f"{source}: an {kind} of the network has a name that is no text: {REMEDY}") from error
        right = len(values) == 1 and values[0][:2] == (wanted, "tensor(float)")
        shape = values[0][2] if right else []
        if not right or len(shape) != 2 or isinstance(shape[0], int) or shape[1] != columns:
            raise BundleError(
                f"{source}: the network has the {kind} {values}, expected {wanted!r} float32 (N, {columns}): {REMEDY}"
            )
