"""A JSON file that a calibration bundle may hold beside its own: read, and checked against the bundle."""

from typing import Annotated, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from gellight.base.allowed import explained
from gellight.base.errors import BundleError
from gellight.bundle.bundle import Bundle


class BundleFile(BaseModel):
    """What every such file says; an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    schema_version: Literal[1] = 1


class PictureFile(BundleFile):
    """What a file says that goes with pictures of one size."""

    image_width_px: Annotated[int, Field(ge=2)]
    image_height_px: Annotated[int, Field(ge=2)]


Content = TypeVar("Content", bound=BundleFile)


def read_bundle_file(bundle: Bundle, name: str, model: type[Content], remedy: str) -> Content:
    """Return the file `name` of a bundle that has it; BundleError where it is damaged or of another picture size.

    remedy: how to make the file anew, for the message.
    """
    with explained(lambda wrong: BundleError(f"{bundle.source}: {name}: {wrong}; {remedy}")):
        content = model.model_validate_json(bundle.files[name])
    height, width = bundle.image_shape
    if isinstance(content, PictureFile) and (content.image_height_px, content.image_width_px) != (height, width):
        raise BundleError(
            f"{bundle.source}: {name} is for {content.image_width_px} x {content.image_height_px} px, "
            f"the bundle for {width} x {height} px; {remedy}"
        )
    return content
