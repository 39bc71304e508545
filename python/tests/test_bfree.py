"""The promises of bfree in Python, against known answers and against itself."""

import ast
import collections
import json
import shutil
import signal
import subprocess
import threading
import time
from pathlib import Path

import bfree
import numpy as np
import pytest
from scipy.sparse.linalg import LinearOperator, cg

ROOT = Path(__file__).resolve().parents[2]
REBOUND = ROOT / "scenes" / "rebound.json"
BLOCK = ROOT / "scenes" / "block_static.json"


def neo_hookean(E, lame=100.0, shear=50.0):
    """Ciarlet's, as the shipped law."""
    J = np.sqrt(bfree.det(2 * E + np.eye(3)))
    return lame / 4 * (J**2 - 1) - (lame / 2 + shear) * np.log(J) + shear * np.trace(E)


def test_free_fall():
    set = {"gravity": {"acceleration": [0, -0.01]}, "time.end": 1}
    simulation = bfree.Scene(REBOUND, set=set).build()
    start = simulation.particles.position
    steps = list(simulation)
    assert len(steps) == 20 and simulation.time == simulation.end == 1.0
    assert steps[3].time == pytest.approx(0.2, rel=1e-14) and steps[3].dt == 0.05
    fallen = simulation.particles.position - start
    assert np.allclose(fallen, [0.5, -0.005], rtol=0, atol=1e-12)
    assert np.allclose(simulation.particles.displacement, fallen, rtol=0, atol=1e-15)
    mass = simulation.particles.mass.sum()
    assert simulation.momentum == pytest.approx([0.5 * mass, -0.01 * mass], rel=1e-11)
    assert simulation.kinetic_energy == pytest.approx(3.5 + simulation.external_work, rel=1e-11)
    assert simulation.strain_energy < 1e-20 and simulation.dissipated == 0


def test_arrays_are_values_of_their_moment():
    simulation = bfree.Scene(REBOUND).build()
    particles = simulation.particles
    before = particles.position
    copy = before.copy()
    simulation.advance()
    assert (before == copy).all() and (particles.position != copy).any()
    assert particles.position is particles.position
    for name in dir(particles):
        array = getattr(particles, name)
        assert len(array) == len(particles) == 112, name
        assert not array.flags.writeable and (array.base is None or not array.base.flags.writeable), name
        with pytest.raises(ValueError):
            array[0] = 1
    F = particles.deformation_gradient
    assert np.allclose(np.linalg.det(F), particles.jacobian)
    assert np.allclose((F.transpose(0, 2, 1) @ F - np.eye(3)) / 2, particles.strain)
    assert particles.body.dtype == np.int64 and (particles.body == 0).all()


def differ(numbers):
    """No two numbers are equal up to their sign, and none is zero."""
    sizes = np.sort(np.abs(np.ravel(numbers)))
    return sizes[0] > 1e-4 * sizes[-1] and (np.diff(sizes) > 1e-4 * sizes[-1]).all()


def test_arrays_in_space_follow_from_the_deformation_gradient():
    lame, shear, gravity = 900.0, 400.0, np.array([8.0, -15.0, 4.0])
    material = {"neo_hookean": {"lambda": lame, "shear": shear}}
    scene = {
        "grid": {"size": [2, 1, 1], "spacing": 0.125},
        "approximation": {"bspline": {"degree": 2}},
        "time": {"step": 0.02, "end": 0.1},
        "bodies": [{"name": "beam", "shape": {"box": {"min": [0, 0.25, 0.25], "max": [1, 0.75, 0.5]}}, "density": 3, "material": material}],
        "boundary": {"left": "fixed"},
        "gravity": {"acceleration": gravity},
    }
    for time in (scene["time"], {"step": 0.5, "end": 1, "scheme": "none"}):
        simulation = bfree.Scene(scene | {"time": time}).build()
        start = simulation.particles.position
        *_, step = simulation
        particles = simulation.particles
        F, unit, m = particles.deformation_gradient, np.eye(3), particles.mass
        J, b, C = np.linalg.det(F), F @ F.transpose(0, 2, 1), F.transpose(0, 2, 1) @ F
        column = J[:, None, None]
        stress = (lame / 2 * (column**2 - 1) * unit + shear * (b - unit)) / column
        deviator = stress - np.trace(stress, axis1=1, axis2=2)[:, None, None] / 3 * unit
        trace = np.trace(C, axis1=1, axis2=2)
        energy = lame / 4 * (J**2 - 1) - (lame / 2 + shear) * np.log(J) + shear / 2 * (trace - 3)
        upper = np.triu_indices(3)
        assert any(differ(H) and differ(s[upper]) for H, s in zip(F - unit, stress))
        wanted = {
            "displacement": particles.position - start,
            "jacobian": J,
            "strain": (C - unit) / 2,
            "stress": stress,
            "principal_stress": np.linalg.eigvalsh(stress)[:, ::-1],
            "pressure": -np.trace(stress, axis1=1, axis2=2) / 3,
            "von_mises": np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2))),
            "energy_density": energy,
            "mass": 3 * particles.volume,
        }
        for name, values in wanted.items():
            assert np.allclose(getattr(particles, name), values, rtol=1e-9, atol=1e-9), name
        assert simulation.strain_energy == pytest.approx((particles.volume * energy).sum(), rel=1e-9)
        if "scheme" in time:
            assert step.reactions["left"] == pytest.approx(-m.sum() * gravity, rel=1e-6)
            continue
        v = particles.velocity
        assert simulation.momentum == pytest.approx(m @ v, rel=1e-12) and differ(m @ v)
        assert simulation.kinetic_energy == pytest.approx((m * (v**2).sum(axis=1)).sum() / 2, rel=1e-12)
        assert simulation.external_work == pytest.approx(m @ (particles.position - start) @ gravity, rel=1e-9)


def test_the_tangent_is_the_derivative_of_the_residual():
    # Pressed against the wall, so that something is prescribed and the body is deformed.
    simulation = bfree.Scene(REBOUND, set={"time.end": 22}).build()
    collections.deque(simulation, maxlen=0)
    random = np.random.default_rng(1)
    free = simulation.free
    assert 0 < (~free).sum() < free.size and simulation.nodes.shape == free.shape
    dphi = 1e-3 * random.standard_normal(free.shape)
    K = simulation.tangent(dphi)
    assert isinstance(K, LinearOperator) and K.shape == (free.size, free.size)
    u = random.standard_normal(free.shape) * free
    step = 1e-5
    difference = (simulation.residual(dphi + step * u) - simulation.residual(dphi - step * u)) / (2 * step)
    product = (K @ u.ravel()).reshape(u.shape)
    # The difference has an error of order step² and one of round-off over step.
    assert np.abs(product - difference * free).max() < 1e-8 * np.abs(product).max()
    several = random.standard_normal((free.size, 3))
    assert (K @ several == np.stack([K @ column for column in several.T], axis=1)).all()
    symmetric = np.tensordot(several.T, K @ several, 1)
    assert np.abs(symmetric - symmetric.T).max() < 1e-12 * np.abs(symmetric).max()
    assert (simulation.K @ np.ones(free.size) == simulation.tangent(np.zeros(free.shape)) @ np.ones(free.size)).all()


def test_scipy_solves_the_step_that_bfree_takes():
    # Without a preconditioner, outer coefficients that follow a cubic polynomial in space take thousands of iterations.
    quadratic = {"bspline": {"degree": 2}}
    set = {"grid.spacing": 0.25, "solver.newton.tolerance": 1e-10, "approximation": quadratic}
    simulation = bfree.Scene(BLOCK, set=set).build()
    # A moving floor as well: its motion is known, not solved for.
    free, dphi = simulation.free.ravel(), simulation.prescribed.ravel().copy()
    assert (dphi == 0).all()
    for _ in range(20):
        residual = simulation.residual(dphi).ravel()
        if np.linalg.norm(residual[free]) < 1e-9 * np.linalg.norm(residual):
            break
        change, failed = cg(simulation.tangent(dphi), -residual * free, rtol=1e-10, maxiter=2000)
        assert not failed
        dphi += change
    else:
        pytest.fail("no equilibrium in 20 iterations")
    reaction = simulation.residual(dphi).reshape(-1, 3)
    reaction = np.where(simulation.free, 0, reaction).sum(axis=0)
    step = simulation.advance()
    assert reaction == pytest.approx(step.reactions["back"], rel=1e-7, abs=1e-7)
    # Half of the block's weight, m g = 50.
    assert step.reactions["back"] == pytest.approx([0, 0, 25], rel=1e-6, abs=1e-6)
    assert step.iterations == len(step.residuals) - 1 > 0 and step.krylov_iterations > 0


def test_a_moving_wall_is_prescribed():
    set = {"boundary.right": {"displacement": [[0, [0, None]], [80, [-8, None]]]}, "time.end": 1}
    text = json.loads(REBOUND.read_text())
    text["bodies"][0]["shape"]["ball"]["center"] = [13.5, 2.5]
    simulation = bfree.Scene(text, set=set).build()
    moved = simulation.prescribed[~simulation.free]
    assert len(moved) > 0 and moved == pytest.approx(-0.1 * simulation.dt)


def test_an_energy_in_python_is_the_law_it_writes_down():
    law = bfree.Law(neo_hookean)
    assert "FAIL" not in law.check() and law.operations < 100
    set = {"bodies.0.material": {"neo_hookean": {"lambda": 100, "shear": 50}}, "time.end": 22}
    runs = [bfree.Scene(REBOUND, set=set).build(laws=laws) for laws in (None, {"cylinder": law})]
    for run in runs:
        collections.deque(run, maxlen=0)
    shipped, own = runs
    assert shipped.strain_energy > 0.5
    assert own.strain_energy == pytest.approx(shipped.strain_energy, rel=1e-9)
    assert np.allclose(own.particles.stress, shipped.particles.stress, rtol=0, atol=1e-7)


@pytest.mark.parametrize(
    "energy, error, words",
    [
        (lambda E: np.trace(E) + np.sum(E * E), ValueError, "S = 0"),  # stressed at rest
        (lambda E: np.sum(E * E) + 1, ValueError, "W = 0"),
        (lambda E: np.sqrt(np.sum(E * E)), ValueError, "NaN"),
        (lambda E: E[0, 0] if E[0, 0] > 0 else 0 * E[0, 0], TypeError, "no branches"),
        (lambda E: float(E[0, 0]), TypeError, "has no value"),
        (lambda E: abs(E[0, 0]), TypeError, "kink"),
        (lambda E: 1.0, TypeError, "returned 1.0"),
        (lambda E: E, TypeError, "one number"),
        (lambda E: E[0, 3], IndexError, "out of bounds"),
        (lambda E: -np.sum(E * E), ValueError, "negative stiffness"),
        (lambda E: np.linalg.det(E), TypeError, "bfree.det"),
    ],
)
def test_energies_that_are_none(energy, error, words):
    with pytest.raises(error, match=words):
        bfree.Law(energy)


def test_every_operation_of_an_energy():
    # Each function f with f(0) = f'(0) = 0 added to a solid; its value is that of NumPy.
    functions = [
        lambda x: 1 - np.cos(x),
        lambda x: np.cosh(x) - 1,
        lambda x: np.sinh(x) * np.sin(x),
        lambda x: np.tan(x) * np.tanh(x) * np.arctan(x + 1),
        lambda x: np.exp(x) - 1 - x,
        lambda x: x - np.log(1 + x),
        lambda x: 2 ** (x * x) - (1 + x) ** (x * x),
        lambda x: (4 + x) ** 0.5 - 2 - x / 4,
        lambda x: (1 + x) ** -2 - 1 - (-2 * x) / +1,
        lambda x: 3 / (1 + x) - 3 + 3 * x,
    ]
    set = {"boundary": {"left": "fixed"}, "time.end": 0.2, "bodies.0.velocity": [0.5, 0.2]}
    for f in functions:
        simulation = bfree.Scene(REBOUND, set=set).build(laws={"cylinder": bfree.Law(lambda E: f(np.trace(E)), check=False)})
        assert simulation.particles.energy_density == pytest.approx(0, abs=1e-15)
    # Not for all strains: 1 + tr E may be negative.
    law = bfree.Law(lambda E: sum(f(np.trace(E)) for f in functions) + 50 * np.sum(E * E), check=False)
    text = json.loads(BLOCK.read_text())
    simulation = bfree.Scene(text, set={"grid.spacing": 0.25, "gravity.acceleration": [0, 0, -2]}).build(laws={"block": law})
    collections.deque(simulation, maxlen=0)
    E = simulation.particles.strain
    trace = np.trace(E, axis1=1, axis2=2)
    W = sum(f(trace) for f in functions) + 50 * (E * E).sum(axis=(1, 2))
    assert np.abs(trace).max() > 1e-3 and np.allclose(simulation.particles.energy_density, W, rtol=1e-9, atol=1e-15)


def test_scenes_are_files_or_dicts():
    text = json.loads(REBOUND.read_text())
    text["bodies"][0]["velocity"] = np.array([0.5, 0.0])
    text["grid"]["spacing"] = np.float64(0.5)
    scene = bfree.Scene(text)
    assert scene.to_dict() == bfree.Scene(str(REBOUND)).to_dict() and scene.dimension == 2
    assert bfree.Scene(scene.to_dict(), set={"time.step": 0.1}).to_dict()["time"]["step"] == 0.1


@pytest.mark.parametrize(
    "set, words",
    [
        ({"time.step": -1}, r"rebound.json: time.step: -1 is not allowed"),
        ({"bodies.0.densty": 1}, r"bodies\[0\].densty: unknown field `densty`.*did you mean `density`"),
        ({"time.step": float("nan")}, 'time.step: invalid type: string "NaN", expected a number'),
        ({"nowhere.at.all": 1}, "nowhere"),
        ({"": 1}, "not allowed"),
    ],
)
def test_errors_keep_the_path_of_the_key(set, words):
    with pytest.raises(bfree.SceneError, match=words):
        bfree.Scene(REBOUND, set=set)


def test_errors_of_files_bodies_and_steps():
    with pytest.raises(bfree.SceneError, match="cannot read nowhere.json: No such file"):
        bfree.Scene("nowhere.json")
    with pytest.raises(TypeError, match="a path or a dict"):
        bfree.Scene(3.0)
    with pytest.raises(bfree.SceneError, match='no body is called "disc"; the bodies are .*cylinder'):
        bfree.Scene(REBOUND).build(laws={"disc": bfree.Law(neo_hookean)})
    with pytest.raises(bfree.SceneError, match=r"bodies\[0\].shape: .* must lie in the grid, from x = 0 to 15"):
        bfree.Scene(REBOUND, set={"bodies.0.shape": {"ball": {"center": [90, 90], "radius": 1}}}).build()
    simulation = bfree.Scene(REBOUND, set={"bodies.0.velocity": [1000, 0]}).build()
    with pytest.raises(bfree.StepError, match=r"from t = 0 failed(.|\n)*\n  because: particle \d+ leaves the grid"):
        simulation.advance()
    assert simulation.time == 0
    with pytest.raises(ValueError, match="dphi has 3 numbers"):
        simulation.residual([1, 2, 3])
    with pytest.raises(bfree.StepError, match="det F"):
        simulation.residual(1e3 * np.random.default_rng(2).standard_normal(simulation.free.shape))
    with pytest.raises(AttributeError, match="they have position, "):
        simulation.particles.colour
    with pytest.raises(AttributeError, match="inertia"):
        bfree.Scene(BLOCK, set={"grid.spacing": 0.5}).build().particles.velocity


def test_other_threads_go_on_while_a_step_is_taken():
    simulation = bfree.Scene(BLOCK, set={"bodies.0.particles_per_cell": 3}).build()
    counted, stop = [], threading.Event()

    def count():
        while not stop.is_set():
            counted.append(time.perf_counter())
            time.sleep(1e-3)

    thread = threading.Thread(target=count)
    thread.start()
    start = time.perf_counter()
    simulation.advance()
    end = time.perf_counter()
    stop.set()
    thread.join()
    # Were the lock held, none would lie between; the machine may be busy, so a tenth of them is enough.
    assert sum(start < at < end for at in counted) > 0.1 * (end - start) / 1e-3, end - start


def test_a_missing_gpu_is_an_exception():
    try:
        simulation = bfree.Scene(REBOUND).build(gpu=True)
    except bfree.SceneError as error:
        assert "no NVIDIA driver" in str(error) or "device" in str(error)
    else:
        simulation.advance()


def test_a_step_can_be_interrupted_and_nothing_has_moved():
    # One load step of seconds.
    simulation = bfree.Scene(ROOT / "scenes" / "cook.json", set={"grid.spacing": 0.25, "time.step": 1}).build()
    before = simulation.particles.position
    handler = signal.signal(signal.SIGALRM, signal.default_int_handler)
    with pytest.raises(KeyboardInterrupt):
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        simulation.advance()
    signal.signal(signal.SIGALRM, handler)
    assert simulation.time == 0 and (simulation.particles.position == before).all()


def test_a_run_can_be_interrupted_and_goes_on():
    simulation = bfree.Scene(REBOUND).build()
    # As Ctrl-C, from a clock of the kernel: a thread of Python might come too late on a machine that is busy.
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    with pytest.raises(KeyboardInterrupt):
        signal.setitimer(signal.ITIMER_REAL, 0.02)
        # A loop in C, in which the interpreter itself does not look for signals.
        collections.deque(simulation, maxlen=0)
    signal.signal(signal.SIGALRM, before)
    at = simulation.time
    assert 0 <= at < simulation.end
    other = bfree.Scene(REBOUND).build()
    while other.time < at + 1:
        other.advance()
    while simulation.time < at + 1:
        simulation.advance()
    assert (simulation.particles.position == other.particles.position).all()


def test_pyvista():
    pyvista = pytest.importorskip("pyvista")
    simulation = bfree.Scene(REBOUND).build()
    simulation.advance()
    points = simulation.to_pyvista(["velocity", "stress", "jacobian"])
    assert isinstance(points, pyvista.PolyData) and points.n_points == 112
    assert np.allclose(points.points[:, :2], simulation.particles.position) and (points.points[:, 2] == 0).all()
    assert np.allclose(points["velocity"], [0.5, 0, 0]) and points["stress"].shape == (112, 9)
    with pytest.raises(AttributeError, match="colour"):
        simulation.to_pyvista(["colour"])


def test_the_stubs_are_those_of_the_module():
    stub = ast.parse((ROOT / "python" / "package" / "bfree" / "__init__.pyi").read_text())
    written = {node.name: node for node in stub.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    assert set(written) | {"__version__"} == set(bfree.__all__)
    for name, node in written.items():
        if not isinstance(node, ast.ClassDef) or name.endswith("Error"):
            continue
        members = {one.name for one in node.body if isinstance(one, ast.FunctionDef)} - {"__init__"}
        if name == "Particles":
            simulation = bfree.Scene(REBOUND).build()
            assert members - {"__len__"} == set(dir(simulation.particles))
            continue
        there = {one for one in vars(getattr(bfree, name)) if not one.startswith("__") or one in ("__iter__", "__next__")}
        if name not in ("Number", "Tangent"):
            assert members == there, name


def test_a_scene_loads_only_libraries_that_are_allowed(tmp_path):
    if not shutil.which("gfortran"):
        pytest.skip("there is no gfortran")
    library = tmp_path / "libneo.so"
    source = ROOT / "examples" / "laws" / "neo_hookean.f"
    subprocess.run(["gfortran", "-shared", "-fPIC", "-O2", "-I", source.parent, "-o", library, source], check=True)
    law = {"umat": {"library": str(library), "properties": [100.0, 60.0]}}
    scene = {
        "grid": {"size": [3, 2], "spacing": 0.25},
        "time": {"step": 1, "end": 1, "scheme": "none"},
        "bodies": [{"name": "block", "shape": {"box": {"min": [0, 0], "max": [1, 1]}}, "density": 1, "material": law}],
        "boundary": {"bottom": "fixed"},
        "gravity": {"acceleration": [0, -10]},
    }
    with pytest.raises(bfree.SceneError, match="allow_libraries"):
        bfree.Scene(scene)
    step = bfree.Scene(scene, allow_libraries=[library]).build().advance()
    assert step.reactions["bottom"] == pytest.approx([0, 10], abs=1e-6)
    assert step.residuals[-1] < 1e-8 * step.residuals[0]
