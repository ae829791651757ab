"""Step 5: the network is trained on the ball presses, in a child process, and kept as a draft of the bundle."""

from pathlib import Path
from typing import Any

from gellight.base.errors import InputError
from gellight.calibration.choices import LEAST_PRESSES
from gellight.calibration.pressing import ball_of
from gellight.calibration.session import Session
from gellight.training import training
from gellight.training.presses import TableOptions
from gellight.training.training import Reference

DRAFT = "draft"
TABLE = TableOptions(inset_px=2.0, flat_distance=3.0, flat_share=1.0)
"""The coating rounds the rim of the contact, so a wider ring is left out than a circle that is a pixel off asks for.
Soft gel slopes a little even two radii away, so only what is farther counts as flat, and there is much of it."""


def draft_path(session: Session) -> Path:
    """Return where the draft of the bundle lies."""
    return session.folder.path / DRAFT


def fit(session: Session) -> None:
    """Train on the presses and keep the draft."""
    presses = session.folder.listed("presses")
    if len(presses) < LEAST_PRESSES:
        raise InputError(f"{len(presses)} presses are too few to fit: at least {LEAST_PRESSES} are needed")
    session.bulletin.post(instruction="The network is being trained. Nothing is to be done.", actions=("abort",))
    losses: list[float] = []

    def report(epoch: int, epochs: int, loss: float) -> None:
        session.asked()  # an abort ends the child
        losses.append(loss)
        session.bulletin.post(progress={"done": epoch, "wanted": epochs, "unit": "epochs", "loss": loss})

    taken = session.folder.steps["reference"]
    bundle = training.fit(
        presses,
        Reference(image=session.folder.reference(), frames=taken["frames"], noise_grey=taken["noise_grey"]),
        ball_of(session),
        draft_path(session),
        sensor=session.options.sensor,
        options=session.options.training,
        table_options=TABLE,
        overwrite=True,
        progress=report,
    )
    figures: dict[str, Any] = {**bundle.metrics, "losses": losses}
    session.folder.finish("fit", figures)
