"""MuJoCo Warp: the calibrated arm, whole, goes to a target, in 32-bit floats, on a GPU or, slowly, on a CPU.

    pip install mujoco-warp onnxruntime
    tar xzf org.trunkline.twin-0.1.0.tgz && python batch_warp.py
"""
# pyright: reportMissingImports=false

import json
from pathlib import Path

import mujoco
import mujoco_warp
import numpy as np
import onnxruntime

cases = json.loads(Path("package/Tests/Vectors/network.json").read_text())["cases"]
pose = next(case["question"]["pose"] for case in cases if not case["answer"]["doubtful"])  # one that is in reach
network = onnxruntime.InferenceSession("package/Runtime/Network/ik.onnx")
commands = network.run(["commands"], {"pose": np.array([pose], np.float32)})[0][0]
model = mujoco.MjModel.from_xml_path("package/Runtime/Model/calibrated.xml")
model.body("base").quat, model.opt.gravity = (1, 0, 0, 0), 9.80665 * np.array(pose[:3])  # the world is the base frame
data = mujoco.MjData(model)
data.ctrl = data.act = commands  # an activation of 0 would pull with all its force
there, state = mujoco_warp.put_model(model), mujoco_warp.put_data(model, data)
for _ in range(round(20 / model.opt.timestep)):  # 20 s, until it rests
    mujoco_warp.step(there, state)
tip = state.site_xpos.numpy()[0][model.site("tip").id]
print(f"tip at {', '.join(f'{x:.6f}' for x in tip)} m, {1e3 * np.linalg.norm(tip - pose[3:6]):.2f} mm from its target")
