"""GelNet with a channel for each light: slopes from pictures that were taken under one light after the other.

A row of the network is one pixel: by how much its picture under each light differs from the untouched gel, in per cent
of that, and the place (px). As with colours, what it answers to no difference is subtracted.
"""

import numpy as np
from numpy.typing import NDArray

from gellight.reconstruction.network_session import NetworkSession

Floats = NDArray[np.float32]
_BLOCK = 65536


def change_percent(levels: Floats, untouched: Floats) -> Floats:
    """(K, H, W) grey levels -> (H * W, K) by how much each differs from the untouched gel, per cent of that."""
    change = 100 * (levels / untouched - 1)
    return np.ascontiguousarray(change.reshape(len(levels), -1).T, np.float32)


class ChannelNetwork:
    """The network of a bundle with K channels, for pictures of one size."""

    def __init__(self, network: bytes, untouched: Floats, *, source: str) -> None:
        """Load an ONNX file for lights under which the untouched gel shows (K, H, W) grey levels.

        source: the name of the bundle, for messages. Raises BundleError for a network of another form.
        """
        self._untouched = untouched
        self._session = NetworkSession(network, source=source, channels=len(untouched))
        rows, columns = np.indices(untouched.shape[1:], dtype=np.float32)
        self._places = np.stack([columns.ravel(), rows.ravel()], axis=1)
        self._zero = self._answers(np.zeros((len(self._places), len(untouched)), np.float32))

    def gradient_map(self, levels: Floats) -> Floats:
        """(K, H, W) grey levels, one picture a light -> (H, W, 2) slopes."""
        slopes = self._answers(change_percent(levels, self._untouched)) - self._zero
        return slopes.reshape(*levels.shape[1:], 2)

    def _answers(self, change: Floats) -> Floats:
        parts = [slice(start, start + _BLOCK) for start in range(0, len(change), _BLOCK)]
        rows = (np.concatenate([change[part], self._places[part]], axis=1) for part in parts)
        return np.concatenate([self._session.slopes(block) for block in rows])
