"""Implicit finite-strain material point method. `help(…)` of a name explains it."""

import os
import sys

# Laws from libraries find the utility routines of Abaqus in the extension, if its symbols are global.
if hasattr(os, "RTLD_GLOBAL"):
    _flags = sys.getdlopenflags()
    sys.setdlopenflags(_flags | os.RTLD_GLOBAL)
try:
    from . import _bfree
finally:
    if hasattr(os, "RTLD_GLOBAL"):
        sys.setdlopenflags(_flags)

from ._bfree import (
    Law,
    Number,
    Particles,
    Scene,
    SceneError,
    Simulation,
    Step,
    StepError,
    Tangent,
    __version__,
    det,
)

__all__ = [
    "Law",
    "Number",
    "Particles",
    "Scene",
    "SceneError",
    "Simulation",
    "Step",
    "StepError",
    "Tangent",
    "__version__",
    "det",
]
