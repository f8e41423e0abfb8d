"""Anchors that a headset has fastened to the room near the robot's base, kept from one session to the next."""

import threading
from pathlib import Path

from pydantic import TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from trunkline.ar.teleop.messages import Pose, Vector
from trunkline.errors import InputError, first_problem
from trunkline.files import written_whole

MOST = 8  # a headset keeps no more of one page


@dataclass(frozen=True)
class Anchor:
    """id: the headset's. transform: pose of the robot's base in the anchor. residual: root mean square of the touches,
    m, None where it was put there by eye. tip: of the controller that touched, in its frame, m; None likewise. date: of
    the alignment, ISO 8601."""

    id: str
    transform: Pose
    residual: float | None
    tip: Vector | None
    date: str


_FILE: TypeAdapter[list[Anchor]] = TypeAdapter(list[Anchor])


class Anchors:
    """Those in a JSON file, the newest last."""

    def __init__(self, path: Path) -> None:
        """
        Raises:
            InputError: the file holds something else.
        """
        self.path, self.stored, self._saving = path, tuple[Anchor, ...](), threading.Lock()
        if not path.is_file():
            return
        try:
            self.stored = tuple(_FILE.validate_json(path.read_bytes()))
        except ValidationError as error:
            raise InputError(f"{path}: {first_problem(error)}, expected anchors of live sessions") from error

    def find(self, id: str) -> Anchor | None:
        return next((anchor for anchor in self.stored if anchor.id == id), None)

    @property
    def newest(self) -> str:
        """Its id, "" where there is none."""
        return self.stored[-1].id if self.stored else ""

    def keep(self, anchor: Anchor) -> None:
        """From now on; the oldest goes where there are too many. `save` writes them."""
        others = [stored for stored in self.stored if stored.id != anchor.id]
        self.stored = (*others, anchor)[-MOST:]

    def save(self) -> None:
        """Whole or not at all.

        Raises:
            OSError: it cannot be written.
        """
        with self._saving:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with written_whole(self.path) as part:
                part.write_bytes(_FILE.dump_json(list(self.stored), indent=1) + b"\n")
