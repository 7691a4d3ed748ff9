"""The asynchronous client."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

import numpy as np
from conftest import DISTANCE, target

import lightpath

if TYPE_CHECKING:
    from conftest import Server


def test_many_holograms_at_once(server: Server) -> None:
    async def work() -> list[lightpath.Hologram]:
        async with lightpath.aio.connect(server.url) as lab:
            display = await lab.create_display(
                "bench", resolution="160x96", pixel_pitch="8um", wavelength="515nm", simulated=1
            )
            holograms = await asyncio.gather(
                *(display.optimize(target(i), distance=DISTANCE, iterations=5, progress=False) for i in range(4))
            )
            photo = await display.photograph(holograms[0])
            assert photo.pixels.shape == (96, 160)
            kernels = await display.kernels()
            assert all(kernel.message.display == "displays/bench" for kernel in kernels)
            return holograms

    holograms = asyncio.run(work())
    with lightpath.connect(server.url) as lab:
        blocking = lab.display("bench").optimize(target(2), distance=DISTANCE, iterations=5)
    assert np.array_equal(blocking.phase, holograms[2].phase)


def test_a_cancelled_wait_leaves_the_job(server: Server) -> None:
    async def work() -> None:
        async with lightpath.aio.connect(server.url) as lab:
            display = await lab.create_display("wide", resolution="640x384", pixel_pitch="8um", wavelength="515nm")
            job = await display.submit_optimize(target(1), distance=DISTANCE, iterations=10_000)
            runs = asyncio.Event()
            wait = asyncio.create_task(job.wait(progress=lambda state: runs.set() if state.progress.step else None))
            await runs.wait()
            wait.cancel()
            assert isinstance((await asyncio.gather(wait, return_exceptions=True))[0], asyncio.CancelledError)
            assert (await job.refresh()).state == "running"
            await job.cancel()
            await job.wait(progress=False)

    asyncio.run(work())
