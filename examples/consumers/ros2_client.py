"""Somebody else in the same network: sends the twin of ros2_node.py to a target, and says where its tip came to rest.

    python ros2_client.py org.trunkline.twin-0.1.0.tgz 25    # s
"""
# pyright: reportArgumentType=false, reportOptionalIterable=false

import json
import os
import sys
import time
from pathlib import Path

import mujoco
import numpy as np
import onnxruntime
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from trunkline.ar.drivers.ros_messages import Header, JointState, Time
from trunkline.kinematics.ik.inference import ask
from trunkline.twin.package import read_tarball
from trunkline.unity.unpacked import model_of

files = read_tarball(Path(sys.argv[1]))
network = DomainParticipant(int(os.environ.get("ROS_DOMAIN_ID", 0)))
teller = DataWriter(network, Topic(network, "rt/tendons/command", JointState))
hearer = DataReader(network, Topic(network, "rt/joint_states", JointState))
cases = json.loads(files["Tests/Vectors/network.json"])["cases"]
pose = next(case["question"]["pose"] for case in cases if not case["answer"]["doubtful"])  # one that is in reach
commands = ask(onnxruntime.InferenceSession(files["Runtime/Network/ik.onnx"]), np.array([pose]))["commands"][0]
straight = json.loads(files["Runtime/manifest.json"])["model"]["rest_lengths"]
pulls = [float(length - command) for length, command in zip(straight.values(), commands, strict=True)]
model = model_of(files)
model.body("base").quat = 1, 0, 0, 0  # the world is the base frame
data, end, received = mujoco.MjData(model), time.monotonic() + float(sys.argv[2]), 0
while time.monotonic() < end:  # until it rests
    teller.write(JointState(Header(Time(0, 0), ""), list(straight), pulls, [], []))
    for state in [message for message in hearer.take() if isinstance(message, JointState)]:
        data.qpos, received = state.position, received + 1
    time.sleep(0.1)
if not received:
    sys.exit(f"/joint_states: found none in {sys.argv[2]} s, expected those of ros2_node.py, of the same ROS domain")
mujoco.mj_kinematics(model, data)
tip = data.site("tip").xpos
print(f"tip at {', '.join(f'{x:.6f}' for x in tip)} m, {1e3 * np.linalg.norm(tip - pose[3:6]):.2f} mm from its target")
