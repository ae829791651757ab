"""A gripper lifts a ball by the friction of its two gels; give a file name for a film of it: `lift.py lift.webp`."""

import sys

import cv2
import mujoco
import numpy as np

from gellight.lab.report.pictures import depth_picture
from gellight_touch import GRIPPER, TouchSensor
from gellight_touch.mujoco_carry import Carrying
from gellight_touch.mujoco_gels import MujocoGels

model = mujoco.MjModel.from_xml_path(str(GRIPPER))
data = mujoco.MjData(model)
carry = Carrying(
    MujocoGels(model, ["left", "right"], touching=["object"], sensor=lambda: TouchSensor(size=64, extent_mm=32))
)
gel, film = carry.gels["left"], []


def seen(width: int = 240, height: int = 240) -> np.ndarray:
    """Draw the gripper from the front by MuJoCo's rays, brighter where a surface faces the eye."""
    eye = np.array([0.0, -0.5, 0.045])
    across, up = np.meshgrid(np.linspace(-0.12, 0.12, width), np.linspace(0.12, -0.12, height))
    rays = np.stack([across, np.ones_like(across), up], axis=-1).reshape(-1, 3)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    geoms, far, normals = np.zeros(len(rays), np.int32), np.zeros(len(rays)), np.zeros(rays.size)
    mujoco.mj_multiRay(model, data, eye, rays.ravel(), None, True, -1, geoms, far, normals, len(rays), 10.0)
    facing = np.abs((normals.reshape(-1, 3) * rays).sum(axis=1, keepdims=True))
    colours = np.array([[150, 150, 150], [90, 110, 150], [90, 110, 150], [90, 110, 150], [230, 140, 40]])
    drawn = np.where(geoms[:, None] < 0, 250, colours[geoms] * (0.35 + 0.65 * facing))
    return drawn.astype(np.uint8).reshape(height, width, 3)


for step in range(1250):
    now_s = step * model.opt.timestep
    data.ctrl[:] = [np.clip((now_s - 0.6) * 0.05, 0, 0.05), *[3 * min(now_s / 0.4, 1)] * 2]
    held = carry.step(data)
    if sys.argv[1:] and step % 50 == 0:
        felt = gel.feel(data)
        panels = [seen(), gel.sensor.picture(felt), depth_picture(gel.sensor.depth_map_mm(felt))]
        film.append(np.hstack([cv2.resize(one, (240, 240) if one.shape[0] == 240 else (320, 240)) for one in panels]))

up_n = sum((carry.gels[one.gel].gap.rotation(data) @ one.force_n)[2] for one in held)
print(f"lifted by {data.body('object').xpos[2] * 1e3:.0f} mm; the gels carry {up_n:.4f} N of {0.02 * 9.81:.4f} N")
if film:
    animation = cv2.Animation()
    animation.frames = [cv2.cvtColor(one, cv2.COLOR_RGB2BGR) for one in film]
    animation.durations = [80] * len(film)
    cv2.imwriteanimation(sys.argv[1], animation, [cv2.IMWRITE_WEBP_QUALITY, 80])
