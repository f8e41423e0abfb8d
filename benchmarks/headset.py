"""How many steps of the packed model fit into a headset's frame: µs a step here, and an estimate of a Quest 3's. And
what is done at once: a bend, for which the network answers BENDS poses, and the start, which leads the arm to rest.

    python -m benchmarks.headset [org.trunkline.twin-0.1.0.tgz]

The model steps as often a frame as its step stays within LONGEST. A step's time is the least of several runs of a curl,
by the processor's clock, as this machine does other work as well.

The estimate divides published single-core scores of Geekbench 6, which are of phones' and laptops' highest clock: a
Snapdragon XR2+ Gen 2 has PLUS (SamMobile, May 2025), its clock is FASTER times that of the XR2 Gen 2 in a Quest 3
(Road to VR, January 2024), and a laptop's Zen 5 core has ZEN_5 (PC Gamer, March 2026). Measured on a slower core, the
estimate is too long; on a faster one too short. No headset was there; heat, Android and Unity take their part on top.
"""

import argparse
import sys
import time
from pathlib import Path

import mujoco
import numpy as np
import onnxruntime

from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.config import PROJECT
from trunkline.unity.package import NETWORK, read_tarball
from trunkline.unity.proof import scene_of, turns
from trunkline.unity.start import TwinComponent
from trunkline.unity.unpacked import model_of
from upkeep.results import recorded

LONGEST = 0.004  # s
RATES = (60, 72, 90, 120)  # Hz
PLUS, FASTER, ZEN_5 = 990, 1.2, 3048
RUNS, SPAN = 20, 0.5  # runs, s of simulation each
PULL = 0.1  # m
BENDS = 331  # poses that `Bend` asks the network for
TILTS = (0, 60, 120, 180)  # degrees, gravity at the start


def steps_a_frame(rate: float) -> int:
    """The fewest steps of a frame of so many Hz that are no longer than LONGEST."""
    return int(np.ceil(1 / (rate * LONGEST) - 1e-9))


def seconds_a_step(model: mujoco.MjModel, control: np.ndarray, timestep: float) -> float:
    """Of processor, the least of RUNS.

    Raises:
        InputError: the simulation diverges at this step, so that its time says nothing.
    """
    model.opt.timestep = timestep
    data, times, count = mujoco.MjData(model), [], max(round(SPAN / timestep), 1)
    data.ctrl = control
    for _ in range(RUNS):
        begun = time.process_time()
        mujoco.mj_step(model, data, nstep=count)
        times.append((time.process_time() - begun) / count)
    if data.warning.number.any():
        raise InputError(f"step of {1e3 * timestep:.3g} ms: found a warning of MuJoCo, expected a motion without")
    return min(times)


def seconds_a_bend(network: bytes) -> float:
    """Of processor, the least of RUNS, on one thread of ONNX's runtime; Unity's engine is another."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session, times = onnxruntime.InferenceSession(network, options), []
    given = session.get_inputs()[0]
    poses = np.ones((BENDS, given.shape[1]), np.float32)
    for _ in range(RUNS):
        begun = time.process_time()
        session.run(None, {given.name: poses})
        times.append(time.process_time() - begun)
    return min(times)


def steps_to_start(files: dict[str, bytes], tilt: float) -> int:
    """That *Twin* takes before the first frame, gravity at this angle, rad, the display at the first of RATES."""
    scene = scene_of(files, turns([tilt])[0], 1 / (RATES[0] * steps_a_frame(RATES[0])))
    scene.start()
    (twin,) = scene.components
    assert isinstance(twin, TwinComponent)
    return twin.steps


def processor() -> str:
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines() if Path("/proc/cpuinfo").exists() else []
    found = [line.partition(":")[2].strip() for line in lines if line.startswith(("model name", "cpu family"))]
    return f"{found[1]}, family {found[0]}" if len(found) > 1 else "unknown"


def show(package: Path) -> None:
    files = read_tarball(package)
    model = model_of(files)
    control = model.tendon_length0[model.actuator_trnid[:, 0]] - PULL * np.eye(1, model.nu)[0]
    ratio = ZEN_5 * FASTER / PLUS
    print(f"processor here: {processor()}; {model.nv} degrees of freedom")
    print(f"estimate for a Quest 3: {ZEN_5} * {FASTER} / {PLUS} = {ratio:.2f} times as long")
    print("| display, Hz | steps a frame | step, ms | µs a step here | µs a step, Quest 3, estimate | of the frame |")
    print("|---:|---:|---:|---:|---:|---:|")
    for rate in RATES:
        steps = steps_a_frame(rate)
        taken = seconds_a_step(model, control, 1 / (rate * steps))
        share = steps * taken * ratio * rate
        print(
            f"| {rate} | {steps} | {1e3 / (rate * steps):.2f} | {1e6 * taken:.0f} | {1e6 * ratio * taken:.0f} | "
            f"{100 * share:.0f} % |"
        )
    step = seconds_a_step(model, control, 1 / (RATES[0] * steps_a_frame(RATES[0])))
    once = {f"a bend: {BENDS} poses": seconds_a_bend(files[NETWORK])}
    for tilt in TILTS:
        steps = steps_to_start(files, np.radians(tilt))
        once[f"start at rest, gravity at {tilt}°: {steps} steps"] = steps * step
    print("| at once | ms here | ms, Quest 3, estimate |")
    print("|---|---:|---:|")
    for what, taken in once.items():
        print(f"| {what} | {1e3 * taken:.1f} | {1e3 * ratio * taken:.0f} |")


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    built = sorted((PROJECT / "artifacts/package_unity").glob("*.tgz"))
    parser.add_argument("package", type=Path, nargs="?", default=built[0] if built else None)
    package = parser.parse_args().package
    if package is None:
        raise InputError("artifacts/package_unity: found no .tgz, expected the package that `make demo` writes")
    with recorded("headset"):
        show(package)
    return 0


if __name__ == "__main__":
    sys.exit(main())
