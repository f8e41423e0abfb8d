"""A batch of arms for learning, each drawn from what identification left open: how far apart are their tips?

    trunkline randomize artifacts --out randomisation.json
    python batch.py artifacts/identify_control/arm.xml randomisation.json [ARMS] [SECONDS]

The first arm of the batch is the calibrated one. All are pulled by the same commands from the straight arm on.
"""

import hashlib
import sys
from pathlib import Path

import mujoco
import numpy as np

from trunkline.identification.parameters.parameters import DERIVED_FROM
from trunkline.model.simulation.motion import batch_of, hold, move
from trunkline.tools.randomize.fields import drawn_fields
from trunkline.tools.randomize.file import read_randomization

path, table = Path(sys.argv[1]), Path(sys.argv[2])
count, seconds = int(sys.argv[3]) if len(sys.argv) > 3 else 64, float(sys.argv[4]) if len(sys.argv) > 4 else 2.0
posterior, which = read_randomization(table)
assert hashlib.sha256(path.read_bytes()).hexdigest() == which["sha256"], f"{table} is of another model than {path}"
model = mujoco.MjModel.from_xml_path(str(path))
fields = drawn_fields(model, posterior.sample(count - 1, 0))
batch = batch_of(model, count)  # MuJoCo's own Batch: expand gives every simulation its own fields
for name, values in fields.items():
    batch.expand(name)[1:] = values  # the first arm stays the calibrated one
if DERIVED_FROM & fields.keys():
    batch.set_const()  # masses and places of hinges set what softens joint limits
straight = np.tile(model.tendon_length0[model.actuator_trnid[:, 0]], (count, 1))
hold(batch, model, straight)
steps = round(seconds / model.opt.timestep)
pulls = straight - 0.03 * np.eye(1, model.nu)  # m: the first cable is drawn in
tips = move(batch, np.repeat(pulls[:, None], steps, axis=1), ("site_xpos",))["site_xpos"][:, -1, model.site("tip").id]
apart = 1e3 * np.linalg.norm(tips - tips[0], axis=1)
print(f"{count} arms, {len(fields)} fields of their own, {seconds:g} s: {np.isfinite(tips).all(axis=1).sum()} moved")
print(f"tip of the calibrated arm (m): {', '.join(f'{t:.6f}' for t in tips[0])}")
print(f"of the others from it (mm): median {np.median(apart[1:]):.2f}, 95 of 100 within {np.quantile(apart, 0.95):.2f}")
