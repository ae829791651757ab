"""Tactile frames with any part that a frame may have, drawn by Hypothesis; and whether two say the same."""

from collections.abc import Collection
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from hypothesis import strategies as st

from gellight.frames.frames import (
    CameraFrame,
    Contact,
    ExposureReport,
    LightLabel,
    LightState,
    Patch,
    Provenance,
    TactileFrame,
)
from gellight.frames.measures import Force
from gellight.frames.pose import ObjectPose
from gellight.frames.shear import MOST_DOTS, DotsSeen, Shear, Slip, SlipState, Unseen

floats = st.floats(-1e6, 1e6)
pairs = st.tuples(floats, floats)
words = st.text(st.characters(codec="utf-8"), max_size=8)
flags = st.lists(words, max_size=2).map(tuple)
numbers = st.integers(0, 2**31)


def array(kind: Any, *shape: int) -> st.SearchStrategy[Any]:
    """Draw an array by the seed of its numbers: as good for what travels, and a hundred times as quick."""
    return numbers.map(
        lambda seed: (
            (np.random.default_rng(seed).normal(0, 100, shape))
            .astype(np.int64 if np.dtype(kind).kind == "u" else kind)
            .astype(kind)
        )
    )


@st.composite
def _shears(draw: st.DrawFn, dots: DotsSeen) -> Shear:
    seen = dots.seen[:, None]
    field = np.where(seen, draw(array(np.float64, len(seen), 2)).round(4), np.nan)
    some = {name: draw(st.none() | kind) for name, kind in {
        "force_n": pairs, "force_error_n": pairs, "torque_nmm": floats, "torque_error_nmm": floats, "centre_mm": pairs,
    }.items()}  # fmt: skip
    return Shear(dots=dots, field_mm=field, flags=draw(flags), unknown=draw(words), **some)


@st.composite
def _dots(draw: st.DrawFn) -> DotsSeen:
    count = draw(st.integers(0, 4) | st.just(MOST_DOTS))
    places = [draw(array(np.float64, count, 2)).round(3) for _ in range(2)]
    reasons = np.array(list(Unseen), np.uint8)[draw(array(np.uint8, count)) % len(Unseen)]
    return DotsSeen(rest_px=places[0], places_px=places[1], reasons=reasons, problem=draw(words))


@st.composite
def _poses(draw: st.DrawFn) -> ObjectPose:
    number, since = draw(numbers), draw(numbers)
    if draw(st.booleans()):  # it is lost
        lost = {name: np.full(shape, np.nan) for name, shape in {"motion": (4, 4), "centre_mm": 3}.items()}
        none = {"covariance": np.full((6, 6), np.nan), "untellable": np.zeros((0, 6))}
        return ObjectPose(number=number, since_sequence=since, origin_mm=draw(array(np.float64, 3)), **lost, **none)
    motion = np.vstack([draw(array(np.float64, 3, 4)), [0, 0, 0, 1]])
    return ObjectPose(
        number=number, since_sequence=since, motion=motion, origin_mm=draw(array(np.float64, 3)),
        centre_mm=draw(array(np.float64, 3)), covariance=draw(array(np.float64, 6, 6)),
        untellable=draw(array(np.float64, draw(st.integers(0, 6)), 6)),
    )  # fmt: skip


patches = st.builds(
    Patch, centroid_mm=pairs, depth_mm=floats, area_mm2=floats, volume_mm3=floats, slope_rad=floats, number=numbers,
    age_s=floats, velocity_mm_s=st.none() | pairs,
)  # fmt: skip
slips = st.builds(Slip, state=st.sampled_from(SlipState), confidence=floats, velocity_mm_s=st.none() | pairs, why=words)
labels = st.builds(LightLabel, state=st.sampled_from(LightState), group=st.none() | st.integers(0, 15))
provenances = st.builds(
    Provenance, calibration=words, zero=words, pixel_size_mm=pairs, unix_s=st.floats(0, 1e10),
    ages_s=st.dictionaries(st.sampled_from(["taken", "reconstructed"]), floats), findings=flags, dropped=numbers,
)  # fmt: skip


@st.composite
def tactile_frames(draw: st.DrawFn) -> TactileFrame:
    """Draw a frame of a daemon: maps of some pixels, and each part that may be missing or there."""
    shape = draw(st.integers(1, 5)), draw(st.integers(1, 7))
    maybe = lambda kind: draw(st.none() | kind)  # noqa: E731
    dots = maybe(_dots())
    picture = CameraFrame(
        image=draw(array(np.uint8, *shape, 3)), time_s=draw(floats), sequence=draw(st.integers(0, 2**40)),
        source=draw(words), light=maybe(array(np.uint8, 12, 3)), label=maybe(labels), dots=dots,
    )  # fmt: skip
    report = st.builds(
        ExposureReport, exposures=numbers, duration_s=floats, moved=st.booleans(), repetition_grey=floats,
        repetition_limit_grey=floats, misfit=floats, lights=array(np.uint8, *shape), moving=array(np.bool_, *shape),
        least_lights=numbers,
    )  # fmt: skip
    contact = st.builds(
        Contact, mask=array(np.bool_, *shape), area_mm2=floats, indentation_mm=floats, centroid_mm=st.none() | pairs
    )
    frame = TactileFrame(
        camera_frame=picture, difference=np.zeros((*shape, 3), np.float32), depth_mm=draw(array(np.float32, *shape)),
        gradient_map=draw(array(np.float32, *shape, 2)), contact=draw(contact), slip=maybe(slips),
        contacts=tuple(draw(st.lists(patches, max_size=3))), pose=maybe(_poses()), exposures=maybe(report),
        stage_seconds=draw(st.dictionaries(words, floats, max_size=3)), provenance=draw(provenances),
    )  # fmt: skip
    force = st.builds(Force, normal_n=floats, error_n=floats, flags=flags, pressure_of=st.just(lambda: None))
    vars(frame).update(force=maybe(force), shear=draw(_shears(dots)) if dots and draw(st.booleans()) else None)
    return frame


def check_same(one: Any, other: Any, where: str = "frame", *, but: Collection[str] = ()) -> None:
    """Compare everything but the fields of these names, and what is computed when it is asked for."""
    if isinstance(one, np.ndarray):
        assert (one.dtype, one.shape) == (other.dtype, other.shape), where
        assert np.array_equal(one, other, equal_nan=one.dtype.kind == "f"), where
    elif is_dataclass(one):
        names = {field.name for field in fields(one)} - {"pressure_of", "traction_of"} - set(but)
        names |= {"force", "shear"} if isinstance(one, TactileFrame) else set()
        for name in sorted(names - set(but)):
            check_same(getattr(one, name), getattr(other, name), f"{where}.{name}", but=but)
    else:
        assert one == other, where
