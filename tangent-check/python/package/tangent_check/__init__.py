"""Checks that the tangent of a law or of a residual is its derivative. `help(…)` of a name explains it."""

from ._native import Diagnosis, Entry, Finding, LawStep, NewtonOrder, Report, __version__, newton_order
from .checks import check_law, check_law_library, check_tangent, newton_table

__all__ = [
    "Diagnosis",
    "Entry",
    "Finding",
    "LawStep",
    "NewtonOrder",
    "Report",
    "__version__",
    "check_law",
    "check_law_library",
    "check_tangent",
    "newton_order",
    "newton_table",
]
