"""MuJoCo's MJX, in JAX: it drops the springs' curves and the motors' dead time without a word; the curves are put back.

    pip install mujoco-mjx onnxruntime
    tar xzf org.trunkline.twin-0.1.0.tgz && python batch_mjx.py
"""
# pyright: reportMissingImports=false

import json
from pathlib import Path

import jax
import mujoco
import numpy as np
import onnxruntime
from mujoco import mjx

cases = json.loads(Path("package/Tests/Vectors/network.json").read_text())["cases"]
pose = next(case["question"]["pose"] for case in cases if not case["answer"]["doubtful"])  # one that is in reach
network = onnxruntime.InferenceSession("package/Runtime/Network/ik.onnx")
commands = network.run(["commands"], {"pose": np.array([pose], np.float32)})[0][0]
model = mujoco.MjModel.from_xml_path("package/Runtime/Model/calibrated.xml")
model.body("base").quat, model.opt.gravity = (1, 0, 0, 0), 9.80665 * np.array(pose[:3])  # the world is the base frame
there, data = mjx.put_model(model), mujoco.MjData(model)


def lengths(qpos):
    """Of all tendons; those whose springs are curved, the round joints' diagonals, are sums of angles."""
    data.qpos = qpos
    mujoco.mj_fwdPosition(model, data)
    return data.ten_length.copy()


jacobian = np.stack([lengths(row) for row in np.eye(model.nv)], axis=1)


@jax.jit
def step(state):
    """One step, with the forces -(b q² + c q³) that MJX leaves out, q from each spring's rest."""
    q, length = state.qpos - model.qpos_spring, jacobian @ state.qpos
    joints = model.jnt_stiffnesspoly[:, 0] * q**2 + model.jnt_stiffnesspoly[:, 1] * q**3
    tendons = model.tendon_stiffnesspoly[:, 0] * length**2 + model.tendon_stiffnesspoly[:, 1] * length**3
    return mjx.step(there, state.replace(qfrc_applied=-joints - tendons @ jacobian))


state = mjx.make_data(there).replace(ctrl=jax.numpy.array(commands), act=jax.numpy.array(commands))
for _ in range(round(20 / model.opt.timestep)):  # 20 s, until it rests
    state = step(state)
tip = np.array(state.site_xpos[model.site("tip").id])
print(f"tip at {', '.join(f'{x:.6f}' for x in tip)} m, {1e3 * np.linalg.norm(tip - pose[3:6]):.2f} mm from its target")
