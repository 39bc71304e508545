"""A race of bfree against Kratos MPM and NVIDIA Newton on the same problems, one thread each.

    pip install KratosMPMApplication==10.4.4 KratosLinearSolversApplication==10.4.4 newton==1.8.0 warp-lang==1.19.0
    cargo build --release
    python verification/race/race.py [--cells 20] [--repeat 3] [--bfree target/release/bfree] [--json FILE]

A program that is not installed does not race. Compared is the CPU time and the peak memory of a whole process, start of the program
included, to solve

- `static`: the block of scenes/block_static.json on its fixed floor, under gravity in four load steps;
- `dynamic`: the same block, gravity at once, ten steps of the trapezoidal rule at Courant number 1.3;
- `column`: a column with the law, walls and gravity of scenes/column_static.json, gravity at once, ten steps as in `dynamic`. It is 1 m
  high and 0.25 m wide, in plane strain, with a spacing of 0.125 m / cells;
- `cook`: Cook's membrane of scenes/cook.json in four load steps, in plane strain, with a spacing near 20 mm / cells.

bfree and Kratos have the same grid, the same steps, particles at the same Gauss points (in `cook` only nearly), the neo-Hookean law with
Λ/2 (ln J)², which is the one of Kratos, and Newton's method to the same relative residual. With inertia both begin with the acceleration
of a free fall, zero on the floor. Kratos has linear functions; the like of it in bfree is `linear`. Cubic and LME functions of bfree
are in the table to show what they cost. Everything else is the default of each program, with these exceptions:

- Kratos has conjugate gradients with a diagonal preconditioner, and, as is its default, with AMGCL. Their tolerance is that of Newton's
  method. Looser ones cost more iterations of Newton's method, and assembly in these iterations is most of Kratos' time. bfree keeps its
  own: an adaptive tolerance in load steps, and 1e-8 with inertia.
- `linear, reset as Kratos` is bfree with a new grid in every step. In `column`, that is its default.
- In `static`, both programs begin a step with the motion of the last one. In `cook`, this turns cells of Kratos inside out, so there it
  has its quasi-static solver, which begins with no motion. Even so its Newton's method, which has no line search, converges at some
  spacings and fails at others, as particles move to cells that they hardly fill: 9 of the 17 from 16/4 to 16/24 mm that were tried.

NVIDIA Newton races in `dynamic` only: it has no quasi-static mode and no plane strain. Its grid, particles and steps are those of the
others, but it solves other equations, which the docstring of nvidia_newton.py lists. So its CPU time is not divided by those of `dynamic`.
A table of its own compares it with bfree in settings that are as near to Newton's as bfree has them: Newmark's γ = 1 and β = 1/2, a new
grid in every step, linear functions, a lumped mass, and linear elasticity in logarithmic strains. These differences remain:

- Both update the velocity by the acceleration at the end of the step. In a step Δt, bfree moves the nodes by Δt times the mean of the old
  and the new velocity, and NVIDIA Newton by Δt times the new one. After ten steps of free fall, that is a tenth of the displacement.
- Particles of bfree receive increments of the velocity (FLIP). Those of NVIDIA Newton take the velocity of the grid and its gradient (APIC).
- bfree iterates Newton's method, and NVIDIA Newton linearises once a step.
- bfree has the stress at the particles. NVIDIA Newton has it there (`stress of a particle`) or in the cells (`stress of a cell`, its
  default).
- bfree has double precision, and NVIDIA Newton single precision. NVIDIA Newton has the solver and the tolerance of its own example of an
  elastic beam: conjugate residuals, and 1e-6 for the root mean square of the residual, which is a strain. At `--cells 8`, 1e-9 takes
  nearly three times as many iterations and changes the answers by 5e-5.

So the CPU seconds say what ten steps cost, and not what an accuracy costs. At `--cells 10` with steps of a sixteenth, both agree to 0.4 %
in displacement, 0.02 % in strain energy and 2 % in kinetic energy (`stress of a cell`, November 2026).

Warp compiles the kernels of NVIDIA Newton at the first start and keeps them in a cache. A run before the race fills the cache, and its
time is shown apart.

Every competitor runs in its own process, in turn with the others, so that a disturbance of the machine hits all of them. CPU seconds and
memory are those that the operating system reports for that process. The set-up is the CPU time of a run that takes no step; the rest
is the time of the steps. The time in which a script asks Kratos or NVIDIA Newton for the answers is not counted. Memory below that of
this script, some 20 MB, is not resolved.

The answers are the displacement along the load of the particle nearest to the middle of the top of the block or column, or of the middle
of the membrane's loaded side; the strain energy; the kinetic energy. Whether bfree and Kratos solve the same equations is seen after the
first step, when no grid has been reset.

Not compared: more threads, snapshots and other output, convenience, and accuracy at equal time. The script runs on Linux, with Python 3.9
or newer.
"""

from __future__ import annotations

import argparse
import copy
import csv
import dataclasses
import importlib.metadata
import json
import math
import os
import platform
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
from dataclasses import dataclass, field
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
PACKAGES = {  # what to install of each competitor; the first package tells its version
    "Kratos": ["KratosMPMApplication==10.4.4", "KratosLinearSolversApplication==10.4.4"],
    "NVIDIA Newton": ["newton==1.8.0", "warp-lang==1.19.0"],
}
PROBLEMS = ["static", "dynamic", "column", "cook"]
COURANT = 1.3
FUNCTIONS = {"linear": "linear", "cubic": {"bspline": {"degree": 3}}, "LME, γ = 3": {"lme": {"gamma": 3}}}
KRATOS_SOLVERS = {
    "CG, diagonal": {"solver_type": "cg", "preconditioner_type": "diagonal", "max_iteration": 10000},
    "AMGCL": {
        "solver_type": "amgcl",
        "krylov_type": "cg",
        "smoother_type": "damped_jacobi",
        "coarsening_type": "aggregation",
        "coarse_enough": 50,
        "use_block_matrices_if_possible": True,
        "max_iteration": 1000,
    },
}
NEWTON_STRESSES = {"stress of a particle": "pic8", "stress of a cell": "P0"}
NEWTON_SOLVER = {"solver": "cr", "tolerance": 1e-6, "iteration_limit": 1000}
DIFFERENCES = {
    "static": "Kratos moves the points to a new grid after every load step, where the old stresses are not in balance. bfree keeps the grid"
    " until a strain of 1; where it takes a new one (`reset as Kratos`), it carries what is out of balance over.",
    "dynamic": "Kratos takes a new grid in every step, bfree at a strain of 0.1. In addition, Kratos updates the velocity of a point with"
    " the point's own acceleration at the start of the step, bfree with that of its nodes. NVIDIA Newton solves other equations: backward"
    " Euler, linearised once a step, with a law that is linear in logarithmic strains, affine transfer, and single precision.",
    "column": "No wall is fixed along all axes, so bfree too takes a new grid in every step. The velocities of the points differ as in"
    " `dynamic`.",
    "cook": "As in `static`. In addition, the points differ: bfree fits quadrature points to the cut cells, Kratos has the Gauss points of"
    " a body mesh, and its nodes with little support are unknowns like all others.",
}


@dataclass
class Problem:
    """A problem with bfree's scene and the same for Kratos."""

    name: str
    scene: dict
    steps: int
    kratos: dict  # what the scene does not say: see `kratos_mpm.Task`


@dataclass
class Competitor:
    """A program with its settings, and what was measured."""

    problem: Problem
    program: str
    variant: str
    settings: dict  # bfree: changes of the scene; Kratos: the linear solver; NVIDIA Newton: see `nvidia_newton.Task`
    like: str = "Kratos"  # the program whose equations it solves
    runs: list[dict] = field(default_factory=list)
    set_ups: list[dict] = field(default_factory=list)
    failure: str | None = None
    warm_up: float | None = None  # CPU seconds of the run that fills the cache of compiled kernels; not counted

    @property
    def name(self) -> str:
        """Program and variant, as the tables have it."""
        return f"{self.program}, {self.variant}"

    def cpu(self, of: str = "total") -> float:
        """Median CPU seconds: `total`, `set-up`, or `steps`, the difference."""
        total = statistics.median(run["cpu"] for run in self.runs)
        set_up = statistics.median(run["cpu"] for run in self.set_ups)
        return {"total": total, "set-up": set_up, "steps": max(total - set_up, 1e-9)}[of]


class Failure(Exception):
    """A run failed; the text is the reason."""


def merged(base: dict, changes: dict) -> dict:
    """A copy of nested dictionaries with some entries changed."""
    result = copy.deepcopy(base)
    for key, value in changes.items():
        inner = isinstance(value, dict) and isinstance(result.get(key), dict)
        result[key] = merged(result[key], value) if inner else value
    return result


def read_scene(name: str, spacing: float, tolerance: float) -> dict:
    """A scene of bfree with the law and the points of Kratos, and without shape functions."""
    scene = json.loads((ROOT / "scenes" / name).read_text())
    scene.pop("approximation", None)
    body = scene["bodies"][0]
    body["layout"] = "gauss"
    body["material"] = {"neo_hookean_logarithmic": body["material"]["neo_hookean"]}
    scene["grid"] = {"spacing": spacing, "size": [math.ceil(s / spacing - 1e-9) * spacing for s in scene["grid"]["size"]]}
    scene["solver"] = {"newton": {"tolerance": tolerance}}
    return scene


def release(scene: dict, steps: int) -> None:
    """Sets the whole gravity at once, and steps of the trapezoidal rule at the Courant number `COURANT` of the pressure wave."""
    body = scene["bodies"][0]
    young, poisson = body["material"]["neo_hookean_logarithmic"].values()
    stiffness = young * (1 - poisson) / ((1 + poisson) * (1 - 2 * poisson))  # Λ + 2G
    step = COURANT * scene["grid"]["spacing"] / math.sqrt(stiffness / body["density"])
    scene["time"] = {"step": step, "end": steps * step}
    del scene["gravity"]["curve"]


def block(cells: int, tolerance: float, dynamic: bool) -> Problem:
    """The block, in load steps or released."""
    scene = read_scene("block_static.json", 1 / cells, tolerance)
    steps = 4
    scene["time"] |= {"step": scene["time"]["end"] / steps}
    if dynamic:
        steps = 10
        release(scene, steps)
    watched = [1.0, 1.0, 1.0]
    scene["output"] = {"probes": [{"name": "answer", "field": "displacement", "at": {"particle": watched}}]}
    shape = scene["bodies"][0]["shape"]["box"]
    kratos = {"solver_type": "dynamic" if dynamic else "static", "walls": [[2, 0.0, [0, 1, 2]]], "watched": watched}
    kratos |= {"corners": [shape["min"], shape["max"]], "body_cells": [cells] * 3}
    return Problem("dynamic" if dynamic else "static", scene, steps, kratos)


def column(cells: int, tolerance: float) -> Problem:
    """The column between sliding walls, released. It has 16 `cells`² cells: 25,600 particles if `cells` is 20."""
    spacing = 1 / (8 * cells)
    width, height = 0.25, 1.0
    scene = read_scene("column_static.json", spacing, tolerance)
    scene["grid"]["size"][0] = width
    body = scene["bodies"][0]
    body["shape"]["box"] = {"min": [0, 0], "max": [width, height]}
    lame, shear = body["material"]["neo_hookean_logarithmic"].values()
    constants = {"young": shear * (3 * lame + 2 * shear) / (lame + shear), "poisson": lame / (2 * (lame + shear))}
    body["material"] = {"neo_hookean_logarithmic": constants}
    steps = 10
    release(scene, steps)
    watched = [width / 2, height]
    scene["output"] = {"probes": [{"name": "answer", "field": "displacement", "at": {"particle": watched}}]}
    kratos = {
        "solver_type": "dynamic",
        "corners": [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]],
        "body_cells": [2 * cells, 8 * cells],
        "walls": [[1, 0.0, [1]], [0, 0.0, [0]], [0, width, [0]]],
        "watched": watched,
    }
    return Problem("column", scene, steps, kratos)


def cook(cells: int, tolerance: float) -> Problem:
    """Cook's membrane, with a spacing of about 20 mm / cells that puts the loaded side on faces of cells."""
    spacing = 16 / max(round(0.8 * cells), 1)
    scene = read_scene("cook.json", spacing, tolerance)
    watched = [48.0, 52.0]
    scene["output"] = {"probes": [{"name": "answer", "field": "displacement", "at": {"body_point": watched}}]}
    (x0, y0), lower, upper, (x3, y3) = scene["bodies"][0]["shape"]["polygon"]
    across = ((y3 - y0) + (upper[1] - lower[1])) / 2
    kratos = {
        "solver_type": "quasi_static",
        "corners": [[x0, y0], lower, upper, [x3, y3]],
        "body_cells": [round((lower[0] - x0) / spacing), round(across / spacing)],
        "walls": [[0, 0.0, [0, 1]]],
        "watched": watched,
    }
    return Problem("cook", scene, round(scene["time"]["end"] / scene["time"]["step"]), kratos)


def as_newton(scene: dict) -> dict:
    """Changes of the scene that bring bfree as near as it gets to the equations of NVIDIA Newton."""
    body = copy.deepcopy(scene["bodies"][0])
    constants = body["material"]["neo_hookean_logarithmic"]
    body["material"] = {"von_mises": {"elastic": constants, "yield_stress": {"initial": 1e9 * constants["young"]}}}
    return {
        "approximation": "linear",
        "grid": {"reset": "every_step"},
        "time": {"beta": 0.5, "gamma": 1.0},
        "bodies": [body],
    }


def competitors(problems: list[Problem], installed: dict) -> list[Competitor]:
    """Who races. `installed` has the version of each other program, or None."""
    found = []
    for problem in problems:
        for variant, functions in FUNCTIONS.items():
            if problem.name != "cook" or variant in ("linear", "cubic"):
                found.append(Competitor(problem, "bfree", variant, {"approximation": functions}))
        if problem.name == "static":
            jacobi = {"approximation": "linear", "solver": {"krylov": {"preconditioner": "block_jacobi"}}}
            found.append(Competitor(problem, "bfree", "linear, diagonal blocks", jacobi))
        if problem.name != "column":
            reset = {"approximation": "linear", "grid": {"reset": "every_step"}}
            found.append(Competitor(problem, "bfree", "linear, reset as Kratos", reset))
        if installed["Kratos"]:
            found += [Competitor(problem, "Kratos", name, solver) for name, solver in KRATOS_SOLVERS.items()]
        if installed["NVIDIA Newton"] and problem.name == "dynamic":
            found.append(Competitor(problem, "bfree", "linear, as NVIDIA Newton", as_newton(problem.scene), "NVIDIA Newton"))
            for name, basis in NEWTON_STRESSES.items():
                settings = NEWTON_SOLVER | {"strain_basis": basis}
                found.append(Competitor(problem, "NVIDIA Newton", name, settings, "NVIDIA Newton"))
    return found


def run_process(command: list[str], log: Path, limit: float) -> dict:
    """Runs a program on one thread: CPU seconds, peak memory in MB, and what it wrote."""
    environment = os.environ | {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # else Python compiles all sources at every start
    errors = log.with_suffix(".errors")
    with log.open("w") as output, errors.open("w") as complaints:
        process = subprocess.Popen(command, stdout=output, stderr=complaints, env=environment)
        timer = threading.Timer(limit, process.kill)
        timer.start()
        try:
            _, status, usage = os.wait4(process.pid, 0)
        finally:
            late = not timer.is_alive()
            timer.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
    if late:
        raise Failure(f"not ready after {limit:g} s")
    if process.returncode < 0:
        raise Failure(f"ended by {signal.Signals(-process.returncode).name}")
    if process.returncode:
        lines = errors.read_text(errors="replace").split("\n")
        raise Failure(next((line.strip() for line in lines if "rror: " in line), f"exit status {process.returncode}"))
    text = log.read_text(errors="replace")
    return {"cpu": usage.ru_utime + usage.ru_stime, "megabytes": usage.ru_maxrss / 1024, "text": text}


def run_bfree(one: Competitor, options, folder: Path, stop_after: int) -> dict:
    """One run of bfree."""
    file, out = folder / "scene.json", folder / "out"
    file.write_text(json.dumps(merged(one.problem.scene, one.settings)))
    command = [options.bfree, "run", str(file), "--threads", "1", "--quiet", "--discard", "--out", str(out), "--steps", str(stop_after)]
    measured = run_process(command, folder / "log", options.limit)
    report = json.loads((out / "report.json").read_text())
    counts, energies = report["counts"], report["energies"]
    if counts["steps"] != stop_after:
        raise Failure(f"{counts['steps']} steps in place of {stop_after}: {report['message']}")
    with (out / "probes.csv").open() as rows:
        last = list(csv.DictReader(rows))[-1]
    axis = "z" if "answer_z" in last else "y"
    del measured["text"]
    return measured | {
        "particles": counts["particles"],
        "newton": counts["newton_iterations"],
        "linear": counts["krylov_iterations"],
        "answers": {"displacement": float(last[f"answer_{axis}"]), "strain": energies["strain"], "kinetic": energies["kinetic"]},
    }


def kratos_task(one: Competitor, tolerance: float, stop_after: int) -> dict:
    """The task of `kratos_mpm.py`, from the scene of bfree."""
    problem, scene = one.problem, one.problem.scene
    body = scene["bodies"][0]
    material = body["material"]["neo_hookean_logarithmic"]
    traction = scene["tractions"][0]["traction"] if "tractions" in scene else None
    dimension = len(scene["grid"]["size"])
    gravity = scene["gravity"]["acceleration"] + [0.0] * (3 - dimension) if "gravity" in scene else None
    return problem.kratos | {
        "dimension": dimension,
        "size": scene["grid"]["size"],
        "spacing": scene["grid"]["spacing"],
        "young": material["young"],
        "poisson": material["poisson"],
        "density": body["density"],
        "gravity": gravity,
        "traction": traction,
        "step": scene["time"]["step"],
        "steps": problem.steps,
        "stop_after": stop_after,
        "linear_solver": one.settings | {"tolerance": tolerance},
        "tolerance": tolerance,
    }


def run_kratos(one: Competitor, options, folder: Path, stop_after: int) -> dict:
    """One run of Kratos. AMGCL does not tell its iterations."""
    task = kratos_task(one, options.tolerance, stop_after)
    command = [sys.executable, str(HERE / "kratos_mpm.py"), json.dumps(task)]
    measured = run_process(command, folder / "log", options.limit)
    text = measured.pop("text")
    result = json.loads(next(line for line in reversed(text.splitlines()) if line.startswith('{"particles"')))
    measured["cpu"] -= result.pop("seconds_of_answers")
    iterations = [int(n) for n in re.findall(r"Number of iterations : (\d+)", text)]
    return measured | result | {"linear": sum(iterations) if iterations else None}


def run_newton(one: Competitor, options, folder: Path, stop_after: int) -> dict:
    """One run of NVIDIA Newton."""
    scene, kratos = one.problem.scene, one.problem.kratos
    body = scene["bodies"][0]
    task = one.settings | body["material"]["neo_hookean_logarithmic"] | {
        "spacing": scene["grid"]["spacing"],
        "corners": kratos["corners"],
        "body_cells": kratos["body_cells"],
        "density": body["density"],
        "gravity": scene["gravity"]["acceleration"],
        "step": scene["time"]["step"],
        "stop_after": stop_after,
        "watched": kratos["watched"],
    }
    command = [sys.executable, str(HERE / "nvidia_newton.py"), json.dumps(task)]
    measured = run_process(command, folder / "log", options.limit)
    text = measured.pop("text")
    result = json.loads(next(line for line in reversed(text.splitlines()) if line.startswith('{"particles"')))
    measured["cpu"] -= result.pop("seconds_of_answers")
    return measured | result


RUNNERS = {"bfree": run_bfree, "Kratos": run_kratos, "NVIDIA Newton": run_newton}


def run_once(one: Competitor, options, stop_after: int) -> dict:
    """One run in a temporary folder. Whatever goes wrong is a `Failure`, so that the others race on."""
    runner = RUNNERS[one.program]
    with tempfile.TemporaryDirectory(prefix="race-") as folder:
        try:
            return runner(one, options, Path(folder), stop_after)
        except (OSError, LookupError, StopIteration, TypeError, ValueError) as reason:
            raise Failure(f"{type(reason).__name__}: {reason}") from reason


def warm_up(racers: list[Competitor], options) -> None:
    """Runs NVIDIA Newton without steps, so that Warp's cache has all kernels."""
    for one in racers:
        if one.program == "NVIDIA Newton":
            print(f"warm-up: {one.problem.name}: {one.name}", file=sys.stderr)
            try:
                one.warm_up = run_once(one, options, 0)["cpu"]
            except Failure as reason:
                one.failure = str(reason)


def race(racers: list[Competitor], options) -> None:
    """All runs, in turn. Who fails once does not start again."""
    for repeat in range(options.repeat):
        for one in racers:
            if one.failure:
                continue
            print(f"run {repeat + 1} of {options.repeat}: {one.problem.name}: {one.name}", file=sys.stderr)
            try:
                one.set_ups.append(run_once(one, options, 0))
                one.runs.append(run_once(one, options, one.problem.steps))
            except Failure as reason:
                one.failure = str(reason)


def first_step(racers: list[Competitor], options) -> list[dict]:
    """Answers of both programs after the first step, before a grid is reset: where the points are the same, so are the equations."""
    rows = []
    for problem in {one.problem.name: one.problem for one in racers}.values():
        rows.append({"problem": problem.name})
        for program, variant in (("bfree", "linear"), ("Kratos", "CG, diagonal")):
            one = next(r for r in racers if r.problem is problem and (r.program, r.variant) == (program, variant))
            try:
                rows[-1][program] = run_once(one, options, 1)["answers"]
            except Failure as reason:
                rows[-1]["failure"] = f"{program}: {reason}"
    return rows


def fastest_kratos(racers: list[Competitor], problem: Problem) -> Competitor | None:
    """The faster of the linear solvers of Kratos that came in."""
    finished = [one for one in racers if one.problem is problem and one.program == "Kratos" and not one.failure]
    return min(finished, key=Competitor.cpu, default=None)


def markdown(rows: list[list[str]]) -> str:
    """A table; the first row is its head. All columns but two hold numbers."""
    head, *body = rows
    rule = ["---", "---"] + ["---:"] * (len(head) - 2)
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, rule, *body))


def times_table(racers: list[Competitor]) -> str:
    """CPU seconds, memory and iterations."""
    rows = [["problem", "competitor", "particles", "CPU s", "min–max", "set-up", "steps", "peak MB"]]
    rows[0] += ["Newton iterations", "linear iterations", "Kratos / this", "of the steps"]
    for one in racers:
        if one.failure:
            rows.append([one.problem.name, f"{one.name}: failed, {one.failure}".replace("|", "/")] + ["–"] * 10)
            continue
        seconds = [run["cpu"] for run in one.runs]
        last, best = one.runs[-1], fastest_kratos(racers, one.problem)
        ratios = ["–", "–"]
        if best and one.like == "Kratos":
            ratios = [f"{best.cpu(part) / one.cpu(part):.2f}" for part in ("total", "steps")]
        rows.append(
            [one.problem.name, one.name, f"{last['particles']:,}", f"{one.cpu():.2f}", f"{min(seconds):.2f}–{max(seconds):.2f}"]
            + [f"{one.cpu('set-up'):.2f}", f"{one.cpu('steps'):.2f}"]
            + [f"{statistics.median(run['megabytes'] for run in one.runs):.0f}", str(last["newton"]), str(last["linear"] or "–")]
            + ratios
        )
    return markdown(rows)


def newton_table(racers: list[Competitor]) -> str:
    """NVIDIA Newton, and bfree in like settings: CPU seconds, ratio of the steps, and relative differences of answers from those of bfree."""
    rows = [["problem", "competitor", "CPU s", "min–max", "set-up", "steps", "its steps / bfree's", "linear iterations"]]
    rows[0] += ["displacement", "difference", "strain energy", "difference", "kinetic energy", "difference"]
    like = [one for one in racers if one.like == "NVIDIA Newton" and not one.failure]
    for one in like:
        mine = next((r for r in like if r.problem is one.problem and r.program == "bfree"), None)
        seconds = [run["cpu"] for run in one.runs]
        row = [one.problem.name, one.name, f"{one.cpu():.2f}", f"{min(seconds):.2f}–{max(seconds):.2f}", f"{one.cpu('set-up'):.2f}"]
        row += [f"{one.cpu('steps'):.2f}", f"{one.cpu('steps') / mine.cpu('steps'):.2f}" if mine else "–", str(one.runs[-1]["linear"])]
        for key, value in one.runs[-1]["answers"].items():
            row += [f"{value:.6g}", difference(value, mine.runs[-1]["answers"][key] if mine else 0.0)]
        rows.append(row)
    return markdown(rows)


def difference(value: float, reference: float) -> str:
    """A relative difference."""
    return f"{value / reference - 1:+.1e}" if reference else "–"


def answers_table(racers: list[Competitor]) -> str:
    """The answers at the end, and how far they are from those of bfree with linear functions."""
    rows = [["problem", "competitor", "displacement", "difference", "strain energy", "difference", "kinetic energy", "difference"]]
    for one in (r for r in racers if not r.failure):
        mine = next(r for r in racers if r.problem is one.problem and r.name == "bfree, linear")
        row = [one.problem.name, one.name]
        for key in ("displacement", "strain", "kinetic"):
            value = one.runs[-1]["answers"][key]
            reference = 0.0 if mine.failure else mine.runs[-1]["answers"][key]
            row += [f"{value:.8g}" if value else "–", difference(value, reference)]
        rows.append(row)
    return markdown(rows)


def first_step_table(checks: list[dict]) -> str:
    """Both programs after the first step."""
    rows = [["problem", "answer", "bfree, linear", "Kratos, CG", "difference"]]
    for check in checks:
        if "failure" in check:
            rows.append([check["problem"], f"failed, {check['failure']}".replace("|", "/"), "–", "–", "–"])
            continue
        for key, mine in check["bfree"].items():
            if mine:
                theirs = check["Kratos"][key]
                rows.append([check["problem"], key, f"{mine:.10g}", f"{theirs:.10g}", difference(theirs, mine)])
    return markdown(rows)


def machine(options) -> dict:
    """What raced where."""
    info = Path("/proc/cpuinfo")
    models = re.findall(r"model name\s*: (.*)", info.read_text()) if info.exists() else []
    try:
        version = subprocess.run([options.bfree, "--version"], capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError) as reason:
        raise SystemExit(f"cannot run bfree: {reason}. Build it with `cargo build --release`, or give its path with --bfree.") from None
    return {
        "bfree": version,
        **{program: installed_version(packages) for program, packages in PACKAGES.items()},
        "python": platform.python_version(),
        "system": platform.platform(),
        "processor": models[0] if models else platform.processor(),
        "cores": os.cpu_count(),
        "load": [round(load, 1) for load in os.getloadavg()],
    }


def installed_version(packages: list[str]) -> str | None:
    """The version of the first package, or None if one of the packages is not installed."""
    try:
        return [importlib.metadata.version(package.split("==")[0]) for package in packages][0]
    except importlib.metadata.PackageNotFoundError:
        return None


def parse_arguments():
    """The options of the command line."""
    others = " ".join(package for packages in PACKAGES.values() for package in packages)
    parser = argparse.ArgumentParser(description="bfree against Kratos MPM and NVIDIA Newton", epilog=f"pip install {others}")
    parser.add_argument("--cells", type=int, default=20, help="cells along a side of the block (default 20: 64,000 particles)")
    parser.add_argument("--repeat", type=int, default=3, help="runs of every competitor (default 3)")
    parser.add_argument("--bfree", default=str(ROOT / "target/release/bfree"), help="the program (default target/release/bfree)")
    parser.add_argument("--problems", nargs="+", default=PROBLEMS, choices=PROBLEMS)
    parser.add_argument("--tolerance", type=float, default=1e-6, help="relative residual of Newton's method (default 1e-6)")
    parser.add_argument("--limit", type=float, default=3600.0, help="seconds after which a run is stopped (default 3600)")
    parser.add_argument("--json", type=Path, help="write all numbers to this file")
    return parser.parse_args()


def as_json(one: Competitor) -> dict:
    """A competitor without its scene."""
    return dataclasses.asdict(one) | {"problem": one.problem.name}


def print_report(racers: list[Competitor], checks: list[dict], facts: dict, options) -> None:
    """All tables, in Markdown."""
    others = f"Kratos MPM {facts['Kratos'] or 'absent'}, NVIDIA Newton {facts['NVIDIA Newton'] or 'absent'}"
    print(f"\n{facts['bfree']}, {others}, Python {facts['python']}, {facts['system']},")
    print(f"{facts['processor']}, {facts['cores']} cores, load {facts['load']}; --cells {options.cells} --repeat {options.repeat}\n")
    print(times_table(racers))
    print("\nCPU s, set-up and peak MB are medians; steps is CPU s without the set-up; iterations are those of all steps.")
    if checks:
        print("Kratos / this is the CPU time of the faster Kratos over that of the row, in all and of the steps alone.")
    if any(one.like == "NVIDIA Newton" for one in racers):
        print("NVIDIA Newton solves other equations than Kratos, so its rows have no such ratio.\n")
        print(newton_table(racers))
        print("\nThe differences are those from bfree in the settings of the first row. NVIDIA Newton has one linear solve a step.")
        for one in (r for r in racers if r.warm_up is not None):
            print(f"{one.name}: the run before the race, which compiles kernels, took {one.warm_up:.1f} CPU s. It is not counted.")
    print("\nAnswers at the end, and the difference from bfree with linear functions:\n")
    print(answers_table(racers))
    if checks:
        print("\nAnswers after the first step:\n")
        print(first_step_table(checks) + "\n")
        for name in options.problems:
            print(f"- {name}: {DIFFERENCES[name]}")


def main() -> None:
    """Runs the race and prints its tables."""
    options = parse_arguments()
    facts = machine(options)
    problems = {
        "static": lambda: block(options.cells, options.tolerance, dynamic=False),
        "dynamic": lambda: block(options.cells, options.tolerance, dynamic=True),
        "column": lambda: column(options.cells, options.tolerance),
        "cook": lambda: cook(options.cells, options.tolerance),
    }
    racers = competitors([problems[name]() for name in options.problems], facts)
    for program, packages in PACKAGES.items():
        if facts[program] is None:
            print(f"{program} is not installed for this Python and does not race. To install it: pip install {' '.join(packages)}")
    warm_up(racers, options)
    race(racers, options)
    checks = first_step(racers, options) if facts["Kratos"] else []
    print_report(racers, checks, facts, options)
    if options.json:
        settings = {name: getattr(options, name) for name in ("cells", "repeat", "tolerance")}
        numbers = {"machine": facts, "options": settings, "first step": checks, "competitors": [as_json(one) for one in racers]}
        options.json.write_text(json.dumps(numbers, indent=1) + "\n")


if __name__ == "__main__":
    main()
