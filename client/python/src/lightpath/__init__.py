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
from lightpath.declared import AlignmentPoint, AllOrders, OrderFilter, SimulatedBench
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
from lightpath.initial_phases import BackPropagatedPhase, ConstantPhase, LensPhase, RandomPhase
from lightpath.learned import LearnedKernel
from lightpath.options import HologramOptions, LearnOptions, SubmitOptions
from lightpath.photograph import Photograph, PhotoScore
from lightpath.pictures import Phase, Picture
from lightpath.plans import Alternative, Estimate, Plan, PlanWarning
from lightpath.promotion import PromotionGate, Verdict
from lightpath.quality import DetectorQuality, Expected, Quality, SecondOpinion, ShownPicture
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
from lightpath.webhooks import Delivery, WebhookEvent, read_webhook

__all__ = [
    "Aborted",
    "AlignmentPoint",
    "AllOrders",
    "AlreadyExists",
    "Alternative",
    "Artifact",
    "BackPropagatedPhase",
    "Batch",
    "Connection",
    "ConstantPhase",
    "Damaged",
    "Dataset",
    "Delivery",
    "DetectorQuality",
    "Device",
    "Display",
    "Estimate",
    "Evaluation",
    "Event",
    "Exhausted",
    "Expected",
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
    "LensPhase",
    "LightpathError",
    "MissingKernel",
    "NotAllowed",
    "NotFound",
    "OrderFilter",
    "Phase",
    "PhotoScore",
    "Photograph",
    "Picture",
    "Plan",
    "PlanWarning",
    "PreconditionFailed",
    "PromotionGate",
    "ProtocolError",
    "Quality",
    "Queue",
    "RandomPhase",
    "Refused",
    "Report",
    "Rollout",
    "SecondOpinion",
    "ServerInfo",
    "ShownPicture",
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
