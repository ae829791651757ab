"""What a calibration needs, for the check list of the wizard before it begins."""

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict

from gellight.base.errors import GellightError
from gellight.daemon.session import SensorSession
from gellight.lab.calibration.readiness import check_room


class Need(BaseModel):
    """One line of the check list."""

    model_config = ConfigDict(frozen=True)

    name: str
    state: Literal["ready", "missing", "yours"]
    """missing: the calibration would stop; yours: only the user can see to it"""
    text: str


def needs(daemon: SensorSession, folder: Path, presses: int) -> tuple[Need, ...]:
    """Return the check list of a calibration that keeps this number of presses in `folder`."""
    return (*_tools(daemon), _light(daemon), _camera(daemon), _room(daemon, folder, presses))


def _tools(daemon: SensorSession) -> tuple[Need, ...]:
    if daemon.stage is not None:
        return (Need(name="ball and cylinder", state="ready", text="the virtual hand has them"),)
    return (
        Need(name="ball", state="yours", text="smooth and hard, its radius known to 0.01 mm"),
        Need(name="cylinder", state="yours", text="with a flat end, its diameter known to 0.01 mm"),
        Need(name="gel", state="yours", text="clean, nothing on it, warm for a quarter of an hour"),
    )


def _light(daemon: SensorSession) -> Need:
    if daemon.camera.ring is None:
        return Need(name="light", state="yours", text="it cannot be driven from here: keep it as it is")
    return Need(name="light", state="ready", text=f"the ring of {daemon.camera.ring.led_count} LEDs answers")


def _camera(daemon: SensorSession) -> Need:
    status = daemon.status()
    fps, problem = status["fps"], status["error"]
    if problem:
        return Need(name="camera", state="missing", text=str(problem))
    if not fps:
        return Need(name="camera", state="missing", text="no frame comes: check its cable")
    return Need(name="camera", state="ready", text=f"{fps:.0f} frames a second")


def _room(daemon: SensorSession, folder: Path, presses: int) -> Need:
    try:
        free_bytes = check_room(folder, daemon.camera.image_shape, presses)
    except GellightError as error:
        return Need(name="disk", state="missing", text=str(error))
    return Need(name="disk", state="ready", text=f"{free_bytes / 1e9:.1f} GB free")
