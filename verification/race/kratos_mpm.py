"""One run of Kratos MPM for race.py, in memory and in a process of its own.

The argument is a JSON object with the keys of `Task`. The line of the output that begins with {"particles" is a JSON object with the
counts and the answers. The model is built with the Python interface of Kratos alone, without input files: a background grid of hexahedra
or quadrilaterals over the whole box, a body mesh whose Gauss points become the material points, and fixed nodes. Everything else is done
by Kratos' own solver classes: the search of the cells, assembly, linear solver, Newton's method, and the update of the material points.
"""

from __future__ import annotations

import itertools
import json
import math
import sys
import time
from dataclasses import dataclass

import KratosMultiphysics as Kratos
import KratosMultiphysics.MPMApplication as Mpm
from KratosMultiphysics.MPMApplication.python_solvers_wrapper_mpm import CreateSolver

NEWTON_LIMIT = 20
# Kratos numbers the corners of a cell anticlockwise, and those of the upper face after those of the lower.
CORNERS = {
    2: [(0, 0), (1, 0), (1, 1), (0, 1)],
    3: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
}
ELEMENT = {2: "Element2D4N", 3: "Element3D8N"}
LAW = {2: Mpm.HyperElasticNeoHookeanPlaneStrain2DLaw, 3: Mpm.HyperElasticNeoHookean3DLaw}
DISPLACEMENTS = [Kratos.DISPLACEMENT_X, Kratos.DISPLACEMENT_Y, Kratos.DISPLACEMENT_Z]


@dataclass
class Task:
    """What to solve, in the units of the scene."""

    dimension: int
    size: list[float]  # of the box of the grid, which begins at the origin
    spacing: float
    corners: list[list[float]]  # of the body: a box by its two corners, in 2D a quadrilateral
    body_cells: list[int]  # of the body mesh, along each axis
    walls: list[list]  # [axis, coordinate, directions]: the nodes with that coordinate are fixed along the directions; the floor first
    young: float
    poisson: float
    density: float
    gravity: list[float] | None  # three components, in 2D too
    traction: list[float] | None  # on the side x = max of a 2D body
    solver_type: str  # of Kratos: static, quasi_static or dynamic
    step: float
    steps: int  # of the whole problem
    stop_after: int  # steps really taken
    linear_solver: dict
    tolerance: float
    watched: list[float]  # the point whose displacement is an answer


def solver_settings(task: Task) -> Kratos.Parameters:
    """Settings of Kratos' solver. What is not named here has Kratos' default."""
    solver = {
        "solver_type": task.solver_type,
        "domain_size": task.dimension,
        "time_stepping": {"time_step": task.step},
        "grid_model_import_settings": {"input_type": "use_input_model_part"},
        "model_import_settings": {"input_type": "use_input_model_part"},
        "convergence_criterion": "residual_criterion",
        "residual_relative_tolerance": task.tolerance,
        "residual_absolute_tolerance": 1e-30,
        "max_iteration": NEWTON_LIMIT,
        "linear_solver_settings": task.linear_solver,
    }
    if task.solver_type == "dynamic":
        solver |= {"time_integration_method": "implicit", "scheme_type": "newmark", "newmark_beta": 0.25}
    return Kratos.Parameters(json.dumps({"problem_data": {"parallel_type": "OpenMP"}, "solver_settings": solver}))


def add_mesh(part, cells, position, properties, first_node: int, first_element: int) -> None:
    """Adds a structured mesh. `position` maps the numbers of a node along the axes to its coordinates."""
    dimension = len(cells)
    strides = [math.prod(n + 1 for n in cells[:axis]) for axis in range(dimension)]

    def number(index) -> int:
        return first_node + sum(i * stride for i, stride in zip(index, strides))

    for index in itertools.product(*(range(n + 1) for n in reversed(cells))):
        index = index[::-1]
        part.CreateNewNode(number(index), *position(index), *[0.0] * (3 - dimension))
    for element, cell in enumerate(itertools.product(*(range(n) for n in cells)), first_element):
        nodes = [number([i + d for i, d in zip(cell, corner)]) for corner in CORNERS[dimension]]
        part.CreateNewElement(ELEMENT[dimension], element, nodes, properties)


def body_position(task: Task):
    """Position of the nodes of the body mesh."""
    if task.dimension == 3:
        low, high = task.corners
        return lambda index: [a + (b - a) * i / n for a, b, i, n in zip(low, high, index, task.body_cells)]

    def bilinear(index):
        s, t = (i / n for i, n in zip(index, task.body_cells))
        weights = [(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t]
        return [sum(w * corner[axis] for w, corner in zip(weights, task.corners)) for axis in (0, 1)]

    return bilinear


def add_point_loads(task: Task, grid, first_node: int) -> None:
    """Divides the traction of the side x = max among points of equal share. One of them is the watched point, the middle."""
    part = grid.CreateSubModelPart("traction")
    properties = grid.GetProperties()[0]
    low, high = task.corners[1], task.corners[2]
    points = 2 * task.body_cells[1] + 1
    force = [component * math.dist(low, high) / points for component in task.traction] + [0.0]
    for i in range(points):
        s = (i + 0.5) / points
        part.CreateNewNode(first_node + i, low[0], low[1] + s * (high[1] - low[1]), 0.0)
        condition = part.CreateNewCondition("MPMGridPointLoadCondition2D1N", i + 1, [first_node + i], properties)
        condition.Set(Kratos.BOUNDARY, True)
        condition.SetValue(Mpm.MATERIAL_POINTS_PER_CONDITION, 1)
        condition.SetValue(Mpm.MPC_IS_NEUMANN, True)
        condition.SetValue(Mpm.POINT_LOAD, force)


def fix_walls(task: Task, grid) -> None:
    """Fixes the nodes on the walls."""
    for node in grid.Nodes:
        position = [node.X, node.Y, node.Z]
        for axis, coordinate, directions in task.walls:
            if abs(position[axis] - coordinate) < 1e-9 * task.spacing:
                for direction in directions:
                    node.Fix(DISPLACEMENTS[direction])


def build(task: Task):
    """The model and its solver, ready for the first step."""
    model = Kratos.Model()
    solver = CreateSolver(model, solver_settings(task))
    solver.AddVariables()
    grid, body = solver.GetGridModelPart(), model["Initial_MPM_Material"]
    cells = [round(length / task.spacing) for length in task.size]
    add_mesh(grid, cells, lambda index: [i * task.spacing for i in index], grid.CreateNewProperties(0), 1, 1)
    properties = body.CreateNewProperties(1)
    properties[Kratos.DENSITY], properties[Kratos.YOUNG_MODULUS] = task.density, task.young
    properties[Kratos.POISSON_RATIO] = task.poisson
    properties.SetValue(Mpm.MATERIAL_POINTS_PER_ELEMENT, 2**task.dimension)
    properties.SetValue(Kratos.CONSTITUTIVE_LAW, LAW[task.dimension]())
    first = (grid.NumberOfNodes() + 1, grid.NumberOfElements() + 1)
    add_mesh(body.CreateSubModelPart("body"), task.body_cells, body_position(task), properties, *first)
    if task.traction:
        add_point_loads(task, grid, grid.NumberOfNodes() + body.NumberOfNodes() + 1)
    solver.ImportModelPart()
    solver.PrepareModelPart()
    solver.AddDofs()
    fix_walls(task, grid)
    solver.Initialize()
    solver._GetBuilderAndSolver().SetEchoLevel(2)  # shows the iterations of the linear solver
    return model, solver


def set_everywhere(entities, variable, value, info) -> None:
    """Gives the same vector to all material points."""
    for entity in entities:
        entity.SetValuesOnIntegrationPoints(variable, [value], info)


def release(task: Task, points) -> None:
    """Gravity, and the acceleration at the start: that of a free fall at free nodes, zero on the floor, linear between."""
    info = points.ProcessInfo
    floor_axis = task.walls[0][0]
    set_everywhere(points.Elements, Mpm.MP_VOLUME_ACCELERATION, task.gravity, info)
    for element in points.Elements:
        (position,) = element.CalculateOnIntegrationPoints(Mpm.MP_COORD, info)
        share = min(position[floor_axis] / task.spacing, 1.0)
        element.SetValuesOnIntegrationPoints(Mpm.MP_ACCELERATION, [[share * g for g in task.gravity]], info)


def apply_loads(task: Task, points, step: int) -> None:
    """Sets the loads of a step: a share of the whole in load steps; with inertia all of them, at the start."""
    info = points.ProcessInfo
    if task.solver_type == "dynamic":
        if step == 1:
            release(task, points)
        return
    share = step / task.steps
    if task.gravity:
        set_everywhere(points.Elements, Mpm.MP_VOLUME_ACCELERATION, [share * g for g in task.gravity], info)
    if task.traction:
        count = points.NumberOfConditions()
        side = math.dist(task.corners[1], task.corners[2])
        force = [share * component * side / count for component in task.traction] + [0.0]
        set_everywhere(points.Conditions, Mpm.POINT_LOAD, force, info)


def take_step(task: Task, model, solver, present: float, step: int) -> float:
    """Takes a step in the order of Kratos' own `AnalysisStage`, and returns the new time."""
    points = model["MPM_Material"]
    present = solver.AdvanceInTime(present)
    apply_loads(task, points, step)
    solver.Predict()
    solver.InitializeSolutionStep()
    if not solver.SolveSolutionStep():
        raise RuntimeError(f"Newton's method did not converge in {NEWTON_LIMIT} iterations")
    solver.FinalizeSolutionStep()
    return present


def march(task: Task, model, solver) -> int:
    """Takes the steps and returns the number of Newton iterations, each with one linear system."""
    iterations = 0
    present = 0.0
    for step in range(1, task.stop_after + 1):
        try:
            present = take_step(task, model, solver, present, step)
        except RuntimeError as error:
            reasons = [line.split("Error: ")[-1] for line in str(error).splitlines() if "Error: " in line]
            raise RuntimeError(f"step {step}: {reasons[-1] if reasons else error}") from None
        iterations += model["MPM_Material"].ProcessInfo[Kratos.NL_ITERATION_NUMBER]
    return iterations


def energy_density(task: Task, almansi) -> float:
    """Strain energy per reference volume, Λ/2 (ln J)² + G/2 (tr b − 3) − G ln J, from the Almansi strain e, with b⁻¹ = 1 − 2e.

    The strain energy that Kratos reports is ½ σ:e, which is no energy of this law at finite strain.
    """
    if task.dimension == 2:
        xx, yy, xy = almansi
        zz = yz = xz = 0.0
    else:
        xx, yy, zz, xy, yz, xz = almansi
    a, b, c, d, e, f = 1 - 2 * xx, 1 - 2 * yy, 1 - 2 * zz, -xy, -yz, -xz
    determinant = a * (b * c - e * e) - d * (d * c - e * f) + f * (d * e - b * f)
    trace = (b * c - e * e + a * c - f * f + a * b - d * d) / determinant
    log_j = -0.5 * math.log(determinant)
    lame = task.young * task.poisson / ((1 + task.poisson) * (1 - 2 * task.poisson))
    shear = task.young / (2 * (1 + task.poisson))
    return 0.5 * lame * log_j**2 + 0.5 * shear * (trace - 3) - shear * log_j


def answers(task: Task, model) -> dict:
    """Displacement of the watched point along the load, strain energy and kinetic energy."""
    points = model["MPM_Material"]
    info = points.ProcessInfo
    strain = kinetic = 0.0
    nearest = (math.inf, [])
    for element in points.Elements:
        (mass,), (displacement,), (velocity,), (position,), (almansi,) = (
            element.CalculateOnIntegrationPoints(variable, info)
            for variable in (Mpm.MP_MASS, Mpm.MP_DISPLACEMENT, Mpm.MP_VELOCITY, Mpm.MP_COORD, Mpm.MP_ALMANSI_STRAIN_VECTOR)
        )
        if task.stop_after:
            strain += mass / task.density * energy_density(task, list(almansi))
        kinetic += 0.5 * mass * sum(v * v for v in velocity)
        origin = [x - u for x, u in zip(position, displacement)]
        nearest = min(nearest, (math.dist(origin[: task.dimension], task.watched), list(displacement)))
    for condition in points.Conditions:
        (displacement,), (position,) = (
            condition.CalculateOnIntegrationPoints(variable, info) for variable in (Mpm.MPC_DISPLACEMENT, Mpm.MPC_COORD)
        )
        origin = [x - u for x, u in zip(position, displacement)]
        nearest = min(nearest, (math.dist(origin[: task.dimension], task.watched), list(displacement)))
    return {"displacement": nearest[1][task.dimension - 1], "strain": strain, "kinetic": kinetic}


def main() -> None:
    task = Task(**json.loads(sys.argv[1]))
    Kratos.ParallelUtilities.SetNumThreads(1)
    model, solver = build(task)
    particles = model["MPM_Material"].NumberOfElements()
    newton = march(task, model, solver)
    if model["MPM_Material"].NumberOfElements() != particles:
        raise RuntimeError("material points left the grid")
    before = time.process_time()
    result = {"particles": particles, "newton": newton, "answers": answers(task, model)}
    result["seconds_of_answers"] = time.process_time() - before
    print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main()
