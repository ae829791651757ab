"""One open V4L2 device: what it is, what it offers, its controls and its stream."""

import errno
import os
from contextlib import AbstractContextManager
from ctypes import Structure
from dataclasses import dataclass, replace

from gellight.base.errors import CameraError
from gellight.sensor.v4l2 import structures as v
from gellight.sensor.v4l2.controls import V4l2Controls
from gellight.sensor.v4l2.errors import LINUX, Kernel, explaining, no_camera
from gellight.sensor.v4l2.formats import RATE_TOLERANCE, Mode, Offer, Wanted, choose, not_offered, offers
from gellight.sensor.v4l2.stream import BUFFERS, Stream


@dataclass(frozen=True, kw_only=True)
class Identity:
    """What the driver reports about the device."""

    driver: str
    card: str


class Device(AbstractContextManager["Device"]):
    """An open device node; a context manager that closes it."""

    def __init__(self, path: str, *, kernel: Kernel = LINUX) -> None:
        """Open `path`; raises UnpluggedError, DeniedError, BusyError, or CameraError for what is no camera."""
        self.path = path
        self.kernel = kernel
        self._stream: Stream | None = None
        with explaining(path, "to open"):
            self._descriptor = self.kernel.open(path)
        try:
            self.identity = self._identify()
        except BaseException:
            self.kernel.close(self._descriptor)
            raise
        self.controls = V4l2Controls(self.ask, path)

    def ask(self, request: int, argument: Structure) -> None:
        """Do one ioctl; OSError as the kernel raises it, or of a descriptor that was closed."""
        if self._descriptor < 0:  # another thread may still hold the controls of a camera that was closed
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        self.kernel.ioctl(self._descriptor, request, argument)

    def _identify(self) -> Identity:
        """Ask what it is; CameraError for what delivers no pictures: a UVC camera's second node, for example."""
        found = v.Capability()
        with explaining(self.path, "to say what it is"):
            try:
                self.ask(v.QUERYCAP, found)
            except OSError as error:
                if error.errno == errno.ENOTTY:
                    raise CameraError(no_camera(self.path)) from error
                raise
        able = found.device_caps if found.capabilities & v.CAP_DEVICE_CAPS else found.capabilities
        needed = v.CAP_VIDEO_CAPTURE | v.CAP_STREAMING
        identity = Identity(driver=found.driver.decode(errors="replace"), card=found.card.decode(errors="replace"))
        if able & needed != needed:
            raise CameraError(
                f"{self.path} ({identity.card}) delivers no pictures: `gellight find` lists the nodes that do"
            )
        return identity

    def offers(self) -> tuple[Offer, ...]:
        """List what the camera offers."""
        with explaining(self.path, "to list its formats"):
            return offers(self.ask)

    def configure(self, wanted: Wanted) -> Mode:
        """Set format, size and rate and return them as they are now; CameraError lists the offers where none fits."""
        offered = self.offers()
        mode = choose(offered, wanted, path=self.path)
        picture = v.Format(type=v.CAPTURE)
        picture.fmt.pix.width, picture.fmt.pix.height = mode.width, mode.height
        picture.fmt.pix.pixelformat, picture.fmt.pix.field = v.code_of(mode.letters), v.FIELD_NONE
        with explaining(self.path, "to take a format"):
            self.ask(v.S_FMT, picture)
        pix = picture.fmt.pix
        if (v.fourcc(pix.pixelformat), pix.width, pix.height) != (mode.letters, mode.width, mode.height):
            raise CameraError(not_offered(offered, wanted, path=self.path))
        fps = self._set_rate(mode.fps)
        if wanted.fps and abs(fps - wanted.fps) > RATE_TOLERANCE * wanted.fps:
            raise CameraError(not_offered(offered, wanted, path=self.path))
        mode = replace(mode, fps=fps, line_bytes=0 if mode.letters == "MJPG" else pix.bytesperline)
        self.controls.period_us = 1e6 / mode.fps
        return mode

    def _set_rate(self, fps: float) -> float:
        """Ask for a rate (0: whatever it is) and return the one that holds."""
        parameters = v.StreamParameters(type=v.CAPTURE, numerator=1000, denominator=round(fps * 1000))
        with explaining(self.path, "to take a frame rate"):
            self.ask(v.S_PARM if fps else v.G_PARM, parameters)
        if not parameters.numerator or not parameters.denominator:
            raise CameraError(f"{self.path} does not report its frame rate: give one that it offers with ?fps=")
        return float(round(parameters.denominator / parameters.numerator, 3))

    def start(self, *, buffers: int = BUFFERS) -> Stream:
        """Start streaming in the configured mode; a stream that runs already is stopped first."""
        self.stop()
        self._stream = Stream(self.kernel, self._descriptor, self.ask, self.path, buffers=buffers)
        return self._stream

    def stop(self) -> None:
        """Stop streaming."""
        stream, self._stream = self._stream, None
        if stream is not None:
            stream.close()

    def close(self) -> None:
        """Stop and close; a second call does nothing."""
        if self._descriptor < 0:
            return
        try:
            self.stop()
        finally:
            descriptor, self._descriptor = self._descriptor, -1
            self.kernel.close(descriptor)

    def __exit__(self, *_: object) -> None:
        """Close the device."""
        self.close()
