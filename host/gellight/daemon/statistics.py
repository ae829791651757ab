"""What the daemon counts: frames delivered, lost and dropped, their rate and their age."""

from collections import deque

import numpy as np

from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.frames.status import FrameAge, FrameCounts

WINDOW_S = 3.0
"""rates are taken over this long"""


class Statistics:
    """Counts over the whole run, and rates over the last seconds."""

    def __init__(self) -> None:
        """Start at zero."""
        self._captured = 0
        self._delivered = 0
        self._lost = 0
        self._repeated = 0
        self._last_sequence: int | None = None
        self._recent: deque[tuple[float, int]] = deque(maxlen=1000)
        self._ages_s: deque[float] = deque(maxlen=300)
        self._stages: dict[str, deque[float]] = {}

    def note_captured(self, frame: CameraFrame) -> None:
        """Count a camera frame; a gap in the sequence numbers is lost frames, a repetition is no new frame."""
        self._captured += 1
        if self._last_sequence is not None:
            step = frame.sequence - self._last_sequence
            self._repeated += step <= 0
            self._lost += max(step - 1, 0)
        self._last_sequence = frame.sequence

    def note_delivered(self, frame: TactileFrame, now_s: float) -> None:
        """Count a tactile frame that was ready at `now_s`, seconds of `time.monotonic`."""
        self._delivered += 1
        self._ages_s.append(now_s - frame.camera_frame.time_s)
        self._recent.append((now_s, frame.camera_frame.sequence))
        for stage, seconds in frame.stage_seconds.items():
            self._stages.setdefault(stage, deque(maxlen=100)).append(seconds)

    def fps(self, now_s: float) -> float:
        """Tactile frames per second, from the distinct camera sequence numbers of the last seconds."""
        recent = [(t, sequence) for t, sequence in list(self._recent) if now_s - t <= WINDOW_S]
        if len(recent) < 2:
            return 0.0
        return (len({sequence for _, sequence in recent}) - 1) / (recent[-1][0] - recent[0][0])

    def frame_age_ms(self) -> FrameAge:
        """Median and 95th percentile of the time from the exposure to the finished depth map."""
        if not self._ages_s:
            return {}
        median, p95 = np.percentile(np.array(list(self._ages_s)) * 1e3, [50, 95])
        return {"median": round(float(median), 2), "p95": round(float(p95), 2)}

    def as_json(self, now_s: float) -> FrameCounts:
        """All of it, ready for JSON; times in ms are medians of wall time."""
        stages = {name: float(np.median(list(seconds))) * 1e3 for name, seconds in list(self._stages.items())}
        return {
            "frames": self._delivered,
            "fps": round(self.fps(now_s), 2),
            "frame_age_ms": self.frame_age_ms(),
            "dropped": max(self._captured - self._delivered, 0),
            "lost": self._lost,
            "repeated": self._repeated,
            "stage_ms": {name: round(ms, 2) for name, ms in stages.items()},
        }
