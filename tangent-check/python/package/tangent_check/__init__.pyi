"""Checks that the tangent of a law or of a residual is its derivative. There is no tolerance to choose."""

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

def check_law(
    stress: Callable[..., Any],
    tangent: Callable[[NDArray[np.float64]], Any] | None = None,
    *,
    convention: str = "piola",
    order: str | None = None,
    dimension: int = 3,
    state: ArrayLike = (),
    states: Mapping[str, ArrayLike] | Sequence[ArrayLike] | None = None,
    dt: float = 0.1,
    seed: int = 1,
    name: str | None = None,
) -> Report:
    ...

def check_law_library(
    library: str | os.PathLike[str],
    *,
    umat: bool = False,
    mfront: str | None = None,
    c: str | None = None,
    properties: ArrayLike = (),
    state: int | Mapping[str, float] | Sequence[str] = 0,
    tangent: str = "jaumann_kirchhoff",
    temperature: float = 0.0,
    name: str = "BFREE",
    external: Mapping[str, float] | None = None,
    plane_strain: bool = False,
    plane_stress: bool = False,
    states: Mapping[str, ArrayLike] | Sequence[ArrayLike] | None = None,
    dt: float = 0.1,
    seed: int = 1,
    limit: float = 5.0,
) -> Report:
    ...

def check_tangent(
    residual: Callable[[NDArray[np.float64]], Any],
    jacobian: Any,
    u: ArrayLike,
    *,
    terms: Mapping[str, tuple[Callable[[NDArray[np.float64]], Any], Any]] | None = None,
    start: ArrayLike | None = None,
    scale: ArrayLike | None = None,
    seed: int = 1,
    name: str | None = None,
) -> Report:
    ...

def newton_order(norms: ArrayLike, *, round_off: float | None = None) -> NewtonOrder:
    """The order of convergence from the residual norms of a solution: ‖R‖ at the initial guess and after each iteration.

    Norms up to `round_off` are round-off; by default 1e-14 of the greatest norm.
    """

def newton_table(
    solutions: Mapping[str, ArrayLike] | Sequence[ArrayLike],
    form: Literal["text", "markdown", "latex", "csv"] = "text",
    *,
    round_off: float | None = None,
) -> str:
    ...

@final
class LawStep:
    """The inputs of a law in a step. Tensors are arrays (3, 3), or (2, 2) in two dimensions."""

    @property
    def F(self) -> NDArray[np.float64]:
        """Deformation gradient at the end of the step."""

    @property
    def F_before(self) -> NDArray[np.float64]:
        """Deformation gradient at the start of the step."""

    @property
    def strain(self) -> NDArray[np.float64]:
        """Accumulated strain at the start of the step, turned by `rotation`."""

    @property
    def strain_increment(self) -> NDArray[np.float64]:
        """Δε = ln ΔV of F F_before⁻¹ = ΔV ΔR."""

    @property
    def rotation(self) -> NDArray[np.float64]:
        """ΔR"""

    @property
    def stress(self) -> NDArray[np.float64]:
        """The stress at the start of the step as the law returned it, not turned."""

    @property
    def state(self) -> NDArray[np.float64]:
        """Internal variables at the start of the step, (n,)."""

    @property
    def time(self) -> float:
        """Time at the start of the step."""

    @property
    def dt(self) -> float:
        """The length of the step."""

    @property
    def number(self) -> int:
        """The number of the step, from 1."""

@final
class Report:
    """The checks of a law or a residual. `str(report)` is a table for a terminal; a notebook shows Markdown."""

    @property
    def verdict(self) -> Literal["consistent", "inexact", "not checked", "wrong"]:
        """The worst verdict of the findings. States at kinks do not count beside others."""

    @property
    def ok(self) -> bool:
        """Whether the tangent is consistent, or inexact."""

    @property
    def subject(self) -> str:
        """The name of the law or residual."""

    @property
    def convention(self) -> str:
        """The meaning of the tangent, with the order of its components; empty for residuals."""

    @property
    def seed(self) -> int: ...
    @property
    def findings(self) -> list[Finding]: ...
    @property
    def diagnoses(self) -> list[Diagnosis]:
        """Mistakes that explain a wrong tangent; empty if none of the frequent ones does."""

    @property
    def notes(self) -> list[str]:
        """Sentences: the inputs that the law reads, mistakes that these states cannot show."""

    @property
    def exception(self) -> BaseException | None:
        """The first exception that a function of yours raised."""

    def assert_consistent(self, *, allow_inexact: bool = False) -> None:
        """Raises an AssertionError with the report, unless the tangent is consistent, or inexact and `allow_inexact`.

        A tangent that is not checked raises too. The cause of the error is `exception`.
        """

    def exit_code(self, *, allow_inexact: bool = False) -> int:
        """0 consistent, 1 wrong or inexact, 2 not checked; inexact is 0 with `allow_inexact`."""

    def to_markdown(self, *, allow_inexact: bool = False) -> str: ...
    def to_json(self, *, allow_inexact: bool = False) -> str:
        """All numbers. `tangent-check/src/report/json.schema.json` describes the format."""

    def to_junit(self, *, allow_inexact: bool = False) -> str:
        """JUnit XML."""

    def to_sarif(self, file: str | None = None, *, allow_inexact: bool = False) -> str:
        """A SARIF 2.1.0 log, whose results point to `file`."""

    def to_github(self, file: str | None = None, *, allow_inexact: bool = False) -> str:
        """Annotations of GitHub Actions, which point to `file`: print them."""

    def _repr_markdown_(self) -> str: ...

@final
class Finding:
    """The check of one tangent in one state."""

    @property
    def name(self) -> str:
        """The state or term."""

    @property
    def verdict(self) -> Literal["consistent", "inexact", "not checked", "wrong"]: ...
    @property
    def reason(
        self,
    ) -> Literal["forward difference", "single precision", "local iteration", "round-off", "not found",
                 "kink", "nothing exercised", "zero response", "too noisy", "control missed", "call failed"] | None:
        """Why the tangent was not checked."""

    @property
    def sentence(self) -> str | None:
        """`reason` in a sentence, with its numbers or the text of an exception."""

    @property
    def worst(self) -> Entry | None:
        """The entry that deviates most."""

    @property
    def deviation(self) -> float:
        """The greatest |claimed − measured|, relative to the greatest entry of the measured tangent."""

    @property
    def error(self) -> float:
        """The greatest estimated error of the differences, with the same scale."""

    @property
    def noise(self) -> float:
        """The noise of the response, relative to its greatest component."""

    @property
    def control(self) -> float | None:
        """The smallest planted error that the check saw, relative to the spoiled entry."""

    @property
    def calls(self) -> int:
        """Calls of the stress or residual."""

    @property
    def claimed(self) -> NDArray[np.float64]:
        """The tangent as claimed; beyond 30 unknowns its products with random directions, a column each."""

    @property
    def measured(self) -> NDArray[np.float64]:
        """The tangent as measured. Entries that could not be measured are NaN."""

    @property
    def errors(self) -> NDArray[np.float64]:
        """The estimated error of each measured entry."""

@final
class Entry:
    """An entry of a tangent."""

    @property
    def row(self) -> int:
        """From 0."""

    @property
    def column(self) -> int:
        """From 0."""

    @property
    def claimed(self) -> float: ...
    @property
    def measured(self) -> float: ...
    @property
    def error(self) -> float:
        """The estimated error of `measured`."""

@final
class Diagnosis:
    """A frequent mistake that explains a wrong tangent."""

    @property
    def sentence(self) -> str: ...
    @property
    def candidates(self) -> list[str]:
        """All mistakes that explain the tangent equally well in the states tried; one if the diagnosis is unique."""

    @property
    def states_that_tell(self) -> list[str]:
        """States that would tell the candidates apart."""

    @property
    def share(self) -> float:
        """The part of the deviation that the mistake explains."""

    @property
    def coefficient(self) -> float | None:
        """The coefficient of a missing or surplus term."""

@final
class NewtonOrder:
    """The order of convergence that residual norms show: `str(order)` is "quadratic (2.0)", for instance."""

    @property
    def kind(self) -> Literal["quadratic", "superlinear", "linear", "round-off at once", "unknown", "not finite"]: ...
    @property
    def order(self) -> float | None: ...
    @property
    def orders(self) -> list[float | None]:
        """The order that each iteration shows, from the second on; None where it shows none."""

    @property
    def is_quadratic(self) -> bool:
        """Whether the order is quadratic, or the norms reach round-off at once."""
