"""A JSON file that a calibration bundle may hold beside its own: read, and checked against the bundle."""

from typing import Annotated, ClassVar, Literal, Self

from pydantic import BaseModel, ConfigDict, Field

from gellight.base.allowed import explained
from gellight.base.errors import BundleError
from gellight.bundle.bundle import Bundle


class BundleFile(BaseModel):
    """What every such file says; an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    file_name: ClassVar[str]
    remedy: ClassVar[str]
    """how to make the file anew, for messages"""
    schema_version: Literal[1] = 1

    @classmethod
    def in_bundle(cls, bundle: Bundle) -> Self | None:
        """Return the file of a bundle, None where it has none; BundleError where it is damaged or does not fit."""
        if cls.file_name not in bundle.files:
            return None
        with explained(lambda wrong: BundleError(f"{bundle.source}: {cls.file_name}: {wrong}; {cls.remedy}")):
            content = cls.model_validate_json(bundle.files[cls.file_name])
        content.check_fits(bundle)
        return content

    def check_fits(self, bundle: Bundle) -> None:
        """Raise BundleError where it is of another picture size than its bundle."""

    def files(self) -> dict[str, bytes]:
        """Return it as a file of a bundle, by its name."""
        return {self.file_name: (self.model_dump_json(indent=1) + "\n").encode()}


class PictureFile(BundleFile):
    """What a file says that goes with pictures of one size."""

    image_width_px: Annotated[int, Field(ge=2)]
    image_height_px: Annotated[int, Field(ge=2)]

    def check_fits(self, bundle: Bundle) -> None:
        """Raise BundleError where it is of another picture size than its bundle."""
        height, width = bundle.image_shape
        if (self.image_height_px, self.image_width_px) != (height, width):
            raise BundleError(
                f"{bundle.source}: {self.file_name} is for {self.image_width_px} x {self.image_height_px} px, "
                f"the bundle for {width} x {height} px; {self.remedy}"
            )
