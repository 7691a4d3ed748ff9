"""Holograms that look right on a real display: the client of a Lightpath server.

```python
import lightpath

with lightpath.connect() as lab:
    display = lab.create_display("pluto", resolution="1920x1080", pixel_pitch="8um", wavelength="515nm")
    hologram = display.optimize("photo.png", distance="150mm")
    hologram.save("hologram.png")
```

`lightpath.aio` has the same for asyncio, `lightpath.plot` draws with matplotlib, and `lightpath.v1` has the messages of
the API.
"""

from lightpath import aio, v1
from lightpath.errors import (
    Aborted,
    AlreadyExists,
    Damaged,
    Exhausted,
    FieldViolation,
    InvalidArgument,
    InvalidRequest,
    JobUnsuccessful,
    LightpathError,
    MissingKernel,
    NotAllowed,
    NotFound,
    PreconditionFailed,
    ProtocolError,
    Refused,
    Unreachable,
    WaitInterrupted,
)
from lightpath.hologram import Hologram
from lightpath.learned import LearnedKernel
from lightpath.options import HologramOptions, LearnOptions, SubmitOptions
from lightpath.photograph import Photograph, PhotoScore
from lightpath.pictures import Phase, Picture
from lightpath.reports import Evaluation, Report
from lightpath.sync import Connection, Dataset, Display, Job, Kernel, KernelVersion, Lab, connect
from lightpath.units import Length
from lightpath.v1 import AllOrders, OrderFilter, SimulatedBench

__all__ = [
    "Aborted",
    "AllOrders",
    "AlreadyExists",
    "Connection",
    "Damaged",
    "Dataset",
    "Display",
    "Evaluation",
    "Exhausted",
    "FieldViolation",
    "Hologram",
    "HologramOptions",
    "InvalidArgument",
    "InvalidRequest",
    "Job",
    "JobUnsuccessful",
    "Kernel",
    "KernelVersion",
    "Lab",
    "LearnOptions",
    "LearnedKernel",
    "Length",
    "LightpathError",
    "MissingKernel",
    "NotAllowed",
    "NotFound",
    "OrderFilter",
    "Phase",
    "PhotoScore",
    "Photograph",
    "Picture",
    "PreconditionFailed",
    "ProtocolError",
    "Refused",
    "Report",
    "SimulatedBench",
    "SubmitOptions",
    "Unreachable",
    "WaitInterrupted",
    "aio",
    "connect",
    "v1",
]
