"""The maps of a frame as one .npz file."""

import io
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.frames.frames import TactileFrame


def maps_file(frame: TactileFrame, findings: Sequence[str] = ()) -> bytes:
    """Return the content of an .npz file with the maps of a frame and what is known against it."""
    content = io.BytesIO()
    maps: dict[str, NDArray[Any]] = {
        "gradient_map": frame.gradient_map,
        "normal_map": frame.normal_map,
        "depth_mm": frame.depth_mm,
        "contact": frame.contact.mask,
        "findings": np.array(findings, np.str_),
    }
    maps |= frame.maps_on_request()
    if bounds := frame.error_bounds:
        maps |= {"normal_error_deg": bounds.normal_deg, "shape_error_mm": bounds.shape_mm}
    if frame.force:
        maps |= {"force_n": np.array(frame.force.normal_n), "force_error_n": np.array(frame.force.error_n)}
    np.savez(content, **maps)  # type: ignore[arg-type]
    return content.getvalue()
