"""What the witness of a session notes of what its robot tells."""

import multiprocessing

import numpy as np

from qualification.witness import HEAD, Watched, Witness
from trunkline.ar.session.robot_process import HOLD_TIME, MODE, MODES, SERIAL

TENDONS = 3


def test_a_motion_and_its_first_hold_are_noted():
    context = multiprocessing.get_context("spawn")
    witness = context.RawValue(Witness)
    channel = Watched(context, TENDONS, 1, witness)

    def tell(joint, cable, mode, serial, held):
        numbers = np.zeros(channel.size)
        numbers[HEAD], numbers[HEAD + 7] = joint, cable
        numbers[MODE], numbers[SERIAL], numbers[HOLD_TIME] = MODES.index(mode), serial, held
        channel.tell(numbers, "")

    tell(0.5, 0.2, "idle", 0, 0.0)
    at_first = witness.moved
    assert (witness.far, witness.begun, witness.running, witness.held) == (0.0, 0, False, 0.0)
    tell(0.5, 0.2, "idle", 0, 0.0)
    assert witness.moved == at_first
    tell(0.8, 0.9, "running", 1, 0.0)
    assert witness.moved > at_first
    assert abs(witness.far - 0.3) < 1e-12, "of joints alone"
    assert (witness.begun, witness.running) == (1, True)
    tell(0.6, 0.9, "fault", 1, 7.0)
    tell(0.6, 0.9, "fault", 1, 7.5)
    assert (witness.held, witness.running) == (7.0, False), "braking holds again and again"
    assert abs(witness.far - 0.3) < 1e-12, "the most that it ever was"
