"""Asynchronous results: what jobs made, read from the server."""

from __future__ import annotations

import io
import warnings
from typing import TYPE_CHECKING

import numpy as np

from lightpath import v1
from lightpath.hologram import Hologram
from lightpath.photograph import Photograph
from lightpath.quality import ShownPicture, expected_of, judged_by_another_model, judged_quality
from lightpath.reports import Evaluation, Report

if TYPE_CHECKING:
    from lightpath.aio.connection import Connection


async def read_hologram(connection: Connection, job: v1.Job) -> Hologram:
    """Return the hologram that a job optimized, with its files. Warn about what its figures leave out."""
    spec, result = job.spec.optimize_hologram, job.result.optimize_hologram
    phases, levels, pictures = [], [], []
    for each in result.wavelengths:
        arrays = [np.load(io.BytesIO(await connection.download(shown.phase))) for shown in each.subframes]
        phases.append(np.stack(arrays))
        levels.append([await connection.download(shown.pattern) for shown in each.subframes])
        pictures.append([await connection.download(plane.reconstruction) for plane in each.planes])
    colours = [await connection.download(digest) for digest in result.colour_reconstructions]
    hologram = Hologram(
        phases=np.stack(phases),
        levels_png=levels,
        reconstructions_png=pictures,
        colours_png=colours,
        pictures=[[_shown(each.wavelength_m, plane, job) for plane in each.planes] for each in result.wavelengths],
        losses=[each.loss for each in result.wavelengths],
        intensity_scales=[each.intensity_scale for each in result.wavelengths],
        region=(spec.region.x_px, spec.region.y_px, spec.region.width_px, spec.region.height_px),
        notes=list(dict.fromkeys(note for each in result.wavelengths for note in each.notes)),
        server_job=job,
    )
    for note in hologram.notes:
        warnings.warn(note, UserWarning, stacklevel=2)
    return hologram


def _shown(wavelength_m: float, plane: v1.OptimizeHologramResult.PlaneResult, job: v1.Job) -> ShownPicture:
    """Return how well a picture is shown, as the server judged it."""
    optics = (wavelength_m, plane.place.distance_m)
    used = {(each.wavelength_m, each.place.distance_m): each.kernel_version for each in job.kernels}
    kernel = used.get(optics) or "ideal"
    return ShownPicture(
        *optics,
        quality=judged_quality(plane.judgements, v1.Judgement.STAGE_DISPLAYED),
        optimized_quality=judged_quality(plane.judgements, v1.Judgement.STAGE_OPTIMIZED),
        expected=expected_of(plane.judgements, kernel),
        second_opinion=judged_by_another_model(plane.judgements),
        kernel=kernel,
    )


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
