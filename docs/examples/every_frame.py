"""Miss no frame: save the depth of ten frames in a row, and say how many were lost on the way."""

import itertools
import sys

import numpy as np

import gellight

name = sys.argv[1] if sys.argv[1:] else "auto"
with gellight.subscribe(name, wait_s=60, every=True) as frames:
    taken = list(itertools.islice(frames, 10))
np.savez_compressed(
    "ten_frames.npz",
    depth_mm=np.stack([frame.depth_mm for frame in taken]),
    time_s=[frame.camera_frame.time_s for frame in taken],
)
print(f"saved {len(taken)} frames, {sum(frame.provenance.dropped for frame in taken)} lost in between")
