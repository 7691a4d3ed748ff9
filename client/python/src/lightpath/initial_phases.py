"""The phase with which the search for a hologram starts."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from lightpath import v1
from lightpath.errors import InvalidArgument
from lightpath.pictures import Phase
from lightpath.units import Length, metres

if TYPE_CHECKING:
    import numpy.typing as npt


@dataclass(frozen=True)
class RandomPhase:
    """Random phases in [0, `range_rad`), drawn from the seed. A wide range gives speckle; None: 1 rad."""

    range_rad: float | None = None


@dataclass(frozen=True)
class BackPropagatedPhase:
    """The phase of the field that the targets send back to the SLM, with random phases in the image up to `range_rad`.

    None: all of the image has the same phase.
    """

    range_rad: float | None = None


@dataclass(frozen=True)
class LensPhase:
    """The phase of a lens. None: a focal length with which the edges steer light by half of the band."""

    focal_length: Length | None = None


@dataclass(frozen=True)
class ConstantPhase:
    """The same phase everywhere [rad]."""

    phase_rad: float = 0.0


Word: TypeAlias = Literal["recommended", "random", "back-propagated", "quadratic", "constant"]
InitialPhase: TypeAlias = Word | RandomPhase | BackPropagatedPhase | LensPhase | ConstantPhase | Phase
"""A word, one of the classes above, or phases [rad]: [y][x], with an axis before for several subframes, and before that
for several wavelengths."""

_WORDS: dict[str, Any] = {
    "recommended": None,
    "random": RandomPhase(),
    "back-propagated": BackPropagatedPhase(),
    "quadratic": LensPhase(),
    "constant": ConstantPhase(),
}


def named(initial: InitialPhase | None) -> Any:
    """Return what a word stands for. None is the recommended phase."""
    if not isinstance(initial, str):
        return initial
    if initial not in _WORDS and not Path(initial).suffix:
        words = f"choose one of {', '.join(_WORDS)}, or give the path of a file"
        raise InvalidArgument("initial_phase", f'is "{initial}"', words)
    return _WORDS.get(initial, initial)


def message_of(initial: Any) -> v1.OptimizeHologram.InitialPhase | None:
    """Return the message of a phase that is not given; None: it is given."""
    kinds = v1.OptimizeHologram.InitialPhase
    if isinstance(initial, RandomPhase):
        return kinds(random=kinds.Random(range_rad=initial.range_rad))
    if isinstance(initial, BackPropagatedPhase):
        return kinds(back_propagated=kinds.Random(range_rad=initial.range_rad))
    if isinstance(initial, LensPhase):
        return kinds(quadratic=kinds.Lens(focal_length_m=_focal_length_m(initial)))
    if isinstance(initial, ConstantPhase):
        return kinds(constant=kinds.Constant(phase_rad=initial.phase_rad))
    return None


def options_of(initial: Any) -> dict[str, Any] | None:
    """Return a phase as the engine reads it; None: the recommended one."""
    if initial is None:
        return None
    if isinstance(initial, RandomPhase):
        return {"random": {"range_rad": 1.0 if initial.range_rad is None else initial.range_rad}}
    if isinstance(initial, BackPropagatedPhase):
        return {"back_propagated": {"range_rad": initial.range_rad or 0.0}}
    if isinstance(initial, LensPhase):
        return {"quadratic": {"focal_length_m": _focal_length_m(initial)}}
    if isinstance(initial, ConstantPhase):
        return {"constant": {"phase_rad": initial.phase_rad}}
    return {"given": None}


def parts_of(phases: npt.NDArray[Any], wavelengths: int, subframes: int) -> npt.NDArray[Any]:
    """Return given phases as [wavelength][subframe][y][x]."""
    wanted = (wavelengths, subframes)
    before = tuple(side for side in wanted if side > 1)
    if phases.shape[:-2] not in {before, wanted}:
        form = "".join(f"[{side}]" for side in before) + "[rows][columns]"
        raise InvalidArgument("initial_phase", f"has the shape {phases.shape}", f"give {form}")
    return np.reshape(phases, (*wanted, *phases.shape[-2:]))


def _focal_length_m(lens: LensPhase) -> float | None:
    return None if lens.focal_length is None else metres("focal_length", lens.focal_length)
