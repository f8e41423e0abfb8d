"""The network's answers one at a time on one thread, as a headset asks, and Gauss-Newton steps from them.

    python -m benchmarks.inverse_kinematics [artifacts/train_ik/ik.onnx]

Targets are fresh equilibria of the calibrated arm, gravity up to 120° off the straight arm, from any side.
"""

import sys
import time
from pathlib import Path

import numpy as np
import onnxruntime

from trunkline.frames import STANDARD_GRAVITY, downwards
from trunkline.kinematics.dataset.sampling import pull_directions
from trunkline.kinematics.ik.inference import ask
from trunkline.kinematics.ik.refine import refine
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import equilibrium
from trunkline.model_files import read_model
from upkeep.results import recorded

MODEL = Path("artifacts/identify_control/arm.xml")
TARGETS, SINGLE = 400, 5000


@recorded("inverse_kinematics")
def main(path: Path) -> None:
    chain = read_chain(read_model(MODEL)).smooth
    rng = np.random.default_rng(0)
    down = downwards(rng.uniform(0, np.radians(120), TARGETS), rng.uniform(0, 2 * np.pi, TARGETS))
    tensions = pull_directions(chain, rng.uniform(0, 2 * np.pi, TARGETS)) * rng.uniform(0, 1, (TARGETS, 1)) ** 2
    rest = equilibrium(chain, tensions, STANDARD_GRAVITY * down)
    targets = np.column_stack([down, rest.position, rest.quaternion])[rest.converged]

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    network = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    poses, times = targets.astype(np.float32), []
    for index in range(SINGLE):
        pose = poses[index % len(poses)][None]
        started = time.perf_counter()
        network.run(None, {"pose": pose})
        times.append(time.perf_counter() - started)
    print(f"{path}: median {1e6 * np.median(times):.1f} us an answer, one thread")

    lengths = ask(network, targets)["lengths"].astype(float)
    refine(chain, targets[:2], lengths[:2])  # compiles
    for steps in (0, 1, 2, 3):
        started = time.perf_counter()
        refined = refine(chain, targets, lengths, steps)
        seconds = (time.perf_counter() - started) / len(targets)
        error = 1e3 * refined.position_error
        print(f"{steps} Gauss-Newton steps: tip error median {np.median(error):.2g} mm, 95 % below "
              f"{np.quantile(error, 0.95):.2g} mm, "
              f"{(refined.position_error <= 1e-3 * chain.length).mean():.1%} within 0.1 % of length, "
              f"{1e3 * seconds:.1f} ms each, the first forward kinematics included")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "artifacts/train_ik/ik.onnx"))
