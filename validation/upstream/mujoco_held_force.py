"""A spring by MuJoCo's motor, set every frame_skip = 5 steps, gains energy.  pip install mujoco"""

import mujoco
import numpy as np

M, K, SKIP, CALLS = 3.7, 290.0, 5, 1000  # kg, N/m; 2 ms a step, so ten seconds
model = mujoco.MjModel.from_xml_string(f"""<mujoco><option gravity="0 0 0"/>
    <worldbody><body><joint name="x" type="slide" axis="1 0 0"/><geom size="1" mass="{M}"/></body></worldbody>
    <actuator><motor joint="x"/></actuator></mujoco>""")


def state_after(calls, q, v):
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0] = q, v
    for _ in range(calls):
        data.ctrl[0] = -K * data.qpos[0]
        mujoco.mj_step(model, data, SKIP)
    return data.qpos[0], data.qvel[0]


# the area in phase space that two motions span, which grows as the energy does
measured = np.linalg.det([state_after(CALLS, 1, 0), state_after(CALLS, 0, 1)])
law = (1 + (SKIP * model.opt.timestep) ** 2 * K / M * (SKIP - 1) / (2 * SKIP)) ** CALLS
print(f"measured {measured:.15g} law {law:.15g} uncertainty 1e-10 promised 1")
