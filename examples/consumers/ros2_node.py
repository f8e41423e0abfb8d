"""The twin as a node of ROS 2, by DDS and without ROS: pulls in, pulls and joints out, in real time.

    pip install 'path/to/checkout[ros2]'    # of this repository: it is in no registry
    python ros2_node.py org.trunkline.twin-0.1.0.tgz
"""
# pyright: reportArgumentType=false, reportCallIssue=false

import json
import os
import sys
import time
from pathlib import Path

import mujoco
import numpy as np
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from trunkline.ar.drivers.ros_messages import Header, JointState, Time
from trunkline.twin.package import read_tarball
from trunkline.unity.unpacked import model_of

files = read_tarball(Path(sys.argv[1]))
bus = DomainParticipant(int(os.environ.get("ROS_DOMAIN_ID", 0)))
commands_reader = DataReader(bus, Topic(bus, "rt/tendons/command", JointState))
states, angles = (DataWriter(bus, Topic(bus, f"rt/{name}", JointState)) for name in ("tendons/state", "joint_states"))
cases = json.loads(files["Tests/Vectors/network.json"])["cases"]
down = next(case["question"]["pose"][:3] for case in cases if not case["answer"]["doubtful"])
model = model_of(files)
model.body("base").quat, model.opt.gravity = (1, 0, 0, 0), 9.80665 * np.array(down)  # the world is the base frame
data, straight = mujoco.MjData(model), json.loads(files["Runtime/manifest.json"])["model"]["rest_lengths"]
data.ctrl = data.act = list(straight.values())  # its controls are commands: at these nothing pulls
joints = [model.joint(i).name for i in range(model.njnt)]
begun = time.monotonic()
while True:
    for command in [message for message in commands_reader.take() if isinstance(message, JointState)]:
        for name, pull in zip(command.name, command.position, strict=True):  # m
            data.actuator(f"{name}_position").ctrl = straight[name] - pull
    mujoco.mj_step(model, data, nstep=round(0.02 / model.opt.timestep))
    pulls = [length - data.tendon(name).length[0] for name, length in straight.items()]
    states.write(JointState(Header(Time(0, 0), ""), list(straight), pulls, [], []))
    angles.write(JointState(Header(Time(0, 0), ""), joints, data.qpos.tolist(), [], []))
    time.sleep(max(0.0, begun + data.time - time.monotonic()))  # steps and messages take time too
