"""Open a sensor in this program: the LEDs are lit as its calibration says, and dark again at the end."""

import gellight

with gellight.connect("sim://?programme=0") as sensor:
    sensor.press("BALL", depth_mm=1.0)
    deepest = max((sensor.next_frame() for _ in range(5)), key=lambda frame: frame.contact.indentation_mm)
    print(f"{deepest.contact.indentation_mm:.2f} mm deep at {deepest.contact.centroid_mm}")
    print(f"steepest slope {abs(deepest.gradient_map).max():.2f}, normals {deepest.normal_map.shape}")
