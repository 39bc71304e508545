"""The check of tangents: the shapes of laws and residuals, and mistakes that explain a wrong tangent of a residual.

Measuring and judging is Rust's (the crate `tangent-check`).
"""

import inspect
import os
import sys
from collections.abc import Mapping

import numpy as np

from . import _native

# A mistake explains a tangent if both agree within this many errors of the differences ...
AGREEMENT = 60
# ... and is looked for only if the tangent is off by more than this many.
VISIBLE = 600
# Measured tangents with greater errors than this, relative to their greatest entry, explain nothing.
USABLE = 1e-6
# A fitted factor within this of a round number is that number.
ROUND = 1e-5


def check_law(
    stress, tangent=None, *, convention="piola", order=None, dimension=3, state=(), states=None, dt=0.1, seed=1, name=None
):
    """Checks that the tangent of a law is the derivative of its stress, in states that are made here or given. There is no tolerance to choose.

    A law that depends on the deformation alone is two functions of F, an array (3, 3): `check_law(lambda F: P(F), lambda F: A(F))`.
    Any other law is one function of a `LawStep`, which returns (stress, tangent), or (stress, tangent, state) if it has internal variables.
    `state` are their values at rest.

    | convention | stress | tangent | order |
    |---|---|---|---|
    | "piola" | P | ∂P/∂F | 11, 12, 13, 21, … |
    | "second_piola" | S | ∂S/∂E, E = (FᵀF − I)/2 | voigt |
    | "abaqus" | σ | DDSDDE: Jaumann rate of J σ, over J | abaqus |
    | "jaumann_cauchy" | σ | Jaumann rate of σ | abaqus |
    | "truesdell" | σ | Truesdell rate of σ: the spatial tangent | voigt |
    | "green_naghdi" | σ | Green–Naghdi rate of J σ, over J | abaqus |
    | "cauchy_strain" | σ | ∂σ/∂Δε, with the rotation of the step frozen | voigt |
    | "cauchy_gradient" | σ | ∂σ/∂F | voigt, 11, 12, 13, 21, … |
    | "kirchhoff_gradient" | J σ | ∂(J σ)/∂F | voigt, 11, 12, 13, 21, … |

    Stresses are tensors (3, 3) or vectors, tangents are tensors (3, 3, 3, 3) or matrices. Axes of length 1 at their end are left out.
    `order` is that of the vector of a symmetric tensor: "voigt" 11, 22, 33, 23, 13, 12; "abaqus" 11, 22, 33, 12, 13, 23;
    "explicit" 11, 22, 33, 12, 23, 13; "mfront" as abaqus with shears times √2. Shear strains are 2 ε in voigt and abaqus, ε in explicit.
    With `dimension=2` all tensors are (2, 2), and components with index 3 are left out.

    `states` are deformation gradients F, or rows of them for a path of several steps, each with a name or not. Each step takes the time
    `dt`. Without them, twelve paths are made from `seed`: small to large strains, J from 0.5 to 2, rotations, unloading, reloading; and paths
    around the yield surface of a law whose internal variables show one.

    An exception in one state is a finding with its text. If all states fail, the first exception is raised.

    Raises ValueError or TypeError for a convention or a shape that does not exist.
    """
    meaning = _native.Convention(convention, order, dimension)
    shapes = _Shapes(convention, meaning, dimension)
    at_rest = np.array(state, float).ravel()
    law = _LawOfStep(stress, shapes, at_rest.size) if tangent is None else _LawOfF(stress, tangent, shapes)
    if tangent is not None and at_rest.size:
        raise ValueError(
            "a law with internal variables is one function: stress(step) returns (stress, tangent, state), without `tangent`"
        )
    paths = _paths(states, dt, dimension)
    with np.errstate(all="ignore"):
        return _native.check_python_law(
            name or _name(stress, "a law"), meaning, dimension, at_rest.tolist(), law.respond, law.stress, paths, seed
        )


def check_law_library(
    library,
    *,
    umat=False,
    mfront=None,
    c=None,
    properties=(),
    state=0,
    tangent="jaumann_kirchhoff",
    temperature=0.0,
    name="BFREE",
    external=None,
    plane_strain=False,
    plane_stress=False,
    states=None,
    dt=0.1,
    seed=1,
    limit=5.0,
):
    """`check_law` of a law in a shared library: a UMAT, an MFront behaviour `mfront`, or a law `c` with the header bfree_law.h.

    The library runs in a child process: a crash, an endless loop or a STOP is a finding, after `limit` seconds at the latest. This call runs
    the library's code.

    `state` is the number of internal variables of a UMAT, or their names, or names with values at rest. `tangent` is the meaning of a UMAT's
    DDSDDE: "jaumann_kirchhoff" (Abaqus at finite strain), "jaumann_cauchy" or "strain". `temperature` and `name` are its TEMP and CMNAME.
    `external` are external state variables of a behaviour of MFront.

    Raises ValueError if the law cannot be called. Linux and macOS only.
    """
    if not hasattr(_native, "check_law_in_library"):
        raise NotImplementedError("laws in shared libraries are checked on Linux and macOS only")
    if not sys.executable:
        raise RuntimeError("the library runs in a child process, but sys.executable does not name an interpreter")
    if isinstance(state, int):
        state = {f"STATEV({i})": 0.0 for i in range(1, state + 1)}
    elif not isinstance(state, Mapping):
        state = dict.fromkeys(state, 0.0)
    path = os.fspath(library)
    return _native.check_law_in_library(
        sys.executable,
        _native.__file__,
        # Without a directory, the system would look elsewhere.
        os.path.abspath(path) if os.path.exists(path) else path,
        (name, tangent, float(temperature)) if umat else None,
        None if mfront is None else (mfront, list((external or {}).items())),
        c,
        np.array(properties, float).ravel().tolist(),
        list(state.items()),
        plane_strain,
        plane_stress,
        _paths(states, dt, 3),
        seed,
        limit,
    )


def check_tangent(residual, jacobian, u, *, terms=None, start=None, scale=None, seed=1, name=None):
    """Checks that a tangent is the derivative of a residual at u. There is no tolerance to choose.

    u and the residual are arrays of any shape. `jacobian` is the tangent at u: an array, a SciPy sparse matrix, a LinearOperator, or anything
    else with `shape` and `@`; or a function `jacobian(u)` that returns one; or a function `jvp(u, w)` that returns the product with w.

    `terms` are parts of the residual with their tangents, each checked by itself: {"inertia": (residual, jacobian), …}. If the tangent of the
    whole lacks one of them, or has it with a wrong sign or factor, the report says so.

    Up to 30 unknowns each column is measured, otherwise three random directions. Then halving finds a wrong entry.

    `start` is u at the start of the step, by default 0. A deviation below 1e-5 is inexact in place of wrong if the residual jumps on the way from
    there to u: the trace of a local iteration with a loose tolerance.

    `scale` is a change of u over which the residual changes its nature, a number or an array like u: unknowns of different units need an
    array. The default is the greatest |u|, or 1. Rows of different units should be checked apart.

    Raises what residual and jacobian raise at u, and ValueError for shapes that do not fit.
    """
    u = _numbers("u", u).copy()
    if not u.size:
        raise ValueError("u is empty")
    scale = _scale(scale, u)
    start = np.zeros_like(u) if start is None else _numbers("start", start)
    if start.shape != u.shape:
        raise ValueError(f"start has the shape {start.shape}; it must have the shape {u.shape} of u")
    place = (u, start, scale, seed)
    with np.errstate(all="ignore"):
        whole = _Checked("the whole", residual, jacobian, place)
        parts = {
            term: _Checked(f"term {term}", *_pair(term, pair), place, whole.shape) for term, pair in (terms or {}).items()
        }
        every = [whole, *parts.values()]
        diagnoses, notes = _explain(whole, parts)
    if u.size > whole.finding.claimed.shape[1]:
        notes.append("The columns of the tangents are products with random directions.")
    exception = next((one.exception for one in every if one.exception is not None), None)
    findings = [one.finding for one in every]
    if exception is not None and all(finding.reason == "call failed" for finding in findings):
        raise exception
    names = _indices("R", whole.shape), _indices("u", u.shape)
    sentences = [_native.Diagnosis(sentence) for sentence in diagnoses]
    return _native.Report(name or _name(residual, "a residual"), names, seed, findings, sentences, notes, exception)


def newton_table(solutions, form="text", *, round_off=None):
    """A table of residual norms with their order of convergence, a row for each solution. LaTeX needs the package booktabs."""
    if not isinstance(solutions, Mapping):
        if any(np.ndim(norms) != 1 for norms in solutions):
            raise TypeError("the solutions must be lists of norms, or a mapping of names to lists: newton_table({'step 1': [1.0, 1e-3]})")
        solutions = {str(number): norms for number, norms in enumerate(solutions, 1)}
    return _native.newton_rows(
        [(str(name), _numbers("the norms", norms).tolist()) for name, norms in solutions.items()], form, round_off
    )


def _pair(term, pair):
    if not isinstance(pair, (tuple, list)) or len(pair) != 2:
        raise TypeError(f"term {term!r} must be a pair (residual, jacobian) of functions of u, not {type(pair).__name__}")
    return pair


def _name(function, otherwise):
    name = getattr(function, "__name__", "<lambda>")
    return otherwise if name == "<lambda>" else name


def _numbers(what, values):
    values = np.asarray(values)
    if np.iscomplexobj(values):
        raise ValueError(f"{what} has complex numbers; the check needs real ones")
    return values.astype(float)


def _paths(states, dt, dimension):
    """Paths (name, list of 3×3 F, Δt) of a user's states: an F or a row of them each."""
    if states is None:
        return None
    named = states.items() if isinstance(states, Mapping) else ((f"state {i}", one) for i, one in enumerate(states, 1))
    paths = []
    for name, gradients in named:
        gradients = _numbers(f"{name}: F", gradients)
        steps = gradients[None] if gradients.ndim == 2 else gradients
        size = steps.shape[-1] if steps.ndim == 3 else 0
        if steps.ndim != 3 or steps.shape[1:] not in ((3, 3), (dimension, dimension)):
            wanted = f"({dimension}, {dimension})"
            raise ValueError(f"{name}: F has the shape {gradients.shape}; it must be {wanted}, or (n, {wanted[1:]} for n steps")
        whole = np.tile(np.eye(3), (len(steps), 1, 1))
        whole[:, :size, :size] = steps
        paths.append((str(name), whole.tolist(), float(dt)))
    return paths


class _Shapes:
    """Stresses and tangents of a law, in the components of its convention."""

    def __init__(self, name, meaning, dimension):
        self.name, self.dimension = name, dimension
        self.rows, self.columns = np.array(meaning.stress).T, np.array(meaning.strain).T
        self.symmetric_stress, self.symmetric_strain = meaning.symmetric
        self.stress_factors, strain_factors = (
            np.where(pairs[0] == pairs[1], 1.0, shear)
            for pairs, shear in zip((self.rows, self.columns), meaning.shear)
        )
        # A symmetric strain has each shear twice.
        twice = np.where(self.columns[0] == self.columns[1], 1.0, 2.0) if self.symmetric_strain else 1.0
        self.strain_factors = twice / strain_factors

    def stress(self, value):
        value, round_off = self._trimmed("stress", value)
        tensor = (self.dimension, self.dimension)
        vector = (self.rows.shape[1],)
        if value.shape == vector:
            return value
        if value.shape != tensor:
            raise ValueError(
                f"the stress has the shape {value.shape}; the convention {self.name!r} needs {tensor} or {vector}"
            )
        if self.symmetric_stress:
            self._check_symmetry("stress", value, value.T, round_off)
        return self.stress_factors * value[tuple(self.rows)]

    def tangent(self, value):
        value, round_off = self._trimmed("tangent", value)
        tensor = 4 * (self.dimension,)
        matrix = (self.rows.shape[1], self.columns.shape[1])
        if value.shape == matrix:
            return np.ascontiguousarray(value).ravel()
        if value.shape != tensor:
            raise ValueError(
                f"the tangent has the shape {value.shape}; the convention {self.name!r} needs {matrix} or {tensor}"
            )
        if self.symmetric_strain:
            # Automatic derivatives by a symmetric tensor take its nine entries as independent.
            value = (value + value.transpose(0, 1, 3, 2)) / 2
        if self.symmetric_stress:
            self._check_symmetry("tangent", value, value.transpose(1, 0, 2, 3), round_off)
        entries = value[tuple(self.rows)][:, self.columns[0], self.columns[1]]
        return (self.stress_factors[:, None] * entries * self.strain_factors).ravel()

    def _check_symmetry(self, what, value, other, round_off):
        if np.abs(value - other).max() > np.sqrt(round_off) * np.abs(value).max():
            raise ValueError(f"the {what} must be symmetric in the two indices of the stress in the convention {self.name!r}")

    @staticmethod
    def _trimmed(what, value):
        """Without axes of length one at the end, such as those of a single quadrature point; and the round-off of its numbers."""
        kind = getattr(value, "dtype", None)
        single = kind is not None and np.dtype(kind).itemsize < 8
        value = _numbers(f"the {what}", value)
        while value.ndim > 1 and value.shape[-1] == 1:
            value = value[..., 0]
        return value, np.finfo(np.float32 if single else float).eps


class _LawOfF:
    """A law of two functions of F."""

    def __init__(self, stress, tangent, shapes):
        self.stress_of, self.tangent_of, self.shapes = stress, tangent, shapes

    def stress(self, step):
        return self.shapes.stress(self.stress_of(step.F.copy()))

    def respond(self, step):
        return self.stress(step), self.shapes.tangent(self.tangent_of(step.F.copy())), np.empty(0)


class _LawOfStep:
    """A law of one function of the step."""

    def __init__(self, law, shapes, variables):
        self.law, self.shapes, self.variables = law, shapes, variables

    def respond(self, step):
        stress, tangent, state = self._answer(step)
        return self.shapes.stress(stress), self.shapes.tangent(tangent), state

    def stress(self, step):
        return self.shapes.stress(self._answer(step)[0])

    def _answer(self, step):
        answer = self.law(step)
        if not isinstance(answer, (tuple, list)) or len(answer) not in (2, 3):
            raise TypeError(
                "without a function `tangent`, the law must return (stress, tangent) or (stress, tangent, state), "
                f"not {type(answer).__name__}"
            )
        state = _numbers("the state", answer[2] if len(answer) == 3 else ()).ravel()
        if state.size != self.variables:
            raise ValueError(f"the law returned {state.size} internal variables; `state` has {self.variables}")
        return answer[0], answer[1], state


class _Checked:
    """A residual with its tangent, and the check of them."""

    def __init__(self, name, residual, jacobian, place, shape=None):
        u, start, scale, seed = place
        self.name, self.u = name, u
        value = _numbers("the residual", residual(u.copy()))
        self.shape, self.value = value.shape, value.ravel()
        if shape is not None and shape != self.shape:
            raise ValueError(f"{name}: the residual has the shape {self.shape}, but that of the whole {shape}")
        self.matrix, self.product = self._tangent(jacobian)
        self.finding, self.directions, self.exception = _native.check_residual(
            name,
            start.ravel().tolist(),
            u.ravel().tolist(),
            self.value.tolist(),
            scale.tolist(),
            lambda at: _numbers("the residual", residual(at.reshape(u.shape).copy())).ravel(),
            self.product,
            seed,
        )

    def _tangent(self, jacobian):
        """The matrix, unless there are products alone, and its product with a vector."""
        if callable(jacobian) and not hasattr(jacobian, "__matmul__"):
            if _parameters(jacobian) == 2:
                return None, lambda w: self._fits(jacobian(self.u.copy(), w.reshape(self.u.shape).copy()))
            jacobian = jacobian(self.u.copy())
        wanted = (self.value.size, self.u.size)
        if not hasattr(jacobian, "shape") or (isinstance(jacobian, np.ndarray) or hasattr(jacobian, "__array__")):
            # Derivatives of arrays by arrays have the axes of both.
            jacobian = _numbers("the tangent", jacobian)
            if jacobian.size == wanted[0] * wanted[1] and jacobian.shape in (wanted, self.shape + self.u.shape):
                jacobian = jacobian.reshape(wanted)
        if jacobian.shape != wanted:
            raise ValueError(
                f"{self.name}: the tangent has the shape {jacobian.shape}; a residual with {wanted[0]} entries and u with "
                f"{wanted[1]} need {wanted}"
            )
        return jacobian, lambda w: self._fits(jacobian @ w.copy())

    def _fits(self, product):
        product = _numbers("the product of the tangent", product).ravel()
        if product.size != self.value.size:
            raise ValueError(
                f"{self.name}: the product of the tangent has {product.size} entries, but the residual has {self.value.size}"
            )
        return product

    @property
    def error(self):
        """The greatest error of the measured tangent; infinite if it is of no use for a diagnosis."""
        measured, errors = self.finding.measured, self.finding.errors
        if not (np.isfinite(measured).all() and np.isfinite(errors).all()):
            return np.inf
        greatest = np.abs(measured).max(initial=0)
        error = max(errors.max(initial=0), np.finfo(float).eps * greatest)
        return error if error <= USABLE * greatest else np.inf

    def transposed(self):
        """The products of the transposed matrix with the directions; None without a square matrix that can be transposed."""
        if self.matrix is None or self.matrix.shape[0] != self.matrix.shape[1]:
            return None
        try:
            return np.stack([np.asarray(self.matrix.T @ np.array(w)).ravel() for w in self.directions], axis=1)
        except (NotImplementedError, TypeError):
            return None


def _parameters(function):
    """The number of arguments that a function needs."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return 1
    positional = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    needed = [one for one in parameters if one.kind in positional and one.default is inspect.Parameter.empty]
    return len(needed)


def _scale(scale, u):
    """The scale of each unknown, flat."""
    if scale is None:
        scale = np.abs(u).max()
        scale = scale if scale > 0 and np.isfinite(scale) else 1.0
    scale = _numbers("the scale", scale)
    if scale.ndim and scale.shape != u.shape:
        raise ValueError(f"the scale has the shape {scale.shape}; it must be a number, or have the shape {u.shape} of u")
    if not (np.isfinite(scale).all() and (scale > 0).all()):
        raise ValueError("the scale must be positive")
    return np.broadcast_to(scale, u.shape).ravel()


def _indices(symbol, shape):
    return [f"{symbol}[{', '.join(map(str, index))}]" for index in np.ndindex(*shape)] if shape else [symbol]


def _explain(whole, parts):
    """Mistakes that explain wrong tangents, and notes."""
    wrong = [one for one in (whole, *parts.values()) if one.finding.verdict == "wrong"]
    diagnoses = [sentence for one in wrong for sentence in _single_mistakes(one)]
    if whole in wrong:
        diagnoses += _term_mistakes(whole, parts)
    notes = []
    error = sum(one.error for one in (whole, *parts.values()))
    if parts and np.isfinite(error):
        rest = np.abs(whole.finding.measured - sum(part.finding.measured for part in parts.values())).max()
        if rest > VISIBLE * error:
            notes.append(f"The derivatives of the terms do not add up to that of the residual: entries differ by {rest:.1e}.")
    if wrong and not diagnoses:
        notes.append("No frequent mistake explains the wrong tangent.")
    return diagnoses, notes


def _single_mistakes(one):
    """A factor, or a transposition."""
    error = one.error
    claimed, measured = one.finding.claimed, one.finding.measured
    if not np.isfinite(error) or np.abs(claimed - measured).max() <= VISIBLE * error:
        return []
    sentences = []
    factor = np.vdot(measured, claimed) / np.vdot(measured, measured)
    if np.abs(claimed - factor * measured).max() <= AGREEMENT * error:
        words = "has the wrong sign" if abs(factor + 1) < ROUND else f"is {factor:.6g} times the right one"
        sentences.append(f"The tangent of {one.name} {words}.")
    transposed = one.transposed()
    if transposed is not None and np.abs(transposed - measured).max() <= AGREEMENT * error:
        sentences.append(f"The tangent of {one.name} is transposed.")
    return sentences


def _term_mistakes(whole, parts):
    """Terms of the residual that stand in the tangent of the whole with another factor than 1."""
    error = sum(one.error for one in (whole, *parts.values()))
    if not parts or not np.isfinite(error):
        return []
    claimed = whole.finding.claimed.ravel()
    terms = np.stack([part.finding.measured.ravel() for part in parts.values()], axis=1)
    factors, _, rank, _ = np.linalg.lstsq(terms, claimed, rcond=1e-8)
    if rank < len(parts) or np.abs(claimed - terms @ factors).max() > AGREEMENT * error:
        return []
    sentences = []
    for name, factor in zip(parts, factors):
        if abs(factor) < ROUND:
            sentences.append(f"The tangent of the whole lacks the term {name}.")
        elif abs(factor + 1) < ROUND:
            sentences.append(f"The term {name} has the wrong sign in the tangent of the whole.")
        elif abs(factor - 1) > ROUND:
            sentences.append(f"The term {name} stands in the tangent of the whole with the factor {factor:.6g}.")
    return sentences
