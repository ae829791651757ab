"""The picture of touch in a model of MuJoCo's own: a ball lies on a gel."""

import mujoco

from gellight_touch.mujoco_gels import MujocoGels

model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody>
    <body name="finger"><geom type="box" size=".02 .02 .002" pos="0 0 -.002"/><site name="gel"/></body>
    <body name="ball" pos="0 0 .0041"><freejoint/><geom type="sphere" size=".004" mass=".05"/></body>
    </worldbody></mujoco>""")
data = mujoco.MjData(model)
gel = MujocoGels(model, ["gel"], touching=["ball"])["gel"]
mujoco.mj_step(model, data, 500)
felt = gel.look(data)
picture = gel.sensor.picture(felt)
print(f"{felt.force_n:.2f} N, {felt.depth_mm.max():.2f} mm deep, picture {picture.shape}")
