"""Enumerations of the API as words, such as `"gerchberg-saxton"`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from lightpath.errors import InvalidArgument

if TYPE_CHECKING:
    from google.protobuf.internal.enum_type_wrapper import _EnumTypeWrapper

Method: TypeAlias = Literal["lbfgs", "adam", "gerchberg-saxton", "weighted-gerchberg-saxton", "double-phase"]
Detector: TypeAlias = Literal["pixel", "point", "supersampled"]
Encoding: TypeAlias = Literal["srgb", "linear"]
Fit: TypeAlias = Literal["contain", "cover", "stretch", "exact"]
Area: TypeAlias = Literal["region", "display"]
Judging: TypeAlias = Literal["full", "quick", "none"]
Stage: TypeAlias = Literal["optimized", "displayed", "photographed"]
Quantity: TypeAlias = Literal["intensity", "amplitude"]
Model: TypeAlias = Literal["display", "varying", "smooth", "dense", "paper"]
Split: TypeAlias = Literal["train", "validation", "test"]
State: TypeAlias = Literal["queued", "running", "succeeded", "failed", "cancelled"]
Carrier: TypeAlias = Literal["half-order-x", "half-order-y"]
KernelFormat: TypeAlias = Literal["safetensors", "compact", "pt", "npy", "npz", "complex64", "f16", "bundle"]
Propagation: TypeAlias = Literal[
    "band-response",
    "all-orders",
    "angular-spectrum",
    "band-limited",
    "rayleigh-sommerfeld",
    "fresnel-transfer-function",
    "fresnel-impulse-response",
    "shifted",
    "band-extended",
    "scaled",
    "scaled-fresnel",
    "fraunhofer",
]


def number(field: str, enumeration: _EnumTypeWrapper[Any], word: str | None) -> Any:
    """Return the number of a word. None gives 0, for which the server uses its default."""
    if word is None:
        return 0
    words = {name_of(enumeration, value): value for value in enumeration.values() if value}
    if word not in words:
        raise InvalidArgument(field, f'is "{word}"', f"choose one of {', '.join(words)}")
    return words[word]


def name_of(enumeration: _EnumTypeWrapper[Any], value: int) -> str:
    """Return the word of a number."""
    prefix = enumeration.DESCRIPTOR.values_by_number[0].name.removesuffix("UNSPECIFIED")
    if value not in enumeration.values():
        # A newer server may have values that this package does not know.
        return str(value)
    return enumeration.Name(value).removeprefix(prefix).lower().replace("_", "-")
