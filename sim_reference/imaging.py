"""How the gel is lit: equations 1 to 3 of the paper, with attached and cast shadows.

The coating is Lambertian. Equation 2, directional light, serves the coarse study of the incident angle; equation 3, a
spot light near the gel, is the sensor itself. An LED at distance d gives a surface point with normal n the irradiance

    E = max(0, cos a)^m  max(0, n . l)  (h / d)^2

where l points to the LED, a is the angle between -l and the LED's axis, m follows from the beam angle, and h is the
LEDs' height above the gel: the unit is what an LED straight above, shining straight down, would give without a window.
"""

from math import isclose

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from sim_reference import view
from sim_reference.geometry import WHOLE, Box, SensorGeometry, led_axes, led_positions, pixel_grid
from sim_reference.refraction import VACUUM, Medium, medium_of, trace
from sim_reference.surface import Surface

Array = NDArray[np.float64]
SHADOW_PITCH_PX = 2.0
"""of the polar grid on which cast shadows are found; their edges are sharp to this much"""
SHADOW_TOLERANCE_MM = 1e-3
"""a point this far below a grazing ray counts as shadowed; less is the error of interpolating the surface"""


def ring_light(geometry: SensorGeometry) -> Array:
    """(N, 3) the light of the ring as designed: each LED full on in its own colour."""
    return np.array([[float(colour == channel) for channel in "RGB"] for colour in geometry.led_colours])


def normals(gradient_map: Array) -> Array:
    """(..., 2) -> (..., 3): the unit normal (-dz/dx, -dz/dy, 1) / norm, towards the camera."""
    normal = np.concatenate([-gradient_map, np.ones_like(gradient_map[..., :1])], axis=-1)
    return np.asarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True))


def directional_image(gradient_map: Array, direction: Array, albedo: float = 1.0) -> Array:
    """Equation 2: (H, W) picture under light from the unit vector `direction`, with attached shadows."""
    return np.asarray(albedo * np.maximum(normals(gradient_map) @ direction, 0.0))


def ring_irradiance(surface: Surface, geometry: SensorGeometry, light: Array, box: Box = WHOLE) -> Array:
    """Equation 3 summed over the ring: (h, w, 3) light in each colour on the pixels of `box`.

    `light` (N, 3) is the brightness of each LED in R, G, B, 0 to 1; dark LEDs cost nothing.
    """
    lit = [led for led in range(len(light)) if light[led].any()]
    total = np.zeros((3, *surface.depth_mm[box].shape), surface.depth_mm.dtype)
    for led in lit:
        irradiance = led_irradiance(surface, geometry, led, box)
        for channel in np.flatnonzero(light[led]):
            total[channel] += irradiance * float(light[led, channel])
    return np.ascontiguousarray(np.moveaxis(total, 0, 2))


def led_irradiance(surface: Surface, geometry: SensorGeometry, led: int, box: Box = WHOLE) -> Array:
    """Equation 3 for one LED: (h, w) irradiance on the pixels of `box`, shadows and what the view takes included."""
    depth, position, medium = surface.depth_mm[box], led_positions(geometry)[led], medium_of(geometry)
    x, y = view.places(surface.depth_mm, geometry, box)
    irradiance, facing = direct_light(geometry, led, x, y, depth, surface.gradient_map[box])
    # A smooth surface casts a shadow only if somewhere it turns away from the light, and not far from there.
    span = depth.max() - depth.min()
    if facing.min() < 0 < span:
        away = np.hypot(position[0] - x, position[1] - y).max()
        reach = span * (np.hypot(away / position[2], 1) + view.most_oblique(geometry))
        shaded = around(facing < 0, int(np.ceil(reach / geometry.pixel_size_mm)))
        axis_x, axis_y = (axis.ravel().astype(depth.dtype) for axis in pixel_grid(geometry))
        axes = axis_x[box[1]][shaded[1]], axis_y[box[0]][shaded[0]]
        if surface.relief_mm is None:
            irradiance[shaded] *= visibility(depth[shaded], axes, position, medium)
        else:
            seen = x[shaded], y[shaded]
            irradiance[shaded] *= visibility(surface.relief_mm[box][shaded], axes, position, medium, seen)
    if geometry.perspective:
        irradiance *= view.falloff(geometry)[box]
    return np.asarray(irradiance)


def direct_light(
    geometry: SensorGeometry, led: int, x: Array, y: Array, depth_mm: Array, slopes: Array
) -> tuple[Array, Array]:
    """Equation 3 for one LED, but for cast shadows and what the view takes: (...) irradiance at points of the gel.

    slopes: (..., 2). Also returns the way to the LED along the normal, which is negative where the gel turns away.
    """
    led_x, led_y, led_z = led_positions(geometry)[led].tolist()
    to_x, to_y = led_x - x, led_y - y
    arriving, to_z = arriving_light(geometry, led, to_x, to_y, depth_mm, medium_of(geometry))
    facing = to_z - slopes[..., 0] * to_x - slopes[..., 1] * to_y
    upright = 1 / np.sqrt(1 + slopes[..., 0] ** 2 + slopes[..., 1] ** 2)
    return led_z**2 * upright * np.maximum(facing, 0) * arriving, facing


def arriving_light(
    geometry: SensorGeometry, led: int, to_x: Array, to_y: Array, depth_mm: Array | float, medium: Medium
) -> tuple[Array, Array]:
    """Return g and to_z at points of the gel, so that an LED h above it brings h^2 g (to_x, to_y, to_z) . n to them.

    `to_x` and `to_y` lead from the points to the LED, `to_z` to where it seems to stand above them: where it stands, if
    the medium is none. There g = max(0, cos a)^m / d^3. Else the flux F on a horizontal mm^2 per intensity makes
    g = max(0, cos a)^m F / to_z, with the angle a between the LED's axis and the ray that leaves it.
    """
    led_z = geometry.camera_height_mm - geometry.mounting_height_mm
    axis_x, axis_y, axis_z = led_axes(geometry)[led].tolist()
    if medium.refractive_index == 1:
        to_z = led_z - depth_mm
        squared = to_x**2 + to_y**2 + to_z**2
        leaving = np.maximum(-(to_x * axis_x + to_y * axis_y + to_z * axis_z), 0)
        if isclose(geometry.emission_exponent, 1):
            return leaving / squared**2, np.asarray(to_z)
        return (leaving / np.sqrt(squared)) ** geometry.emission_exponent / squared**1.5, np.asarray(to_z)
    rays = trace(np.sqrt(to_x * to_x + to_y * to_y), led_z, medium, depth_mm)  # a fifth of the time of hypot
    leaving = -(to_x * axis_x + to_y * axis_y) / rays.below_mm - axis_z
    emitted = np.maximum(leaving * rays.leaving_cos, 0)
    if not isclose(geometry.emission_exponent, 1):
        emitted = emitted**geometry.emission_exponent
    return emitted * rays.flux / rays.above_mm, rays.above_mm


def around(marked: NDArray[np.bool_], margin: int) -> Box:
    """Return the rows and columns that hold all marked pixels and a margin around them."""
    spans = (np.flatnonzero(marked.any(axis=axis)) for axis in (1, 0))
    rows, columns = (slice(max(int(span[0]) - margin, 0), int(span[-1]) + 1 + margin) for span in spans)
    return rows, columns


def visibility(
    depth_mm: Array,
    axes: tuple[Array, Array],
    led_mm: Array,
    medium: Medium = VACUUM,
    seen_mm: tuple[Array, Array] | None = None,
) -> Array:
    """Cast shadows: (h, w) share of each pixel that sees the point light at `led_mm`, 0 or 1 but for edge pixels.

    Seen from the point below the light, a surface point at distance r and height z is hidden when a nearer point rises
    above the ray from the light to it. With the slope s(r) = (z_led - z) / r at which that ray leaves the light, the
    steeper the lower it goes, this says: hidden when s(r) exceeds the smallest slope at a smaller r. One running
    minimum along the rays of a polar grid finds every shadow. Behind a window z is where the point seems to lie, seen
    from the light.

    The surface is given on `axes`; `seen_mm` are the places x, y of its points that the pixels see, by default those.
    """
    x, y = (axis.astype(np.float64) for axis in axes)
    spacing = (x[-1] - x[0]) / (len(x) - 1)
    radius, angle = polar_grid(x, y, led_mm, SHADOW_PITCH_PX * spacing)
    columns = (led_mm[0] + radius[None, :] * np.cos(angle)[:, None] - x[0]) / spacing
    rows = (led_mm[1] + radius[None, :] * np.sin(angle)[:, None] - y[0]) / spacing
    height = map_coordinates(depth_mm, [rows, columns], order=1, mode="nearest")
    slope = trace(radius[None, :], led_mm[2], medium, height).below_mm / radius
    nearest = np.minimum.accumulate(slope, axis=1)
    lit = ((slope - nearest) * radius <= SHADOW_TOLERANCE_MM).astype(np.float32)
    seen_x, seen_y = seen_mm or (x[None, :], y[:, None])
    away_x, away_y = seen_x - led_mm[0], seen_y - led_mm[1]
    at_radius = (np.hypot(away_x, away_y) - radius[0]) / (radius[1] - radius[0])
    turned = (np.arctan2(away_y, away_x) - angle[0]) % (2 * np.pi)
    at_angle = turned / (angle[1] - angle[0])
    return np.asarray(map_coordinates(lit, [at_angle, at_radius], order=1, mode="nearest"))


def polar_grid(x: Array, y: Array, led_mm: Array, pitch: float) -> tuple[Array, Array]:
    """Return radii, mm, and angles about the light's foot point that cover the box with axes x, y, `pitch` mm apart."""
    corners_x = np.array([x[0], x[-1], x[-1], x[0]]) - led_mm[0]
    corners_y = np.array([y[0], y[0], y[-1], y[-1]]) - led_mm[1]
    far = np.hypot(corners_x, corners_y).max()
    outside_x = max(x[0] - led_mm[0], led_mm[0] - x[-1], 0.0)
    outside_y = max(y[0] - led_mm[1], led_mm[1] - y[-1], 0.0)
    near = max(np.hypot(outside_x, outside_y), pitch)
    radius = np.arange(near, far + 2 * pitch, pitch)
    if outside_x == outside_y == 0:
        first, last = -np.pi, np.pi
    else:
        middle = np.arctan2(corners_y.mean(), corners_x.mean())
        spread = (np.arctan2(corners_y, corners_x) - middle + np.pi) % (2 * np.pi) - np.pi
        first, last = middle + spread.min() - 2 * pitch / far, middle + spread.max() + 2 * pitch / far
    count = int(np.ceil((last - first) * far / pitch)) + 1
    return radius, np.linspace(first, last, max(count, 2))
