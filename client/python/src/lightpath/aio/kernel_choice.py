"""Asynchronous choice of the kernel that a job uses."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lightpath import v1
from lightpath.errors import InvalidArgument, MissingKernel
from lightpath.presence import if_set
from lightpath.units import show_length

if TYPE_CHECKING:
    from lightpath.aio.connection import Connection
    from lightpath.options import Named


async def find_kernel(connection: Connection, display: str, place: v1.Place, wavelength_m: float | None) -> v1.Kernel:
    """Return the kernel of a display at a place, and of the only wavelength there if none is given."""
    request = v1.ListKernelsRequest(display=display, place=place, wavelength_m=wavelength_m)
    found = (await connection.call(connection.kernels.ListKernels, request)).kernels
    if not found:
        problem = f"is {show_length(place.distance_m)}, but {display} has no kernel there"
        raise MissingKernel("distance", problem, "learn one with dataset.learn(), or see display.kernels()")
    if len(found) > 1:
        choices = ", ".join(show_length(each.wavelength_m) for each in found)
        raise InvalidArgument("wavelength", "is missing", f"choose one of {choices}")
    return found[0]


async def of_hologram(
    connection: Connection, kernel: str | int | Named | None, message: v1.OptimizeHologram
) -> v1.KernelChoice | None:
    """Return the choice of the kernels of a hologram."""
    if not isinstance(kernel, int):
        return _choice(kernel)
    if len(message.planes) > 1 or len(message.wavelengths_m) > 1:
        fix = "give ideal, active or an alias, because each of several wavelengths and distances has its own kernel"
        raise InvalidArgument("kernel", f"is {kernel}", fix)
    wavelength_m = next(iter(message.wavelengths_m), None)
    return await _numbered(connection, kernel, message.display, message.planes[0].place, wavelength_m)


async def of_dataset(
    connection: Connection, kernel: str | int | Named | None, dataset: v1.Dataset
) -> v1.KernelChoice | None:
    """Return the choice of a kernel for a dataset's display, wavelength and place."""
    if not isinstance(kernel, int):
        return _choice(kernel)
    return await _numbered(connection, kernel, dataset.display, dataset.place, if_set(dataset, "wavelength_m"))


async def start_of_learning(connection: Connection, start: str | int | Named, dataset: str) -> str:
    """Return the name of the version from which learning starts; a number is one of the dataset's kernel."""
    if not isinstance(start, int):
        return start if isinstance(start, str) else start.name
    found = await connection.call(connection.datasets.GetDataset, v1.GetDatasetRequest(name=dataset))
    return (await _numbered(connection, start, found.display, found.place, if_set(found, "wavelength_m"))).version


def _choice(kernel: str | Named | None) -> v1.KernelChoice | None:
    """Return the choice of a kernel for which a word or a name stands."""
    if kernel is None:
        return None
    word = kernel if isinstance(kernel, str) else kernel.name
    if word == "ideal":
        return v1.KernelChoice(ideal=v1.KernelChoice.Ideal())
    if word == "active":
        return v1.KernelChoice(active=v1.KernelChoice.Active())
    return v1.KernelChoice(version=word) if "/" in word else v1.KernelChoice(alias=word)


async def _numbered(
    connection: Connection, version: int, display: str, place: v1.Place, wavelength_m: float | None
) -> v1.KernelChoice:
    kernel = await find_kernel(connection, display, place, wavelength_m)
    return v1.KernelChoice(version=f"{kernel.name}/versions/{version}")
