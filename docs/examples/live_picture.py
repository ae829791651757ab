"""Show the depth as it is felt, until the window is closed; needs `pip install matplotlib`."""

import sys

import matplotlib.pyplot as plt

import gellight

sys.tracebacklimit = 0  # errors in one line
name = sys.argv[1] if sys.argv[1:] else "auto"
with gellight.subscribe(name, wait_s=60) as frames:
    picture = plt.imshow(frames.next_frame().depth_mm, vmin=0, vmax=1)
    plt.colorbar(label="depth, mm")
    while plt.get_fignums():
        picture.set_data(frames.next_frame().depth_mm)
        plt.pause(0.01)
