"""The camera of `v4l2://`: the newest picture, decoded, with the time at which its exposure began."""

from math import inf
from pathlib import Path

import numpy as np

from gellight.base.errors import CameraError
from gellight.frames.camera import Camera, CameraTiming
from gellight.frames.frames import CameraFrame, EncodedImage
from gellight.frames.jpeg import CorruptPictureError
from gellight.frames.status import CameraStatus
from gellight.sensor.v4l2.controls import V4l2Controls
from gellight.sensor.v4l2.device import Device
from gellight.sensor.v4l2.errors import LINUX, Kernel, StalledError
from gellight.sensor.v4l2.formats import Offer, decode
from gellight.sensor.v4l2.options import CaptureOptions
from gellight.sensor.v4l2.stamps import STAMP_ERROR_S, StampMeaning, hardware_stamps
from gellight.sensor.v4l2.stream import BAD_LIMIT, Picture

FIRST_FRAME_S = 5.0  # chosen: cameras take seconds to start
BLANK_GREY = 8
"""a picture whose pixels differ by no more is dark or white all over"""
STALL_S = 2.0
"""without a picture is a stall, or ten frame periods, if that is longer"""


class V4l2Camera(Camera):
    """A V4L2 camera with everything automatic switched off; it neither reconnects nor drives light."""

    controls: V4l2Controls

    def __init__(
        self, path: str, options: CaptureOptions | None = None, *, shape: tuple[int, int] | None = None,
        url: str | None = None, kernel: Kernel = LINUX, sysfs: Path = Path("/sys"),
    ) -> None:  # fmt: skip
        """Open, set and start the camera at `path`.

        `shape` (H, W) is what a calibration bundle was made with; `options` are stronger. Raises CameraError and its
        children of `v4l2.errors`, and InputError for a control out of range.
        """
        self.path, self.url = path, url or f"v4l2://{path}"
        self._options = options or CaptureOptions()
        self._device = Device(path, kernel=kernel)
        try:
            self.mode = self._device.configure(self._options.wanted(shape))
            self._device.controls.lock(self._options.controls(), power_line_hz=int(self._options.power_line_hz))
            self._stream = self._device.start(buffers=self._options.buffers)
        except BaseException:
            self._device.close()
            raise
        self.image_shape = (self.mode.height, self.mode.width)
        self.controls = self._device.controls
        self.counts = self._stream.counts
        self._hardware_stamps = hardware_stamps(self._device.identity.driver, sysfs=sysfs)
        self._proven = self._closed = False
        self._start_s = -inf
        """of the last frame"""

    @property
    def stamp_meaning(self) -> StampMeaning:
        """How the start of an exposure follows from a time stamp, as the camera is set now."""
        error_s = _seconds(self._options.stamp_error_us)
        return StampMeaning(
            hardware_stamps=self._hardware_stamps,
            period_s=1 / self.mode.fps,
            exposure_s=_seconds(self.controls.exposure_us),
            delay_s=_seconds(self._options.delay_us),
            readout_s=_seconds(self._options.readout_us),
            stamp_error_s=STAMP_ERROR_S if error_s is None else error_s,
        )

    @property
    def timing(self) -> CameraTiming:
        """Exposure, readout and period as they are now, with the doubt about each frame's start."""
        return self.stamp_meaning.camera_timing()

    @property
    def offers(self) -> tuple[Offer, ...]:
        """What the camera offers."""
        return self._device.offers()

    def picture(self) -> Picture:
        """Wait for the newest picture and return it undecoded; raises as `read` does."""
        if self._closed:
            raise CameraError(f"camera {self.url} is closed: open it again")
        return self._stream.newest(max(STALL_S, 10 / self.mode.fps) if self._proven else FIRST_FRAME_S)

    def read(self) -> CameraFrame:
        """Wait for the newest whole picture.

        A picture that the camera sends again is no new one: noise makes pictures differ, unless they are all dark or
        all white. Raises UnpluggedError where the camera went, StalledError where it is there and nothing usable comes,
        and CameraError where its controls do not stay as they were set.
        """
        why = ""
        for _ in range(BAD_LIMIT):
            picture = self.picture()
            try:
                image = decode(picture.data, self.mode)
            except CorruptPictureError:
                self.counts.corrupt += 1
                why = "only pictures that are not whole: use another cable or USB port, without a hub"
                continue
            if picture.repeats and np.ptp(image) > BLANK_GREY:
                why = "the same picture again and again: unplug it and plug it in, and update its firmware"
                continue
            if not self._proven:  # some cameras reset their controls as they start
                self.controls.verify()
                self._proven = True
            time_s = self.stamp_meaning.start_s(picture)
            if not picture.stamp_is_sound:
                time_s = max(time_s, self._start_s)
            self._start_s = time_s
            return CameraFrame(
                image=image,
                time_s=time_s,
                sequence=picture.sequence,
                estimated=not picture.stamp_is_sound,
                source=self.url,
                encoded=EncodedImage(data=picture.data, letters=self.mode.letters, line_bytes=self.mode.line_bytes),
            )
        raise StalledError(f"{self.path} delivers {why}")

    def status(self) -> CameraStatus:
        """Return mode, card and counts, ready for JSON."""
        return {"mode": str(self.mode), "card": self._device.identity.card, **self.counts.as_json()}

    def close(self) -> None:
        """Stop and close; reading afterwards raises CameraError."""
        self._closed = True
        self._device.close()


def _seconds(microseconds: float | None) -> float | None:
    return None if microseconds is None else microseconds * 1e-6
