"""The network in C, where it is GelNet's usual one and answers as ONNX Runtime does."""

import logging
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gellight.reconstruction.native.library import Library
from gellight.reconstruction.network_file import weights_of
from gellight.reconstruction.network_session import NetworkSession

logger = logging.getLogger(__name__)
Floats = NDArray[np.float32]

INPUTS, HIDDEN, OUTPUTS = 5, 32, 2  # of GelNet, and of network.c
LAYERS = 5  # of weights, in GelNet (models/gelnet/parameters.py)
TILE = 8
"""outputs that are computed together, see network.c"""
STEEPEST_RAD = 1.5
"""up to which the tangent is right there"""
ALLOWED = 1e-4
"""difference of slopes from ONNX Runtime's, and of Jacobians times `GREY`, over 1 + slope^2"""
GREY = 30.0  # chosen: a press's change of colour, which makes slopes of Jacobians
JUDGED = 1000  # chosen: made-up rows that are compared


class SlopeNetwork(Protocol):
    """What answers rows of colour and place."""

    def slopes(self, rows: Floats, /) -> Floats:
        """Return the (N, 2) slopes of (N, 5) rows."""

    def slopes_and_jacobian(self, rows: Floats, /) -> tuple[Floats, Floats]:
        """Return them and the (N, 6) Jacobian in the colours."""


class NativeNetwork:
    """A network on the C library."""

    def __init__(self, library: Library, packed: Floats) -> None:
        """Take what `pack` made."""
        self._c, self._packed = library, packed

    def slopes(self, rows: Floats) -> Floats:
        """Return the (N, 2) slopes of (N, 5) rows."""
        slopes = np.empty((len(rows), OUTPUTS), np.float32)
        self._c.call("network_slopes", self._packed, rows, slopes, len(rows))
        return slopes

    def slopes_and_jacobian(self, rows: Floats) -> tuple[Floats, Floats]:
        """Return them and the (N, 6) Jacobian in the colours."""
        slopes, jacobian = np.empty((len(rows), OUTPUTS), np.float32), np.empty((len(rows), 6), np.float32)
        self._c.call("network_jacobian", self._packed, rows, slopes, jacobian, len(rows))
        return slopes, jacobian


def fastest(library: Library, content: bytes, session: NetworkSession, image_shape: tuple[int, int]) -> SlopeNetwork:
    """Return the network in C; the session, which is the judge, for another network or other answers."""
    packed = pack(weights_of(content))
    if packed is None:
        return session
    network = NativeNetwork(library, packed)
    if (difference := disagreement(network, session, image_shape)) <= ALLOWED:
        return network
    logger.warning("ONNX Runtime asks the network, which takes longer: in C its answers differ by %.3g", difference)
    return session


def disagreement(network: SlopeNetwork, judge: SlopeNetwork, image_shape: tuple[int, int]) -> float:
    """Return the largest difference in made-up rows, as `ALLOWED` has it."""
    rng = np.random.default_rng(0)
    colour, place = rng.normal(0, 40, (JUDGED, 3)), rng.random((JUDGED, 2)) * image_shape[::-1]
    rows = np.concatenate([colour, place], axis=1).astype(np.float32)
    (found, jacobian), (right, true) = network.slopes_and_jacobian(rows), judge.slopes_and_jacobian(rows)
    difference = np.abs(np.concatenate([found - right, network.slopes(rows) - right, GREY * (jacobian - true)], axis=1))
    return float((difference / np.tile(1 + right**2, 5)[:, : difference.shape[1]]).max())


def pack(weights: dict[str, Floats]) -> Floats | None:
    """Return the weights in the order of network.c; None for another network than the usual one."""
    sizes = (INPUTS, *[HIDDEN] * (LAYERS - 1), OUTPUTS)
    shapes: dict[str, tuple[int, ...]] = {"steepest_rad": (1,)}
    for k in range(1, LAYERS + 1):
        shapes |= {f"weight_{k}": (sizes[k], sizes[k - 1]), f"bias_{k}": (sizes[k],)}
    if {name: array.shape for name, array in weights.items()} != shapes or weights["steepest_rad"][0] > STEEPEST_RAD:
        return None
    layers = [weights[f"weight_{k}"] for k in range(1, LAYERS + 1)]
    backwards = [*(layer.T for layer in layers[1:-1]), layers[0].T[:3]]
    biases = [_tiled(weights[f"bias_{k}"][:, None]) for k in range(1, LAYERS + 1)]
    parts = [*map(_tiled, (*layers, *backwards)), *biases, layers[-1], weights["steepest_rad"]]
    return np.concatenate([part.ravel() for part in parts]).astype(np.float32)


def _tiled(weights: Floats) -> Floats:
    """(outputs, inputs) to tiles of outputs, (tiles, inputs, TILE); the last is filled up with 0."""
    outputs, inputs = weights.shape
    filled = np.pad(weights, ((0, -outputs % TILE), (0, 0)))
    return filled.reshape(-1, TILE, inputs).swapaxes(1, 2)
