"""One run of the implicit material point method of NVIDIA Newton for race.py, in memory and in a process of its own.

The argument is a JSON object with the keys of `Task`. The line of the output that begins with {"particles" is a JSON object with the
counts and the answers. Newton is the PyPI package `newton`, with its kernels in Warp; here they run on the CPU, on one thread.

What Newton 1.8.0 computes (newton/_src/solvers/implicit_mpm):

- Time integration: backward Euler in the nodes' velocities, in a new grid in every step. There is no quasi-static mode.
- Law: linear between the Kirchhoff stress and the logarithmic (Hencky) strain, with Young's modulus and Poisson's ratio. Plastic flow is
  switched off here. The strain increment is linear in the velocity gradient.
- Equations of a step: stress and velocity are both unknown (a mixed form), and they are solved for the stress. They are linearised once.
  There is no Newton iteration, so a step is one linear solve.
- Functions: linear velocities. The stress is a field of its own, by default constant in a cell; it can have its own value at each particle.
- Mass matrix: lumped. Transfer: affine (APIC).
- Numbers: single precision (float32).

The block stands on a layer of particles without mass, which Newton takes for infinitely heavy: all nodes of their cells are at rest. The
layer is one cell deep and below the floor, so that exactly the nodes of the floor are fixed. The drag of the air, by default 1 kg/(m³ s),
is set to 0.
"""

from __future__ import annotations

import dataclasses
import json
import logging
import math
import sys
import time
from dataclasses import dataclass

import newton
import numpy as np
import warp as wp
from newton.solvers import SolverImplicitMPM

GAUSS = 0.5 / math.sqrt(3.0)  # distance of a Gauss point from the middle of its cell, in cells
NO_YIELD = 1e15  # a pressure (Pa) that no particle reaches


@dataclass
class Task:
    """What to solve, in the units of the scene."""

    spacing: float  # of the grid
    corners: list[list[float]]  # of the block; the lower face is the floor z = 0
    body_cells: list[int]  # of the block, along each axis; a cell has 2 × 2 × 2 particles, at its Gauss points
    young: float
    poisson: float
    density: float
    gravity: list[float]
    step: float
    stop_after: int  # steps really taken
    strain_basis: str  # where Newton has its stresses: "P0" in the cells, "pic" at the particles
    solver: str  # linear solver of Newton: "cg" or "cr"
    tolerance: float  # of the linear solver: relative, and for the root mean square of the residual (a strain, no unit)
    iteration_limit: int  # of the linear solver, in a step
    watched: list[float]  # the point whose displacement is an answer


class LinearSolves(logging.Handler):
    """Counts the iterations of the linear solver from Newton's log, and notes whether a solve stopped at the limit."""

    def __init__(self, limit: int):
        super().__init__()
        self.limit = limit
        self.iterations = 0
        self.stopped: float | None = None  # residual of the first solve that stopped at the limit

    def emit(self, record: logging.LogRecord) -> None:
        if "terminated after" not in record.msg:
            return
        _, iterations, residual = record.args[:3]
        self.iterations += int(iterations)
        if iterations >= self.limit and self.stopped is None:
            self.stopped = float(residual)


def to_newton(positions: np.ndarray, task: Task) -> np.ndarray:
    """Positions for Newton, whose sparse grid has its cells, and not its nodes, at the multiples of the spacing."""
    return positions + 0.5 * task.spacing


def lattice(axes: list[np.ndarray]) -> np.ndarray:
    """All points whose coordinates are on the axes, one row a point."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def particle_positions(task: Task) -> np.ndarray:
    """Gauss points of the cells of the block."""
    low = task.corners[0]
    axes = []
    for axis, cells in enumerate(task.body_cells):
        middles = np.arange(cells) + 0.5
        axes.append(low[axis] + task.spacing * (middles[:, None] + np.array([-GAUSS, GAUSS])).ravel())
    return lattice(axes)


def floor_positions(task: Task) -> np.ndarray:
    """Middles of the cells below the floor of the block."""
    low = task.corners[0]
    axes = [low[axis] + task.spacing * (np.arange(task.body_cells[axis]) + 0.5) for axis in (0, 1)]
    return lattice([*axes, np.array([low[2] - 0.5 * task.spacing])])


def build_model(task: Task):
    """The model with the particles of the block, and behind them those of the floor, which have no mass."""
    builder = newton.ModelBuilder(up_axis=newton.Axis.Z)
    SolverImplicitMPM.register_custom_attributes(builder)
    block, floor = particle_positions(task), floor_positions(task)
    count = len(block) + len(floor)
    mass = task.density * (0.5 * task.spacing) ** 3
    builder.add_particles(
        pos=to_newton(np.vstack([block, floor]), task).tolist(),
        vel=[(0.0, 0.0, 0.0)] * count,
        mass=[mass] * len(block) + [0.0] * len(floor),
        radius=[0.25 * task.spacing] * count,  # Newton's particle is a cube with sides of two radii
    )
    model = builder.finalize(device="cpu")
    model.set_gravity(tuple(task.gravity))
    model.mpm.young_modulus.fill_(task.young)
    model.mpm.poisson_ratio.fill_(task.poisson)
    model.mpm.yield_pressure.fill_(NO_YIELD)
    model.mpm.tensile_yield_ratio.fill_(1.0)  # tension yields like compression: not at all
    return model


def build_solver(task: Task, model) -> SolverImplicitMPM:
    """Newton's solver. Settings that are not named here have Newton's defaults."""
    config = SolverImplicitMPM.Config(
        voxel_size=task.spacing,
        velocity_basis="Q1",
        strain_basis=task.strain_basis,
        solver=task.solver,
        tolerance=task.tolerance,
        max_iterations=task.iteration_limit,
        air_drag=0.0,
    )
    return SolverImplicitMPM(model, config, verbose=True)


def march(task: Task, model, solver: SolverImplicitMPM, solves: LinearSolves):
    """Takes the steps and returns the state at the end."""
    state, after = model.state(), model.state()
    for step in range(1, task.stop_after + 1):
        solver.step(state, after, None, None, task.step)
        state, after = after, state
        if solves.stopped is not None:
            raise RuntimeError(f"step {step}: no convergence in {task.iteration_limit} iterations, residual {solves.stopped:.1e}")
    return state


def load_kernels(task: Task, solves: LinearSolves) -> None:
    """Takes a step of a block of two cells a side, for which Warp loads the kernels, or compiles those that its cache lacks."""
    low = task.corners[0]
    high = [x + 2 * task.spacing for x in low]
    small = dataclasses.replace(task, corners=[low, high], body_cells=[2, 2, 2], stop_after=1)
    model = build_model(small)
    march(small, model, build_solver(small, model), solves)
    solves.iterations = 0


def strain_energy(task: Task, gradients: np.ndarray) -> float:
    """Strain energy of Newton's law (J), V (Λ/2 (tr ε)² + G ε:ε) with the logarithmic strain ε, from elastic deformation gradients."""
    strains = np.log(np.linalg.svd(gradients.astype(float), compute_uv=False))
    lame = task.young * task.poisson / ((1 + task.poisson) * (1 - 2 * task.poisson))
    shear = task.young / (2 * (1 + task.poisson))
    density = 0.5 * lame * strains.sum(axis=1) ** 2 + shear * (strains**2).sum(axis=1)
    return float(density.sum()) * (0.5 * task.spacing) ** 3


def answers(task: Task, state) -> dict:
    """Vertical displacement of the watched particle (m), strain energy and kinetic energy (J)."""
    start = to_newton(particle_positions(task), task)
    count = len(start)
    position, velocity = state.particle_q.numpy()[:count], state.particle_qd.numpy()[:count].astype(float)
    if not (np.isfinite(position).all() and np.isfinite(velocity).all()):
        raise RuntimeError("positions or velocities are not finite")
    watched = int(np.argmin(np.linalg.norm(start - to_newton(np.array(task.watched), task), axis=1)))
    mass = task.density * (0.5 * task.spacing) ** 3
    return {
        "displacement": float(position[watched, 2]) - float(np.float32(start[watched, 2])),
        "strain": strain_energy(task, state.mpm.particle_elastic_strain.numpy()[:count]),
        "kinetic": 0.5 * mass * float((velocity**2).sum()),
    }


def main() -> None:
    task = Task(**json.loads(sys.argv[1]))
    wp.config.log_level = wp.LOG_WARNING
    wp.set_device("cpu")
    solves = LinearSolves(task.iteration_limit)
    log = logging.getLogger("newton")
    log.setLevel(logging.INFO)
    log.addHandler(solves)
    load_kernels(task, solves)
    model = build_model(task)
    state = march(task, model, build_solver(task, model), solves)
    before = time.process_time()
    result = {"particles": len(particle_positions(task)), "newton": task.stop_after, "linear": solves.iterations}
    result["answers"] = answers(task, state)
    result["seconds_of_answers"] = time.process_time() - before
    print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main()
