"""The library alone: where does the twin's tip rest, and which commands bring it there? (no DVC, no checkout)

    python library.py artifacts/identify_control/arm.xml artifacts/train_ik/ik.onnx
"""

import sys

import mujoco
import numpy as np
import onnxruntime

from trunkline.frames import STANDARD_GRAVITY, downwards
from trunkline.kinematics.ik.inference import ask
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import actuated, equilibrium

model, network = sys.argv[1:]
chain = read_chain(mujoco.MjModel.from_xml_path(model)).smooth  # the network's arm, its tendons without friction
down = downwards(np.array([0.3]), np.array([0.0]))  # gravity 0.3 rad off the straight arm, towards the base's +x
gravity = STANDARD_GRAVITY * down
tensions = 5.0 * np.eye(1, chain.tendons)  # N, on the first tendon alone
rest = equilibrium(chain, tensions, gravity)
pose = np.concatenate([down, rest.position, rest.quaternion], axis=1)  # (1, 10), base frame, quaternion w first
commands = ask(onnxruntime.InferenceSession(network), pose)["commands"]  # a pose that is none is an InputError
reached = actuated(chain, commands.astype(float), gravity)
print("tip (m):", rest.position[0].round(4))
print("commands (m):", commands[0].round(4))
print("tip missed by (mm):", (1e3 * np.linalg.norm(reached.position - rest.position, axis=1)[0]).round(2))
