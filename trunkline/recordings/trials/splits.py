"""What a trial may be used for: the splits of a session. They are named here, and nowhere else."""

from typing import TYPE_CHECKING, Literal

IDENTIFY = "identify"  # fits read it
VALIDATE = "validate"  # choices of model, loss and options are made on it, so its errors flatter what was chosen
TEST = "test"  # the stage `score` reads it, nothing else does: its errors are those of new data
SPLITS = (IDENTIFY, VALIDATE, TEST)
DECIDING = (IDENTIFY, VALIDATE)  # what fits, choices and figures may read

if TYPE_CHECKING:
    SplitName = str
else:
    SplitName = Literal[SPLITS]  # so that whoever names another is told which there are
