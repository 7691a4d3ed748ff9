"""Lightpath's engine in this process, without a server.

```python
from lightpath import local

hologram = local.optimize("photo.png", resolution="960x540", wavelength="515nm", pixel_pitch="8um", distance="150mm")
hologram.save("hologram.png")
```

Arrays are [y][x], in NumPy or PyTorch. Lengths are metres or text with a unit.
Computations run on all processors, or on `RAYON_NUM_THREADS` threads, while other threads of Python go on.
"""

from lightpath.hologram import Hologram
from lightpath.local.display import DisplayModel, LearningRecord, SimulatedDisplay
from lightpath.local.engine import EngineRefused
from lightpath.local.hologram import HologramLoss, optimize
from lightpath.local.learning import learn
from lightpath.local.optics import OpticsOptions
from lightpath.local.options import LossOptions, OptimizeOptions
from lightpath.local.propagation import Propagated, Propagator, plan, propagate, transfer_function
from lightpath.plans import Plan, PlanWarning
from lightpath.quality import DetectorQuality, Quality, SecondOpinion

__all__ = [
    "DetectorQuality",
    "DisplayModel",
    "EngineRefused",
    "Hologram",
    "HologramLoss",
    "LearningRecord",
    "LossOptions",
    "OpticsOptions",
    "OptimizeOptions",
    "Plan",
    "PlanWarning",
    "Propagated",
    "Propagator",
    "Quality",
    "SecondOpinion",
    "SimulatedDisplay",
    "learn",
    "optimize",
    "plan",
    "propagate",
    "transfer_function",
]
