"""The illumination optimiser of section 2.3, and what lies beyond it.

| paper | here |
|---|---|
| 2.1.2: the benchmark, pressed into the gel | `benchmark.press_benchmark` |
| 2.3.1, 3.1.1: number of lights and incident angle | `coarse.evaluate` |
| shadows cast by the surface on itself | `shadows.horizon` |
| 2.3.2, 3.1.2: mounting height, equations 6 and 7 | `fine.illumination` |
| the same heights judged by what is reconstructed | `near_field.normal_error` |
| equation 8: the calibration ball | `ball.elevation_table` |
| beyond: angle, height, number and exposure at once | `design.optimise` |
"""
