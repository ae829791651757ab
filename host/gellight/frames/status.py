"""What a sensor says of itself: the records of every `status()`, key by key as they stand in JSON and on the wire."""

from typing import Required, TypedDict


class LightSequenceStatus(TypedDict):
    """Of a camera whose light follows a sequence: the mode, and how many frames were clean, mixed or unknown."""

    light_mode: str
    groups: int
    frames_per_light: int
    clean: int
    mixed: int
    unknown: int
    trims: int


class CameraStatus(TypedDict, total=False):
    """Of a camera; one has the keys of its kind, and `{}` where nothing is known."""

    name: str
    node: str
    """path of its device"""
    connection: str
    """connected or reconnecting"""
    reconnecting_s: float | None
    why: str | None
    """it is away"""
    reconnections: int
    mode: str | None
    card: str
    delivered: int
    skipped: int
    lost: int
    duplicated: int
    identical: int
    damaged: int
    corrupt: int
    wrong_stamps: int
    """what became of pictures, see `v4l2.stream.Counts`"""
    recording: str
    """path of what is replayed, whether it is whole, and how fast"""
    whole: bool
    speed: float
    light_sequence: LightSequenceStatus


class PressStatus(TypedDict):
    """Of a stage: what is pressed now, mm from the image centre."""

    object: str
    depth_mm: float
    x_mm: float
    y_mm: float
    visitor: bool
    """someone presses, not the programme"""
    preparing: str
    """the object whose press is being computed, "" for none"""


class ExposuresStatus(TypedDict):
    """Of a series of exposures, as `ExposureReport`."""

    exposures: int
    duration_s: float
    moved: bool
    repetition_grey: float
    repetition_limit_grey: float
    misfit: float
    moving: float
    """share of the pixels whose picture changed meanwhile"""
    guessed: float
    """share of the pixels that saw too few lights"""


class PathStatus(TypedDict, total=False):
    """Of a frame path: its mode, and what else it knows."""

    mode: Required[str]
    computed_by: str
    exposures: ExposuresStatus | None
    lights: int
    groups_with_depth: list[int]


class FindingStatus(TypedDict):
    """What the watch has found, as `WatchFinding`."""

    kind: str
    severity: str
    text: str
    figures: dict[str, object]


class WatchStatus(TypedDict):
    """Of the watch."""

    state: str
    looks: int
    findings: list[FindingStatus]
    expected: dict[str, float] | None
    """as `ExpectedError`"""
    change_grey: float | None
    gains: list[float] | None
    zeros: int
    look_ms: float | None
