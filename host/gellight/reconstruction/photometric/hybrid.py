"""GelNet at full rate, and its error measured by photometric stereo whenever the scene rests."""

import time
from dataclasses import dataclass, replace

import numpy as np

from gellight.frames.frames import CameraFrame, ExposureSeries, TactileFrame
from gellight.reconstruction.integration import angle_deg
from gellight.reconstruction.photometric.reconstructor import PhotometricReconstructor
from gellight.reconstruction.pipeline import Reconstructor


@dataclass(frozen=True, kw_only=True)
class NetworkError:
    """How far GelNet was from photometric stereo over one contact at rest; means, 0 without contact."""

    normal_deg: float
    depth_mm: float
    contact_px: int
    measured_s: float
    """`time.monotonic`"""


class HybridReconstructor:
    """Sends frames to GelNet, and series to both; what comes out is always GelNet's."""

    def __init__(self, network: Reconstructor, stereo: PhotometricReconstructor) -> None:
        """Use these two paths, of one calibration."""
        self.bundle = network.bundle
        self._network = network
        self._stereo = stereo
        self._error: NetworkError | None = None
        self._measured = 0
        self._moved = 0

    def status(self) -> dict[str, object]:
        """Return the mode and the newest error of GelNet; None before the first contact at rest."""
        error = self._error
        return {
            "mode": "hybrid",
            "network_error": error
            and {
                "normal_deg": round(error.normal_deg, 3),
                "depth_mm": round(error.depth_mm, 4),
                "contact_px": error.contact_px,
                "measured_s_ago": round(time.monotonic() - error.measured_s, 1),
            },
            "measurements": self._measured,
            "spoilt_by_motion": self._moved,
        }

    def reconstruct(self, camera_frame: CameraFrame) -> TactileFrame:
        """Reconstruct one frame by GelNet; of a series that is its first frame, which carries the series' report."""
        if not isinstance(camera_frame, ExposureSeries):
            return self._network.reconstruct(camera_frame)
        learnt = self._network.reconstruct(camera_frame.opening)
        measured = self._stereo.reconstruct(camera_frame)
        assert measured.exposures is not None
        if measured.exposures.moved:
            self._moved += 1
        elif (error := network_error(learnt, measured)).contact_px:
            self._measured += 1
            self._error = error
        return replace(learnt, exposures=measured.exposures)


def network_error(learnt: TactileFrame, measured: TactileFrame) -> NetworkError:
    """Compare GelNet's frame with the one `measured` of the same scene, over its contact where lights sufficed."""
    assert measured.exposures is not None
    where = measured.contact.mask & (measured.exposures.lights >= measured.exposures.least_lights)
    pixels = int(where.sum())
    angle = angle_deg(learnt.normal_map[where], measured.normal_map[where])
    depth = np.abs(learnt.depth_mm - measured.depth_mm)[where]
    return NetworkError(
        normal_deg=float(angle.sum() / max(pixels, 1)),
        depth_mm=float(depth.sum() / max(pixels, 1)),
        contact_px=pixels,
        measured_s=time.monotonic(),
    )
