"""The compiled part of `lightpath.local`. Use that module: it checks what it is given, and knows units."""

from lightpath_engine._engine import (
    DisplayModel,
    EngineError,
    HologramLoss,
    Propagator,
    SimulatedDisplay,
    __version__,
    learn,
    levels,
    losses,
    optimize,
    plan,
    target,
)

__all__ = [
    "DisplayModel",
    "EngineError",
    "HologramLoss",
    "Propagator",
    "SimulatedDisplay",
    "__version__",
    "learn",
    "levels",
    "losses",
    "optimize",
    "plan",
    "target",
]
