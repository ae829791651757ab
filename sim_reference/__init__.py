"""Reference simulator of a camera-based tactile sensor: NumPy and SciPy, pure functions, plain rather than fast.

The paper in its order; `optimizer` continues with sections 2.3 and 3.1:

| paper | here |
|---|---|
| 2.1.1, 3.1: the sensor | `geometry.SensorGeometry` |
| 2.1.2: the benchmark objects | `objects.object_height` |
| 2.2.1: deformation of the gel | `fem.gel.FemGel` or `gel.press`; placed under the pixels by `surface.sample` |
| 2.2.2, equation 1: Lambert, so f_BRDF is the albedo | in equations 2 and 3 |
| equation 2: directional light | `imaging.directional_image` |
| equation 3: spot lights near the gel | `imaging.led_irradiance`, summed by `imaging.ring_irradiance` |
| 3.2.2: the camera | `camera.expose` |
| beyond: light and view bent by the window, Fresnel losses | `refraction` |
| beyond: the camera as a pinhole | `view` |
| 2.3.1: photometric stereo | `photometric_stereo.solve_normals` |
| equation 4: MAE | `metrics.mean_angular_error` |
| equation 5: MAE_Top5, MAE_Top1 | `metrics.mean_of_largest` |
| equation 6: deviation of the intensity | `metrics.intensity_deviation` |
| equation 7: NSD and SAT | `metrics.normalised_deviation`, `metrics.saturation` |
| equation 8: largest elevation angle of a ball | `metrics.maximum_elevation` |
| depth from slopes | `integration.integrate` |

The paper deforms the gel by finite elements with contact. So does `fem.gel.FemGel`; the default is `gel.press`, an
elastic layer of small strain, which is a hundred times faster. Either is `surface.press_object(..., model=...)`.
"""
