"""A race of bfree against Kratos MPM on the same problems, one thread each.

    pip install KratosMPMApplication==10.4.4 KratosLinearSolversApplication==10.4.4
    cargo build --release
    python verification/race/race.py [--cells 20] [--repeat 3] [--bfree target/release/bfree] [--json FILE]

Without Kratos, bfree races alone. Compared is the CPU time and the peak memory of a whole process, start of the program included, to
solve

- `static`: the block of scenes/block_static.json on its fixed floor, under gravity in four load steps;
- `dynamic`: the same block, gravity at once, ten steps of the trapezoidal rule at Courant number 1.3;
- `cook`: Cook's membrane of scenes/cook.json in four load steps, in plane strain, with a spacing near 20 mm / cells.

Both programs have the same grid, the same steps, particles at the same Gauss points (in `cook` only nearly), the neo-Hookean law with
Λ/2 (ln J)², which is the one of Kratos, and Newton's method to the same relative residual. With inertia both begin with the acceleration
of a free fall, zero on the floor. Kratos has linear functions; the like of it in bfree is `linear`. Cubic and LME functions of bfree
are in the table to show what they cost. Everything else is the default of each program, with these exceptions:

- Kratos has conjugate gradients with a diagonal preconditioner, and, as is its default, with AMGCL. Their tolerance is that of Newton's
  method. Looser ones cost more iterations of Newton's method, and assembly in these iterations is most of Kratos' time. bfree keeps its
  own: an adaptive tolerance in load steps, and 1e-8 with inertia.
- `linear, reset as Kratos` is bfree with a new grid in every step.
- In `static`, both programs begin a step with the motion of the last one. In `cook`, this turns cells of Kratos inside out, so there it
  has its quasi-static solver, which begins with no motion. Even so its Newton's method, which has no line search, converges at some
  spacings and fails at others, as particles move to cells that they hardly fill: 9 of the 17 from 16/4 to 16/24 mm that were tried.

Every competitor runs in its own process, in turn with the others, so that a disturbance of the machine hits all of them. CPU seconds and
memory are those that the operating system reports for that process. The set-up is the CPU time of a run that takes no step; the rest
is the time of the steps. The time in which the script asks Kratos for the answers is not counted. Memory below that of this script,
some 20 MB, is not resolved.

The answers are the displacement along the load of the particle nearest to the middle of the block's top, or of the middle of the
membrane's loaded side; the strain energy; the kinetic energy. Whether both programs solve the same equations is seen after the first
step, when no grid has been reset.

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
INSTALL = "pip install KratosMPMApplication==10.4.4 KratosLinearSolversApplication==10.4.4"
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
DIFFERENCES = {
    "static": "Kratos moves the points to a new grid after every load step, where the old stresses are not in balance. bfree keeps the grid"
    " until a strain of 1; where it takes a new one (`reset as Kratos`), it carries what is out of balance over.",
    "dynamic": "Kratos takes a new grid in every step, bfree at a strain of 0.1. In addition, Kratos updates the velocity of a point with"
    " the point's own acceleration at the start of the step, bfree with that of its nodes.",
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
    settings: dict  # bfree: changes of the scene; Kratos: the linear solver
    runs: list[dict] = field(default_factory=list)
    set_ups: list[dict] = field(default_factory=list)
    failure: str | None = None

    @property
    def name(self) -> str:
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


def block(cells: int, tolerance: float, dynamic: bool) -> Problem:
    """The block, in load steps or released."""
    scene = read_scene("block_static.json", 1 / cells, tolerance)
    steps = 4
    scene["time"] |= {"step": scene["time"]["end"] / steps}
    if dynamic:
        body = scene["bodies"][0]
        young, poisson = body["material"]["neo_hookean_logarithmic"].values()
        stiffness = young * (1 - poisson) / ((1 + poisson) * (1 - 2 * poisson))  # Λ + 2G
        step = COURANT / cells / math.sqrt(stiffness / body["density"])
        steps = 10
        scene["time"] = {"step": step, "end": steps * step}
        del scene["gravity"]["curve"]
    watched = [1.0, 1.0, 1.0]
    scene["output"] = {"probes": [{"name": "answer", "field": "displacement", "at": {"particle": watched}}]}
    shape = scene["bodies"][0]["shape"]["box"]
    kratos = {"solver_type": "dynamic" if dynamic else "static", "fixed_axis": 2, "watched": watched}
    kratos |= {"corners": [shape["min"], shape["max"]], "body_cells": [cells] * 3}
    return Problem("dynamic" if dynamic else "static", scene, steps, kratos)


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
        "fixed_axis": 0,
        "watched": watched,
    }
    return Problem("cook", scene, round(scene["time"]["end"] / scene["time"]["step"]), kratos)


def competitors(problems: list[Problem], with_kratos: bool) -> list[Competitor]:
    """Who races."""
    found = []
    for problem in problems:
        for variant, functions in FUNCTIONS.items():
            if problem.name != "cook" or variant in ("linear", "cubic"):
                found.append(Competitor(problem, "bfree", variant, {"approximation": functions}))
        if problem.name == "static":
            jacobi = {"approximation": "linear", "solver": {"krylov": {"preconditioner": "block_jacobi"}}}
            found.append(Competitor(problem, "bfree", "linear, diagonal blocks", jacobi))
        reset = {"approximation": "linear", "grid": {"reset": "every_step"}}
        found.append(Competitor(problem, "bfree", "linear, reset as Kratos", reset))
        if with_kratos:
            found += [Competitor(problem, "Kratos", name, solver) for name, solver in KRATOS_SOLVERS.items()]
    return found


def run_process(command: list[str], log: Path, limit: float) -> dict:
    """Runs a program on one thread: CPU seconds, peak memory in MB, and what it wrote."""
    one_thread = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
    errors = log.with_suffix(".errors")
    with log.open("w") as output, errors.open("w") as complaints:
        process = subprocess.Popen(command, stdout=output, stderr=complaints, env=os.environ | one_thread)
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
    return problem.kratos | {
        "dimension": len(scene["grid"]["size"]),
        "size": scene["grid"]["size"],
        "spacing": scene["grid"]["spacing"],
        "young": material["young"],
        "poisson": material["poisson"],
        "density": body["density"],
        "gravity": scene["gravity"]["acceleration"] if "gravity" in scene else None,
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


def run_once(one: Competitor, options, stop_after: int) -> dict:
    """One run in a temporary folder. Whatever goes wrong is a `Failure`, so that the others race on."""
    runner = run_bfree if one.program == "bfree" else run_kratos
    with tempfile.TemporaryDirectory(prefix="race-") as folder:
        try:
            return runner(one, options, Path(folder), stop_after)
        except (OSError, LookupError, StopIteration, TypeError, ValueError) as reason:
            raise Failure(f"{type(reason).__name__}: {reason}") from reason


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
    rows = [["problem", "competitor", "particles", "CPU s", "min–max", "set-up", "steps", "peak MB", "Newton", "linear"]]
    rows[0] += ["Kratos / this", "of the steps"]
    for one in racers:
        if one.failure:
            rows.append([one.problem.name, f"{one.name}: failed, {one.failure}".replace("|", "/")] + ["–"] * 10)
            continue
        seconds = [run["cpu"] for run in one.runs]
        last, best = one.runs[-1], fastest_kratos(racers, one.problem)
        ratios = ["–", "–"]
        if best:
            ratios = [f"{best.cpu(part) / one.cpu(part):.2f}" for part in ("total", "steps")]
        rows.append(
            [one.problem.name, one.name, f"{last['particles']:,}", f"{one.cpu():.2f}", f"{min(seconds):.2f}–{max(seconds):.2f}"]
            + [f"{one.cpu('set-up'):.2f}", f"{one.cpu('steps'):.2f}"]
            + [f"{statistics.median(run['megabytes'] for run in one.runs):.0f}", str(last["newton"]), str(last["linear"] or "–")]
            + ratios
        )
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
        "Kratos": kratos_version(),
        "python": platform.python_version(),
        "system": platform.platform(),
        "processor": models[0] if models else platform.processor(),
        "cores": os.cpu_count(),
        "load": [round(load, 1) for load in os.getloadavg()],
    }


def kratos_version() -> str | None:
    """The version of KratosMPMApplication, or None where it is not installed."""
    try:
        return importlib.metadata.version("KratosMPMApplication")
    except importlib.metadata.PackageNotFoundError:
        return None


def parse_arguments():
    parser = argparse.ArgumentParser(description="bfree against Kratos MPM", epilog=f"Kratos: {INSTALL}")
    parser.add_argument("--cells", type=int, default=20, help="cells along a side of the block (default 20: 64,000 particles)")
    parser.add_argument("--repeat", type=int, default=3, help="runs of every competitor (default 3)")
    parser.add_argument("--bfree", default=str(ROOT / "target/release/bfree"), help="the program (default target/release/bfree)")
    parser.add_argument("--problems", nargs="+", default=["static", "dynamic", "cook"], choices=["static", "dynamic", "cook"])
    parser.add_argument("--tolerance", type=float, default=1e-6, help="relative residual of Newton's method (default 1e-6)")
    parser.add_argument("--limit", type=float, default=3600.0, help="seconds after which a run is stopped (default 3600)")
    parser.add_argument("--json", type=Path, help="write all numbers to this file")
    return parser.parse_args()


def as_json(one: Competitor) -> dict:
    """A competitor without its scene."""
    return dataclasses.asdict(one) | {"problem": one.problem.name}


def print_report(racers: list[Competitor], checks: list[dict], facts: dict, options) -> None:
    """All tables, in Markdown."""
    print(f"\n{facts['bfree']}, Kratos MPM {facts['Kratos'] or 'absent'}, Python {facts['python']}, {facts['system']},")
    print(f"{facts['processor']}, {facts['cores']} cores, load {facts['load']}; --cells {options.cells} --repeat {options.repeat}\n")
    print(times_table(racers))
    print("\nCPU s, set-up and peak MB are medians; steps is CPU s without the set-up; Newton and linear are all iterations.")
    if checks:
        print("Kratos / this is the CPU time of the faster Kratos over that of the row, in all and of the steps alone.")
    print("\nAnswers at the end, and the difference from bfree with linear functions:\n")
    print(answers_table(racers))
    if checks:
        print("\nAnswers after the first step:\n")
        print(first_step_table(checks) + "\n")
        for name in options.problems:
            print(f"- {name}: {DIFFERENCES[name]}")


def main() -> None:
    options = parse_arguments()
    facts = machine(options)
    problems = {
        "static": lambda: block(options.cells, options.tolerance, dynamic=False),
        "dynamic": lambda: block(options.cells, options.tolerance, dynamic=True),
        "cook": lambda: cook(options.cells, options.tolerance),
    }
    racers = competitors([problems[name]() for name in options.problems], with_kratos=facts["Kratos"] is not None)
    if facts["Kratos"] is None:
        print(f"Kratos is not installed for this Python, so bfree races alone. To install it: {INSTALL}")
    race(racers, options)
    checks = first_step(racers, options) if facts["Kratos"] else []
    print_report(racers, checks, facts, options)
    if options.json:
        settings = {name: getattr(options, name) for name in ("cells", "repeat", "tolerance")}
        numbers = {"machine": facts, "options": settings, "first step": checks, "competitors": [as_json(one) for one in racers]}
        options.json.write_text(json.dumps(numbers, indent=1) + "\n")


if __name__ == "__main__":
    main()
