"""What each part of the system is worth: an experiment with one thing taken away or made worse, by name.

    result, _ = perform(reach(varied(bench, "reach", "no_preview"), seed))

A variant changes what runs share, so a run of it has the same object, path, operator and robot as the run of the same
seed that has everything.

Variants of a grasp that do not ask what the batch of futures is worth preview the nominal one alone, as `single` does:
it is what they compare with.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import mujoco

from rehearsal.experiments.bench import SharedRun
from rehearsal.experiments.lookup import lookup
from trunkline.ar.hybrid.friction import TPU_ON
from trunkline.ar.hybrid.uncertainty import Contact, GraspUncertainty
from trunkline.errors import InputError
from trunkline.model.arm.contact_geometry import read_geometry
from trunkline.model.statics.chain import read_chain
from trunkline.model_files import read_model, read_spec
from trunkline.pipeline.config import PROJECT

DRAWING = PROJECT / "artifacts/build_mjcf/arm.xml"
NOWHERE = 5.0  # m; within it of its axis the arm has no bending plane: further than anything is
SLIPPERY = 0.7  # of the friction that is believed
SURE = GraspUncertainty(contact=Contact(0.0, (0.0, 0.0, 0.0), 0.0))  # of everything

Change = Callable[[SharedRun], SharedRun]


def varied(bench: SharedRun, experiment: str, name: str) -> SharedRun:
    """What runs of the variant `name` of an experiment share.

    Raises:
        InputError: there is no such variant.
    """
    variants = VARIANTS.get(experiment, {})
    if name not in variants:
        raise InputError(f"variant: found {name!r}, expected one of {experiment}: {', '.join(variants) or 'none'}")
    return variants[name](bench)


def _planned_with(bench: SharedRun, model: mujoco.MjModel) -> SharedRun:
    """Plans, previews and shapers by `model` alone, without the network; reach stays by the package's maps."""
    chain = read_chain(model).smooth
    straight = model.tendon_length0[model.actuator_trnid[:, 0]]
    package = replace(bench.package, network=lookup(chain), model=model, chain=chain, straight=straight)
    return replace(bench, package=package)


def _statics(bench: SharedRun) -> SharedRun:
    return _planned_with(bench, bench.package.model)


def _cad(bench: SharedRun, drawing: Path = DRAWING) -> SharedRun:
    return _planned_with(bench, read_model(drawing))


def _no_preview(bench: SharedRun) -> SharedRun:
    return replace(bench, judged=False)


def _no_plane(bench: SharedRun) -> SharedRun:
    core = bench.config.core
    core = replace(core, bending_plane=replace(core.bending_plane, axis=NOWHERE))
    return replace(bench, config=replace(bench.config, core=core))


def _base(bench: SharedRun, **off: float) -> SharedRun:
    sensors = replace(bench.stand_in.sensors, **off)
    return replace(bench, stand_in=replace(bench.stand_in, sensors=sensors))


def _delay(bench: SharedRun, seconds: float) -> SharedRun:
    core = replace(bench.config.core, follow_delay=seconds)
    return replace(bench, config=replace(bench.config, core=core))


def _single(bench: SharedRun) -> SharedRun:
    """One future, with all as it is believed, of the plan and of each place that the assistant tries."""
    assert bench.world_model is not None
    previewing = replace(bench.previewing, futures=1, assistant=min(bench.previewing.assistant, 1))
    return replace(bench, world_model=replace(bench.world_model, uncertainty=SURE), previewing=previewing)


def _cad_grasp(bench: SharedRun, drawing: Path = DRAWING) -> SharedRun:
    """Shaped and previewed with the drawing's arm. A grasp is planned by its geometry, which the identified one has."""
    bench, spec, model = _single(bench), read_spec(drawing), read_model(drawing)
    assert bench.world_model is not None
    package = replace(bench.package, model=model, chain=read_chain(model).smooth, geometry=read_geometry(spec))
    return replace(bench, package=package, world_model=replace(bench.world_model, arm=spec))


def _slippery(bench: SharedRun) -> SharedRun:
    """The futures stay as they are: whether they foresee it is the question."""
    touch = replace(bench.stand_in.touch, arm_object=SLIPPERY * TPU_ON[bench.previewing.material])
    return replace(bench, stand_in=replace(bench.stand_in, touch=touch))


def _both(first: Change, second: Change) -> Change:
    return lambda bench: second(first(bench))


WORSE: dict[str, Change] = {
    "no_plane": _no_plane,
    **{f"base_{mm}mm": partial(_base, alignment_mm=float(mm)) for mm in (5, 10, 20)},
    **{f"base_{deg}deg": partial(_base, alignment_deg=float(deg)) for deg in (1, 2, 4)},
}
BOTH: dict[str, Change] = {
    "statics": _statics,  # the identified model without its network: what `cad` compares with
    "cad": _cad,
    **WORSE,
}
GRASP: dict[str, Change] = {
    "single": _single,
    "no_preview": _no_preview,
    "cad": _cad_grasp,
    **{name: _both(_single, change) for name, change in WORSE.items()},
    "slippery": _slippery,
}
DELAYS = {f"delay_{s:g}s": partial(_delay, seconds=s) for s in (0.2, 0.5, 1.0)}
VARIANTS: dict[str, dict[str, Change]] = {
    "reach": {**BOTH, "no_preview": _no_preview},
    "follow": {**BOTH, **DELAYS},
    "grasp": GRASP,
}
