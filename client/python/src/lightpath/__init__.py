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
    InvalidSignature,
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
from lightpath.events import Event
from lightpath.hologram import Hologram
from lightpath.learned import LearnedKernel
from lightpath.options import HologramOptions, LearnOptions, SubmitOptions
from lightpath.photograph import Photograph, PhotoScore
from lightpath.pictures import Phase, Picture
from lightpath.promotion import PromotionGate, Verdict
from lightpath.reports import Evaluation, Report
from lightpath.server import Artifact, Batch, KernelManifest, Keyring, Queue, ServerInfo
from lightpath.sync import (
    Connection,
    Dataset,
    Device,
    Display,
    Job,
    Kernel,
    KernelVersion,
    Lab,
    Rollout,
    Webhook,
    connect,
)
from lightpath.units import Length
from lightpath.v1 import AllOrders, OrderFilter, SimulatedBench
from lightpath.webhooks import Delivery, WebhookEvent, read_webhook

__all__ = [
    "Aborted",
    "AllOrders",
    "AlreadyExists",
    "Artifact",
    "Batch",
    "Connection",
    "Damaged",
    "Dataset",
    "Delivery",
    "Device",
    "Display",
    "Evaluation",
    "Event",
    "Exhausted",
    "FieldViolation",
    "Hologram",
    "HologramOptions",
    "InvalidArgument",
    "InvalidRequest",
    "InvalidSignature",
    "Job",
    "JobUnsuccessful",
    "Kernel",
    "KernelManifest",
    "KernelVersion",
    "Keyring",
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
    "PromotionGate",
    "ProtocolError",
    "Queue",
    "Refused",
    "Report",
    "Rollout",
    "ServerInfo",
    "SimulatedBench",
    "SubmitOptions",
    "Unreachable",
    "Verdict",
    "WaitInterrupted",
    "Webhook",
    "WebhookEvent",
    "aio",
    "connect",
    "read_webhook",
    "v1",
]
