"""Implicit finite-strain material point method: scenes, simulations, what a step solves, and laws by their energy.

Arrays are read-only and belong to the moment at which they were asked for: later steps do not change them.
"""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.linalg import LinearOperator

__version__: str

class SceneError(ValueError):
    """A scene that cannot be used: which key, its value, what is allowed; a line for each cause."""

class StepError(RuntimeError):
    """A step that failed, with its causes; the simulation is as after the last good one."""

@final
class Scene:
    """A scene that has been read and checked."""

    def __init__(
        self,
        source: str | os.PathLike[str] | Mapping[str, Any],
        *,
        set: Mapping[str, Any] | None = None,
        folder: str | os.PathLike[str] | None = None,
        allow_libraries: Sequence[str | os.PathLike[str]] = (),
    ) -> None:
        """Reads a file, or takes a dict of the same keys.

        `set` replaces values by their paths, as `{"time.step": 0.01, "bodies.0.density": 3}`. Files that the scene names are looked for in
        `folder`: by default the one of the scene's file, or the current one. A scene loads shared libraries with material laws only if
        `allow_libraries` has their paths; the permission lasts as long as the interpreter.

        Raises SceneError.
        """

    @property
    def dimension(self) -> int:
        """1, 2 or 3."""

    def to_dict(self) -> dict[str, Any]:
        """All of its keys, with the values of those that were left out."""

    def build(self, *, laws: Mapping[str, Law] | None = None, gpu: bool = False) -> Simulation:
        """The simulation at its start; `laws` takes the place of the materials of the bodies of these names.

        With `gpu`, Newton's method and the transfers run on the GPU of this machine; `SceneError` if there is none.

        What bfree chooses by itself it chooses by the scene's material: give one of about the same stiffness.

        Raises SceneError.
        """

@final
class Simulation(Iterator[Step]):
    """A simulation. `for step in simulation` takes steps until the scene's `time.end`; the interpreter's lock is free while one is taken."""

    @property
    def bodies(self) -> list[str]:
        """Names of the bodies, in the order of `particles.body`."""

    @property
    def plan(self) -> str:
        """The plan of a step, as `bfree check` prints it."""

    @property
    def dimension(self) -> int:
        """D"""

    @property
    def time(self) -> float:
        """t"""

    @property
    def dt(self) -> float:
        """The length of the coming step."""

    @property
    def end(self) -> float:
        """When the last step ends: `time.end`; between whole steps it is shortened."""

    @property
    def particles(self) -> Particles:
        """The particles."""

    @property
    def kinetic_energy(self) -> float: ...
    @property
    def strain_energy(self) -> float: ...
    @property
    def external_work(self) -> float:
        """Work of loads and moving walls since the start."""

    @property
    def dissipated(self) -> float:
        """Energy that damping has taken since the start."""

    @property
    def momentum(self) -> NDArray[np.float64]:
        """Σ m v"""

    def advance(self) -> Step:
        """Takes a step, also beyond `end`; it is halved while it fails.

        Raises StepError, and leaves the state as it was.
        """

    def __iter__(self) -> Simulation: ...
    def __next__(self) -> Step: ...
    @property
    def nodes(self) -> NDArray[np.float64]:
        """Positions of the n active nodes of the coming step, (n, D)."""

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which of their components are solved for, (n, D): those that are neither prescribed nor follow other nodes."""

    @property
    def prescribed(self) -> NDArray[np.float64]:
        """Δφ of those that are not, 0 elsewhere, (n, D)."""

    def residual(self, dphi: ArrayLike) -> NDArray[np.float64]:
        """R(Δφ) of the coming step, (n, D); at prescribed components the reaction.

        Δφ is the motion of the nodes, (n, D) or as many numbers, from t up to where forces are in balance: the end of the step, but for
        generalised-α.

        Raises StepError where det F ≤ 0 at a particle.
        """

    def tangent(self, dphi: ArrayLike | None = None) -> LinearOperator:
        """K = ∂R/∂Δφ at Δφ, 0 by default, on the free components: rows and columns of the others are zero. Of order n·D.

        A product freezes the tangent anew; `K @ U` of several columns does so once.
        """

    @property
    def K(self) -> LinearOperator:
        """The tangent at Δφ = 0."""

    def to_pyvista(self, fields: Sequence[str] = ("displacement", "von_mises", "body")) -> Any:
        """The particles as pyvista.PolyData with these fields of `Particles`; needs the package pyvista."""

@final
class Particles:
    """The n particles, in the order of their making. What is asked for is that of the present state."""

    def __len__(self) -> int: ...
    @property
    def position(self) -> NDArray[np.float64]:
        """x, (n, D)"""

    @property
    def displacement(self) -> NDArray[np.float64]:
        """From the position at the start, (n, D)."""

    @property
    def velocity(self) -> NDArray[np.float64]:
        """v, (n, D); with inertia only."""

    @property
    def acceleration(self) -> NDArray[np.float64]:
        """a, (n, D); with inertia only."""

    @property
    def deformation_gradient(self) -> NDArray[np.float64]:
        """F, (n, 3, 3)"""

    @property
    def jacobian(self) -> NDArray[np.float64]:
        """det F, (n,)"""

    @property
    def strain(self) -> NDArray[np.float64]:
        """E = (FᵀF − I)/2, (n, 3, 3)"""

    @property
    def stress(self) -> NDArray[np.float64]:
        """Cauchy's, with the out-of-plane normal stress, (n, 3, 3)."""

    @property
    def principal_stress(self) -> NDArray[np.float64]:
        """Of Cauchy's stress, the largest first, (n, 3)."""

    @property
    def pressure(self) -> NDArray[np.float64]:
        """Positive in compression, (n,)."""

    @property
    def von_mises(self) -> NDArray[np.float64]:
        """(n,)"""

    @property
    def energy_density(self) -> NDArray[np.float64]:
        """W, per reference volume, (n,)."""

    @property
    def plastic_strain(self) -> NDArray[np.float64]:
        """(n,), accumulated plastic strain; 0 of laws that have none."""

    @property
    def dissipated_density(self) -> NDArray[np.float64]:
        """(n,), energy per reference volume that flow and relaxation have taken; 0 of elastic laws."""

    @property
    def mass(self) -> NDArray[np.float64]:
        """(n,)"""

    @property
    def volume(self) -> NDArray[np.float64]:
        """Of reference, (n,)."""

    @property
    def body(self) -> NDArray[np.int64]:
        """Number of the body, (n,)."""

@final
class Step:
    """The report of a step."""

    @property
    def time(self) -> float:
        """t at its end."""

    @property
    def dt(self) -> float:
        """Its length."""

    @property
    def iterations(self) -> int:
        """Newton's."""

    @property
    def krylov_iterations(self) -> int:
        """Of all linear systems."""

    @property
    def residuals(self) -> list[float]:
        """‖R‖ at the start of Newton's method and after each iteration."""

    @property
    def active_nodes(self) -> int: ...
    @property
    def error(self) -> float | None:
        """Its local error in units of the grid spacing, where the scene gives a tolerance."""

    @property
    def failed(self) -> list[str]:
        """Why earlier attempts failed, each repeated with half of its length."""

    @property
    def seconds(self) -> float: ...
    @property
    def reactions(self) -> dict[str, NDArray[np.float64]]:
        """The force of each prescribed condition on the bodies, (D,)."""

@final
class Law:
    """An elastic law by its energy W per reference volume, a function of the 3×3 Green–Lagrange strain E."""

    def __init__(self, energy: Callable[[NDArray[Any]], Any], *, check: bool = True) -> None:
        """Calls `energy` once, with an array whose entries record what is done to them, and differentiates what was recorded twice.

        Arithmetic, powers, NumPy's sqrt, exp, log, sin, cos, tan, sinh, cosh, tanh, arctan and this module's `det` can be recorded;
        branches and comparisons cannot. `check` compares the derivatives in 1, 2 and 3 dimensions, from strains of 1e-8 to J = 0.05 and 20,
        asks for no energy and stress at rest, and for independence of rotations.

        Raises ValueError or TypeError.
        """

    def check(self) -> str:
        """The table of the checks."""

    @property
    def operations(self) -> int:
        """How many operations an evaluation takes."""

@final
class Number:
    """An entry of a strain that is recorded."""

@final
class Tangent:
    """The linearised tangent that the operators of `Simulation.tangent` apply."""

def det(a: Any) -> Any:
    """The determinant of a 3×3 array, recorded strains too."""
