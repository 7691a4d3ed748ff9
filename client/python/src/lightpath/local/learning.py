"""Learning a display from photographs of its holograms."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, get_args

import numpy as np

from lightpath import words
from lightpath.errors import InvalidArgument
from lightpath.local.arrays import Array, light, phase_rad
from lightpath.local.display import DisplayModel, LearningRecord
from lightpath.local.engine import engine, refusals
from lightpath.local.optics import choose, optics_json
from lightpath.local.progress import Progress, listener
from lightpath.options import Region, region_px

if TYPE_CHECKING:
    from lightpath.local.optics import Method, OpticsOptions
    from lightpath.units import Length


def learn(
    phases: Array,
    captures: Array,
    *,
    wavelength: Length,
    pixel_pitch: Length,
    distance: Length,
    propagation: Method = "auto",
    model: words.Model = "display",
    degree: int | None = None,
    epochs: int | None = None,
    learning_rate: float | None = None,
    refinement_evaluations: int | None = None,
    seed: int = 0,
    region: Region | None = None,
    detector: words.Detector = "pixel",
    validation: float = 0.2,
    start: DisplayModel | None = None,
    progress: Progress = False,
) -> DisplayModel:
    """Learn a display from holograms and photographs of them.

    Options that are None have the default of the model, as on a server; `lightpath.LearnOptions` describes them. A
    server also aligns photographs, judges the model on test pairs and keeps versions; this function does not. Ctrl-C
    stops it.

    - `phases`: holograms [count][rows][columns], radians, or grey levels of 8 bits
    - `captures`: photographs in linear light, aligned with the display's pixels, of the same shape: uint8, uint16, or
      floats from 0 to 1
    - `validation`: part of the pairs, drawn by `seed`, that chooses the parts of the model and is not fitted
    - `start`: a model to start from, such as an earlier one of the same display
    """
    holograms, photos = phase_rad("phases", phases, axes=3), light("captures", captures, axes=3)
    if holograms.shape != photos.shape:
        raise InvalidArgument("captures", f"have the shape {photos.shape}", f"give {holograms.shape}, as of phases")
    if not 0 <= validation < 1:
        raise InvalidArgument("validation", f"is {validation}", "give a part of the pairs, from 0 to below 1")
    drawn = np.random.default_rng(seed).permutation(len(holograms))
    held_out = round(validation * len(drawn))
    training, held = sorted(drawn[held_out:].tolist()), sorted(drawn[:held_out].tolist())
    free_space: OpticsOptions = {"wavelength": wavelength, "pixel_pitch": pixel_pitch, "distance": distance}
    optics = optics_json((holograms.shape[2], holograms.shape[1]), {**free_space, "method": propagation})
    options = {
        "optics": json.loads(optics),
        "model": choose("model", model, get_args(words.Model)),
        "degree": degree,
        "epochs": epochs,
        "learning_rate": learning_rate,
        "refinement_evaluations": refinement_evaluations,
        "seed": seed,
        "region": region_px(region),
        "detector": choose("detector", detector, get_args(words.Detector)),
        "training": training,
        "validation": held,
    }
    with refusals(), listener(progress, "learn") as listen:
        native, history, kept = engine.learn(
            json.dumps(options), holograms, photos, None if start is None else start.native, listen
        )
        ideal = engine.DisplayModel.ideal(optics)
        pairs = holograms[held], photos[held]
        losses = (
            [engine.losses(each, *pairs, region_px(region), detector) for each in (native, ideal)] if held else [[], []]
        )
    means = [float(np.mean(each)) if each else None for each in losses]
    record = LearningRecord(
        loss_history=tuple(history),
        training=tuple(kept),
        left_out=tuple(sorted(set(training) - set(kept))),
        validation=tuple(held),
        validation_loss=means[0],
        ideal_validation_loss=means[1],
    )
    return DisplayModel(native, record)
