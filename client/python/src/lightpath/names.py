"""Resource names of the API."""

from __future__ import annotations


def with_collection(collection: str, id_or_name: str) -> str:
    """Return `{collection}/{id}`. A name that already begins so is returned unchanged."""
    return id_or_name if id_or_name.startswith(f"{collection}/") else f"{collection}/{id_or_name}"


def last_part(name: str) -> str:
    """Return the last part of a name: the id."""
    return name.rpartition("/")[2]


def kernel_name(display: str, wavelength_m: float, distance_m: float) -> str:
    """Return the name of a kernel, such as `displays/lab/kernels/515nm-150mm`.

    As on the server, the wavelength is rounded to whole picometres and the distance to whole nanometres.
    """
    wavelength = _decimal(round(wavelength_m * 1e12), 3)
    distance = _decimal(round(distance_m * 1e9), 6)
    return f"{display}/kernels/{wavelength}nm-{distance}mm"


def _decimal(value: int, places: int) -> str:
    whole, rest = divmod(abs(value), 10**places)
    fraction = f".{rest:0{places}}".rstrip("0").rstrip(".")
    return f"{'-' if value < 0 else ''}{whole}{fraction}"
