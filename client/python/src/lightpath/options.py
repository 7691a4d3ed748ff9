"""Options of jobs, as keyword arguments. An option that is not given has the server's default."""

from __future__ import annotations

from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, TypedDict

import numpy as np

from lightpath import v1, words
from lightpath.errors import InvalidArgument

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from lightpath.initial_phases import InitialPhase
    from lightpath.pictures import Picture

Region: TypeAlias = tuple[int, int, int, int]
"""A part of a picture: x, y, width, height [px]."""

# The longest label that the server accepts.
_LABEL_BYTES_MAX = 128


class SubmitOptions(TypedDict, total=False):
    """Options of every job."""

    request_id: str
    """The same request of the same owner, sent again, returns the same job."""
    priority: int
    """Lower numbers run first, -100 to 100. Numbers below 0 need the role curator or admin."""
    attempts_max: int
    """Failed attempts after which the job fails for good, 1 to 20."""
    owner: str
    """Jobs of the same priority take turns between owners. Only an admin may name another owner."""
    batch: str
    """Name under which many jobs are counted together."""
    unique_key: str
    """At most one waiting or running job of the owner may have this key."""
    timeout_s: float
    """An attempt that takes longer fails for good [s]."""
    after: Sequence[str | Named]
    """Jobs that must succeed before this job starts: the jobs, or their names `jobs/{id}`."""
    needs: Sequence[str]
    """Labels that the process must have that runs the job, such as `gpu`."""
    label: str
    """What the job is about, for lists of jobs, at most 128 bytes. Default: the names of the target's files."""


class Named(Protocol):
    """A version of a kernel, as learning and importing return it, or a job."""

    @property
    def name(self) -> str:
        """Resource name."""


class HologramOptions(SubmitOptions, total=False):
    """Options of the optimization of a hologram."""

    depth_map: Picture
    """Linear grey picture that gives each pixel one of several distances: white the first, black the last."""
    target_encoding: words.Encoding
    """What the target's values mean: `srgb` (default) or `linear` light."""
    fit: words.Fit
    """How a target of another size is fitted to its area: `contain` (default), `cover`, `stretch` or `exact`."""
    area: words.Area
    """What the target fills, with black around it: the `region` that is compared, or the whole `display`. Default:
    `region`; with `fit="exact"` `display`."""
    kernel: str | int | Named | None
    """`active`, `ideal`, an alias, or a version: itself, its name or number. Default: active, or ideal if none is."""
    propagation: words.Propagation
    """Propagation method. Default: the planner chooses."""
    method: words.Method
    """How the phase is found: `lbfgs` (default), `adam`, `gerchberg-saxton`, …"""
    iterations: int
    """Number of iterations, 1 to 10000; 0 judges the phases in `initial_phase` as they are. Default: 200."""
    learning_rate: float
    """Learning rate of Adam [rad]."""
    subframes: int
    """Number of patterns that are shown one after the other, 1 to 24."""
    initial_phase: InitialPhase
    """The phase with which the search starts: `random`, `constant`, `quadratic`, `back-propagated`, one of the classes
    `RandomPhase`, `ConstantPhase`, `LensPhase`, `BackPropagatedPhase`, or phases in radians [y][x]. Default: what leads
    to the best picture."""
    seed: int
    """Seed of the random numbers in the initial phase."""
    loss: words.Quantity
    """Quantity that is compared with the target: `intensity` (default) or `amplitude`."""
    total_variation: float
    """Factor of the total variation in the loss, 0 to 1000."""
    speckle: float
    """Factor of the speckle in the loss, 0 to 1000."""
    detector: words.Detector
    """What counts as the light of a pixel: `pixel` (default), `point` or `supersampled`."""
    region: Region
    """Region in which the picture counts: x, y, width, height [px]. Default: the middle 80 % of each axis."""
    weight_mask: Picture
    """Linear grey picture of the pixels' weights. Black pixels do not count."""
    quantization_aware: bool
    """Optimize the last third of the iterations through the display's grey levels."""
    judge: words.Judging
    """How thoroughly the hologram is judged: `full` (default), `quick` (without other optics and the independent model)
    or `none`."""


class LearnOptions(SubmitOptions, total=False):
    """Options of the learning of a kernel."""

    model: words.Model
    """What is learned: `display` (default), `varying`, `smooth`, `dense` or `paper`."""
    degree: int
    """Highest polynomial degree of the smooth errors, 1 to 12. Default: what predicts the validation pairs best."""
    start_version: str | int | Named
    """Version from which learning starts: itself, its name or number. Default: the ideal kernel."""
    epochs: int
    """Passes over the training pairs with Adam, 1 to 1000. Default: the model's."""
    learning_rate: float
    """Learning rate of Adam. Default: the model's."""
    refinement_evaluations: int
    """Largest number of evaluations of all pairs after Adam, at most 10000. Default: the model's."""
    seed: int
    """Seed of the order of the pairs."""
    detector: words.Detector
    """Light that the camera's pixels measure: `pixel` (default) or `point`."""
    region: Region
    """Region in which the photographs count: x, y, width, height [px]. Default: the middle 80 % of each axis."""


def check(options: Mapping[str, Any], known: type[Any], *, required: Sequence[str] = ()) -> None:
    """Check the names of options, and the types of those that are numbers, texts or True and False.

    Raises TypeError for an option that does not exist or is missing, as Python does for keyword arguments, and
    `InvalidArgument` for a value of another type.
    """
    unknown = options.keys() - known.__annotations__.keys()
    if unknown:
        raise TypeError(
            f"unknown option {', '.join(sorted(unknown))}; the options are {', '.join(sorted(known.__annotations__))}"
        )
    missing = [name for name in required if name not in options]
    if missing:
        raise TypeError(f"missing keyword argument {', '.join(missing)}")
    for name, value in options.items():
        if value is not None:
            check_type(name, value, getattr(known.__annotations__[name], "__forward_arg__", ""))


def given(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options that are not None, which stands for the default."""
    return {name: value for name, value in options.items() if value is not None}


_TYPES: dict[str, tuple[tuple[type[Any], ...], str]] = {
    "int": ((Integral,), "give a whole number"),
    "float": ((Real,), "give a number"),
    "bool": ((bool, np.bool_), "give True or False"),
    "str": ((str,), "give a text"),
}


def check_type(name: str, value: object, annotation: str) -> None:
    """Raise `InvalidArgument` if a value is not of the type that an annotation such as `int` names."""
    wanted, fix = _TYPES.get(annotation, ((object,), ""))
    is_bool = isinstance(value, bool) and annotation in {"int", "float"}
    if is_bool or not isinstance(value, wanted):
        raise InvalidArgument(name, f"is {value!r} ({type(value).__name__})", fix)


def submit_request(spec: v1.JobSpec, options: SubmitOptions) -> v1.SubmitJobRequest:
    """Return the request that submits a job."""
    own: dict[str, Any] = {key: value for key, value in given(options).items() if key in SubmitOptions.__annotations__}
    own["after"] = [each if isinstance(each, str) else each.name for each in own.get("after", ())]
    return v1.SubmitJobRequest(spec=spec, **own)


def label_of(pictures: Sequence[object]) -> str:
    """Return the file names of those pictures that are files, as the label of a job."""
    names = [Path(each).name for each in pictures if isinstance(each, (str, Path))]
    label = "".join(sign if sign.isprintable() else "\ufffd" for sign in ", ".join(names))
    if len(label.encode()) <= _LABEL_BYTES_MAX:
        return label
    return label.encode()[: _LABEL_BYTES_MAX - len("…".encode())].decode(errors="ignore") + "…"


def region_px(region: Region | None) -> Region | None:
    """Return a region x, y, width, height [px]."""
    if region is None:
        return None
    sides = tuple(region) if isinstance(region, tuple | list | np.ndarray) else ()
    if len(sides) != 4 or not all(isinstance(side, Integral) and side >= 0 for side in sides):  # noqa: PLR2004
        raise InvalidArgument("region", f"is {region}", "give x, y, width and height in pixels, none below 0")
    return int(sides[0]), int(sides[1]), int(sides[2]), int(sides[3])


def region_message(region: Region | None) -> v1.Region | None:
    """Return the message of a region x, y, width, height [px]."""
    sides = region_px(region)
    if sides is None:
        return None
    x_px, y_px, width_px, height_px = sides
    return v1.Region(x_px=x_px, y_px=y_px, width_px=width_px, height_px=height_px)


def optimize_message(options: HologramOptions) -> v1.OptimizeHologram:
    """Return the message of an optimization, without display, planes, kernel and files, which need the server."""
    loss = v1.OptimizeHologram.Loss(
        quantity=words.number("loss", v1.OptimizeHologram.Loss.Quantity, options.get("loss")),
        total_variation=options.get("total_variation", 0.0),
        speckle=options.get("speckle", 0.0),
    )
    return v1.OptimizeHologram(
        target_encoding=words.number("target_encoding", v1.Encoding, options.get("target_encoding")),
        target_fit=words.number("fit", v1.OptimizeHologram.Fit, options.get("fit")),
        target_area=words.number("area", v1.OptimizeHologram.Area, options.get("area")),
        propagation=words.number("propagation", v1.PropagationMethod, options.get("propagation")),
        method=words.number("method", v1.HologramMethod, options.get("method")),
        iterations=options.get("iterations"),
        learning_rate=options.get("learning_rate"),
        subframes=options.get("subframes"),
        seed=options.get("seed", 0),
        loss=loss if loss.ByteSize() else None,
        detector=words.number("detector", v1.Detector, options.get("detector")),
        region=region_message(options.get("region")),
        quantization_aware=options.get("quantization_aware", False),
        judge=words.number("judge", v1.OptimizeHologram.Judging, options.get("judge")),
    )


def learn_message(datasets: Sequence[str], options: LearnOptions) -> v1.LearnKernel:
    """Return the message of a learning job, without its start, which needs the server."""
    return v1.LearnKernel(
        datasets=datasets,
        model=words.number("model", v1.KernelModel, options.get("model")),
        degree=options.get("degree"),
        epochs=options.get("epochs"),
        learning_rate=options.get("learning_rate"),
        refinement_evaluations=options.get("refinement_evaluations"),
        seed=options.get("seed", 0),
        detector=words.number("detector", v1.Detector, options.get("detector")),
        region=region_message(options.get("region")),
    )
