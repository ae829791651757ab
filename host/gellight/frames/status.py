"""What a sensor says of itself: the records of every `status()`, key by key as they stand in JSON and on the wire."""

from typing import NotRequired, Required, TypedDict

from gellight.ring.heat import RingHeat


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


class FrameAge(TypedDict, total=False):
    """Time from the exposure to the finished depth map, ms; `{}` before the first frame."""

    median: float
    p95: float


class FrameCounts(TypedDict):
    """What became of the frames, and how fast they came."""

    frames: int
    fps: float
    frame_age_ms: FrameAge
    dropped: int
    lost: int
    repeated: int
    stage_ms: dict[str, float]
    """median wall time of each stage of the frame path"""


class ForceStatus(TypedDict):
    """Of the force in one frame, as `Force`; of the newest frame of a sensor with the largest value of its map."""

    normal_n: float
    error_n: float
    flags: tuple[str, ...]
    largest_pressure_mpa: NotRequired[float]


class TouchStatus(TypedDict):
    """What the newest frame feels."""

    indentation_mm: float
    area_mm2: float
    force: ForceStatus | None
    """None where the bundle has no constant for it"""


class CalibrationStatus(TypedDict):
    """Of the bundle in use."""

    sensor: str
    identity: str
    verified: dict[str, object] | None
    """its mean errors on fresh presses"""
    force: dict[str, float] | None
    """its constant and errors"""


class SensorStatus(PathStatus, FrameCounts):
    """Of a running sensor: all that is known of it."""

    sensor: str
    """URL"""
    touch: TouchStatus | None
    """None before the first frame, and without a calibration"""
    exposures: ExposuresStatus | None
    """of the newest frame; None where it is of one picture"""
    calibration: CalibrationStatus
    watch: WatchStatus | None
    ring: RingHeat | None
    """None without a light ring, and before it has said so"""
    tracking: bool
    recording: str | None
    """name of the file that is being written; None where nothing is recorded"""
    priority: str
    """of camera and reconstruction: `real time` or `as other programs`"""
    error: str | None
    camera: CameraStatus
