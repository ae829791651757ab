"""Reference simulator of a camera-based tactile sensor: NumPy and SciPy, pure functions, plain rather than fast.

The paper in nine files:

| paper | here |
|---|---|
| 2.1.1, 3.1: the sensor | `geometry.SensorGeometry` |
| 2.1.2: the benchmark objects | `objects.object_height` |
| 2.2.1: deformation of the gel | `gel.press`, placed under the pixels by `surface.sample` |
| 2.2.2, equation 2: directional light | `imaging.directional_image` |
| 2.2.2, equations 1 and 3: spot lights near the gel | `imaging.ring_irradiance` |
| 3.2.2: the camera | `camera.expose` |
| 2.3.1: photometric stereo | `photometric_stereo.solve_normals` |
| 2.3, equations 4 to 8 | `metrics` |
| depth from slopes | `integration.integrate` |

Where we differ from the paper: it deforms the gel by finite elements with contact; here the gel is an elastic layer of
small strain, which agrees with finite elements to some ten micrometres under the ball and is a hundred times faster.
"""
