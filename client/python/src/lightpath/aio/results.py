"""Asynchronous results: what jobs made, read from the server."""

from __future__ import annotations

import io
import warnings
from typing import TYPE_CHECKING

import numpy as np

from lightpath.hologram import Hologram
from lightpath.photograph import Photograph
from lightpath.reports import Evaluation, Report

if TYPE_CHECKING:
    from lightpath import v1
    from lightpath.aio.connection import Connection


async def read_hologram(connection: Connection, job: v1.Job) -> Hologram:
    """Return the hologram that a job optimized, with its files. Warn about what its figures leave out."""
    phases, levels, pictures = [], [], []
    for each in job.result.optimize_hologram.wavelengths:
        arrays = [np.load(io.BytesIO(await connection.download(shown.phase))) for shown in each.subframes]
        phases.append(np.stack(arrays))
        levels.append([await connection.download(shown.pattern) for shown in each.subframes])
        pictures.append([await connection.download(plane.reconstruction) for plane in each.planes])
    colours = [await connection.download(digest) for digest in job.result.optimize_hologram.colour_reconstructions]
    hologram = Hologram(job, np.stack(phases), levels, pictures, colours)
    for note in hologram.notes:
        warnings.warn(note, UserWarning, stacklevel=2)
    return hologram


async def read_photograph(connection: Connection, job: v1.Job) -> Photograph:
    """Return the photograph that a simulated display took."""
    photo = job.result.simulate_capture.photo
    return Photograph(await connection.download(photo), photo)


async def read_evaluation(_connection: Connection, job: v1.Job) -> Evaluation:
    """Return how well a kernel predicts photographs."""
    [used] = job.kernels
    return Evaluation(job.spec.evaluate_kernel.dataset, used.kernel_version or "ideal", job.result.evaluate_kernel)


async def read_report(connection: Connection, job: v1.Job) -> Report:
    """Return the report of a version of a kernel, with its files."""
    result = job.result.report_kernel
    page = await connection.download(result.html)
    with np.load(io.BytesIO(await connection.download(result.arrays)), allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    figures = [(figure.title, await connection.download(figure.artifact)) for figure in result.figures]
    return Report(page, arrays, figures)


async def read_preparation(_connection: Connection, job: v1.Job) -> v1.PrepareDatasetResult:
    """Return what aligning or finalizing a dataset found."""
    return job.result.prepare_dataset
