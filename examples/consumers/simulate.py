"""MuJoCo's viewer: writes reach.xml, the calibrated arm with a target and the commands that lead to it as a key.

    tar xzf org.trunkline.twin-0.1.0.tgz && python simulate.py && python -m mujoco.viewer --mjcf=reach.xml

`simulate reach.xml` does as well. Press *Load key*: the tip goes to the green ball.
"""

import json
from pathlib import Path

import mujoco
import numpy as np
import onnxruntime

cases = json.loads(Path("package/Tests/Vectors/network.json").read_text())["cases"]
pose = next(case["question"]["pose"] for case in cases if not case["answer"]["doubtful"])  # one that is in reach
network = onnxruntime.InferenceSession("package/Runtime/Network/ik.onnx")
commands = network.run(["commands"], {"pose": np.array([pose], np.float32)})[0][0]
spec = mujoco.MjSpec.from_file("package/Runtime/Model/calibrated.xml")
spec.body("base").quat, spec.option.gravity = (1, 0, 0, 0), 9.80665 * np.array(pose[:3])  # the world is the base frame
spec.worldbody.add_site(name="target", pos=pose[3:6], size=[0.005] * 3, rgba=[0, 1, 0, 0.5])
spec.add_key(name="target", ctrl=commands, act=commands)
spec.compile()
Path("reach.xml").write_text(spec.to_xml())
