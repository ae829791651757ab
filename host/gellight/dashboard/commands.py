"""What a page may ask of the server: frames, a press, a release. Everything else is answered with an error."""

from typing import Annotated, Literal

from pydantic import Field, TypeAdapter

from gellight.base.allowed import StrictModel
from gellight.frames.camera import PressStage


class Credit(StrictModel):
    """The page is ready to draw `count` more frames."""

    type: Literal["credit"]
    count: int = Field(ge=1, le=8)


class Press(StrictModel):
    """Press an object, or move and deepen the press that is there."""

    type: Literal["press"]
    object: str
    depth_mm: float = Field(ge=0)
    x_mm: float
    y_mm: float

    def check(self, stage: PressStage, view_mm: tuple[float, float]) -> None:
        """Raise ValueError where `stage` has no such object or depth, or the place is outside the view (w, h) in mm."""
        if self.object not in stage.objects:
            raise ValueError(f"no object {self.object!r}: choose one of {', '.join(stage.objects)}")
        if self.depth_mm > stage.max_depth_mm:
            raise ValueError(f"depth_mm = {self.depth_mm:g} is too deep: choose 0 to {stage.max_depth_mm:g}")
        for axis, value, size in zip("xy", (self.x_mm, self.y_mm), view_mm, strict=True):
            if abs(value) > size / 2:
                raise ValueError(f"{axis}_mm = {value:g} is outside the view: choose -{size / 2:g} to {size / 2:g}")


class Release(StrictModel):
    """Lift the object off the gel."""

    type: Literal["release"]


class Track(StrictModel):
    """Follow the object that touches, or no more; in a simulated gel one moves by itself meanwhile."""

    type: Literal["track"]
    on: bool


COMMANDS: TypeAdapter[Credit | Press | Release | Track] = TypeAdapter(
    Annotated[Credit | Press | Release | Track, Field(discriminator="type")]
)
