"""Targets that are complex fields: amplitude and phase of the light in the image.

Only double-phase encoding shows both. The other methods compare light, and choose the phase in the image.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from lightpath.errors import InvalidArgument
from lightpath.pictures import is_complex, numbers_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lightpath.pictures import Picture


def as_light(targets: Sequence[Picture], options: dict[str, Any]) -> Sequence[Picture]:
    """Return the light of a target that is a complex field, and add its phase to the options as the initial phase.

    Targets that are no fields are returned as they are.
    """
    if not any(is_complex(target) for target in targets):
        return targets
    method = options.get("method") or "lbfgs"
    if method != "double-phase":
        fix = (
            "use method='double-phase', which shows amplitude and phase; or give the light alone, as"
            " numpy.abs(field) ** 2 with target_encoding='linear'"
        )
        raise InvalidArgument("target", f"is a complex field, but {method} compares light alone", fix)
    if len(targets) > 1 or np.ndim(options.get("wavelength", 0)) > 0:
        raise InvalidArgument("target", "has complex fields", "give one field, for one wavelength and one distance")
    if options.get("initial_phase") is not None:
        raise InvalidArgument("initial_phase", "is given with a complex target", "leave it out: the target has phases")
    field = numbers_of("target", targets[0])
    light = np.abs(field) ** 2
    if not np.isfinite(light).all() or not light.any():
        raise InvalidArgument("target", "is black or not finite", "give a field with finite amplitudes above 0")
    options.update(
        target_encoding="linear",
        fit="exact",
        area="display",
        initial_phase=np.mod(np.angle(field), 2 * np.pi).astype(np.float32),
    )
    return [light / light.max()]
