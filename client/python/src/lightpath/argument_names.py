"""Names of the API's fields and of the engine's quantities as the arguments of this package."""

from __future__ import annotations

import re

# In the order in which they are tried. A number in brackets stays where an argument has several values.
_FIELDS = [
    (r"spec\.\w+\.|request\.|(?:display|dataset|pair|rollout|webhook|gate)\.(?=[a-z])", ""),
    (r"planes\[(\d+)\]\.place(?:\.distance_m)?", r"distance[\1]"),
    (r"planes\[(\d+)\]\.target", r"target[\1]"),
    (r"\bplace\.distance_m\b", "distance"),
    (r"\bdistance_m\b", "distance"),
    (r"\bwavelengths_m(\[\d+\])?", r"wavelength\1"),
    (r"\bwavelength_m\b", "wavelength"),
    (r"\bmodulator\.(?:width|height)_px\b", "resolution"),
    (r"\bmodulator\.pixel_pitch_[xy]_m\b|\bpixel_pitch_m\b", "pixel_pitch"),
    (r"\bmodulator\.phase(?:\.response_rad)?", "phase_response_rad"),
    (r"\bmodulator\.bit_depth\b", "bit_depth"),
    (r"\bsimulated_bench\b", "simulated"),
    (r"\border_filter\b|\ball_orders\b", "orders"),
    (r"\btarget_fit\b", "fit"),
    (r"^frames\b", "subframes"),
    (r"\btarget_intensity\b", "target"),
    (r"\bregion_of_interest\b", "region"),
    (r"\bloss\.quantity\b", "loss"),
    (r"\bloss\.(total_variation|speckle)\b", r"\1"),
    (r"\binitial_phase\.(?:given\.phases|\w+)(?:\[\d+\])?(?:\.(\w+?)(?:_m)?\b)?", r"initial_phase"),
    (r"\binitial_phase_range_rad\b", "initial_phase"),
    (r"\bkernel\.(?:version|alias)\b", "kernel"),
]
# Words that a text for people may have in another sense.
_WHOLE_FIELDS = {"planes": "distance", "place": "distance"}
_RULES = [(re.compile(pattern), name) for pattern, name in _FIELDS]


def argument(field: str) -> str:
    """Return the argument that became a field, such as `distance` for `spec.optimize_hologram.planes[0].place`.

    Fields that have no other name stay as they are.
    """
    found = in_text(field)
    # An argument with a single value has no number, and a part of a region is no argument.
    name = found.removesuffix("[0]").removesuffix(".distance_m")
    return "region" if name.startswith("region.") else _WHOLE_FIELDS.get(name, name)


def in_text(text: str) -> str:
    """Return a text for people in which fields have the names of arguments."""
    for pattern, name in _RULES:
        text = pattern.sub(name, text)
    return text
