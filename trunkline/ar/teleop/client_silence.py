"""The reason to hold that a silent client, such as a headset, gives: no new stamp of its clock for `Safety.silence` s.

It only words the reason. In a mode in which something moves, the core then holds (`core.py`), and the session
controller stops the robot (`ar/session/controller.py`). Behind it, each with a timeout of its own: control passes from
a client that is silent (`ar/session/lease.py`), the robot's process brakes without a permit
(`ar/session/robot_process.py`), a driver halts without setpoints (`ar/drivers/watchdog.py` reports that they are late).
"""

from trunkline.ar.teleop.settings import Safety


def silence_reason(last: float | None, stamp: float, silent: float, safety: Safety) -> str:
    """Why the client counts as silent, "" where it does not; `silent` s is how long no new stamp has come."""
    gap = silent if last is None else max(silent, stamp - last)
    return f"client silent for {gap:.2f} s; holding" if gap > safety.silence else ""
