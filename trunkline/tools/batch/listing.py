"""The list of a batch: arms or sessions, each with what differs from the pipeline that it is like."""

from dataclasses import field
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from trunkline.errors import InputError, nearest
from trunkline.pipeline.config import validated
from trunkline.recordings.session.session import SessionName, sessions_in
from trunkline.settings import read_yaml, settings

NONE = "none"  # as the reference: no drift is computed


@settings
class ListedArm:
    """name: of its folder and row. session: folder of its logs and session.yaml, or of several such. like: folder whose
    dvc.yaml and params.yaml it takes, by default the project's. params: what differs from those, by stage. folder: in
    place of all of these, where a pipeline has run already; it is read and not run. since: which arm its drift is from.
    """

    name: SessionName
    session: str | None = None
    like: str = "."
    params: dict[str, Any] = field(default_factory=dict)
    folder: str | None = None
    since: str | None = None

    def __post_init__(self):
        if (self.session is None) == (self.folder is None):
            which = "both" if self.session else "neither"
            raise ValueError(f"session: found {which} of session and folder, expected one of the two for {self.name!r}")


@settings
class Listing:
    """reference: the arm that drift is from, unless an arm says another; by default the first. "none" for none."""

    arms: list[ListedArm]
    reference: str | None = None

    def __post_init__(self):
        names = [arm.name for arm in self.arms]
        if not names:
            raise ValueError("arms: found none, expected at least one")
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise ValueError(f"arms: found {twice!r} twice, expected each name once")
        references = [("reference", self.reference), *((f"arms: {arm.name}: since", arm.since) for arm in self.arms)]
        for key, name in references:
            if name not in (None, NONE, *names):
                raise ValueError(f"{key}: found {name!r}, expected one of {', '.join(names)}{nearest(name, names)}")

    def earlier(self, arm: ListedArm) -> str | None:
        """The arm that the drift of another is from, if there is one."""
        name = arm.since or self.reference or self.arms[0].name
        return None if name in (NONE, arm.name) else name


def read_listing(path: Path) -> Listing:
    """A list of arms; paths in it are seen from its own folder.

    Raises:
        InputError: one line that names file and key, what was found and what was expected.
    """
    content = OmegaConf.to_container(read_yaml(path), resolve=False)
    assert isinstance(content, dict)  # as `read_yaml` sees to
    listing = validated(Listing, {str(key): value for key, value in content.items()}, path)
    for arm in listing.arms:
        for key, wanted in (("session", "session.yaml"), ("folder", "artifacts"), ("like", "dvc.yaml")):
            name = getattr(arm, key)
            if name is None or (key == "like" and (name == "." or arm.folder)):
                continue
            place = (path.parent / name).resolve()
            if not (place / wanted).exists() and not (key == "session" and sessions_in(place)):
                raise InputError(f"{path}: {arm.name}: {key}: found no {wanted} in {place}, expected one")
            setattr(arm, key, str(place))
    return listing
