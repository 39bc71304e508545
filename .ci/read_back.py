"""Reads the snapshots of a run with meshio and compares every field with what it must be. Reads the packed snapshots with h5py, and with vtk
where it is installed, and compares every array and time with those of the snapshots: they must have the same bits, body by body.

usage: read_back.py DIRECTORY — of a packed run in 2D with all fields in `output.fields`, one body, and no loads.
       read_back.py --packed DIRECTORY — of any packed run; compares only the packed snapshots."""
import csv
import json
import re
import sys
from pathlib import Path

import h5py
import meshio
import numpy as np

try:
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonDataModel import vtkCompositeDataSet
    from vtkmodules.vtkIOHDF import vtkHDFReader
except ImportError:
    vtkHDFReader = None

FIELDS = ["position", "displacement", "velocity", "acceleration", "deformation_gradient", "jacobian", "strain", "stress",
          "pressure", "von_mises", "energy_density", "mass", "volume", "body"]
directory = Path(sys.argv[-1])
checked = 0


def same(name, found, expected, scale):
    """To rounding, of values of size `scale`."""
    global checked
    found, expected = np.asarray(found, float), np.asarray(expected, float)
    assert found.shape == expected.shape, f"{name}: {found.shape} and {expected.shape}"
    error = np.max(np.abs(found - expected), initial=0.0)
    assert error <= 1e-12 * scale, f"{name}: off by {error} of {scale}"
    checked += found.size


def entries(name):
    """Times and files of a series."""
    return re.findall(r'timestep="([^"]*)" part="0" file="([^"]*)"', (directory / f"{name}.pvd").read_text())


def bits(reader, name, found, expected):
    """The same type, shape and bits."""
    global checked
    found, expected = np.asarray(found), np.asarray(expected)
    assert (found.dtype, found.shape) == (expected.dtype, expected.shape), f"{reader}: {name}: {found.dtype} {found.shape}"
    assert found.tobytes() == expected.tobytes(), f"{reader}: {name} differs"
    checked += found.size


def by_h5py(path, step):
    """Number of steps, time, and the grids at a step by their names, by the offsets of the format."""
    with h5py.File(path) as file:
        root = file["VTKHDF"]
        assert list(root.attrs["Version"]) == [2, 2], dict(root.attrs)
        if root.attrs["Type"] == b"UnstructuredGrid":
            blocks = {None: root}
        else:
            assert root.attrs["Type"] == b"MultiBlockDataSet", dict(root.attrs)
            blocks = dict(root["Assembly"])
            order = h5py.h5p.CRT_ORDER_TRACKED
            assert all(group.id.get_create_plist().get_link_creation_order() & order for group in (root, root["Assembly"]))
        steps = next(iter(blocks.values()))["Steps"]
        return steps.attrs["NSteps"], steps["Values"][step], {name: h5py_grid(grid, step) for name, grid in blocks.items()}


def h5py_grid(root, step):
    """Points, arrays, connectivity and offsets of a grid."""
    assert root.attrs["Type"] == b"UnstructuredGrid", dict(root.attrs)
    steps = root["Steps"]
    part = steps["PartOffsets"][step]
    count, cells = root["NumberOfPoints"][part], root["NumberOfCells"][part]
    rows = lambda array, offset: array[offset:offset + count]
    # Every part before has one offset more than cells.
    first = steps["CellOffsets"][step, 0] + part
    ends = root["Offsets"][first:first + cells + 1]
    connectivity = rows(root["Connectivity"], steps["ConnectivityIdOffsets"][step, 0])
    data = {name: rows(root["PointData"][name], steps["PointDataOffsets"][name][step]) for name in root["PointData"]}
    return rows(root["Points"], steps["PointOffsets"][step]), data, connectivity, ends


def by_vtk(path, step):
    """The same by VTK's own reader."""
    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    count = reader.GetNumberOfSteps()
    reader.SetStep(step)
    reader.Update()
    data = reader.GetOutputDataObject(0)
    if data.IsA("vtkUnstructuredGrid"):
        blocks = {None: data}
    else:
        name = lambda k: data.GetMetaData(k).Get(vtkCompositeDataSet.NAME())
        blocks = {name(k): data.GetBlock(k) for k in range(data.GetNumberOfBlocks())}
    return count, reader.GetTimeValue(), {name: vtk_grid(grid) for name, grid in blocks.items()}


def vtk_grid(grid):
    """Points, arrays, connectivity and offsets of a grid."""
    arrays = [grid.GetPointData().GetArray(k) for k in range(grid.GetPointData().GetNumberOfArrays())]
    data = {array.GetName(): vtk_to_numpy(array) for array in arrays}
    cells = grid.GetCells()
    connectivity, ends = vtk_to_numpy(cells.GetConnectivityArray()), vtk_to_numpy(cells.GetOffsetsArray())
    return vtk_to_numpy(grid.GetPoints().GetData()), data, connectivity, ends


def packed(name):
    """Compares a packed series with its snapshots."""
    path, series = directory / f"{name}.vtkhdf", entries(name)
    meshes = [meshio.read(directory / file) for _, file in series]
    number = lambda mesh: mesh.point_data.get("body", np.zeros(len(mesh.points), int)).astype(int)
    bodies = np.unique(np.concatenate([number(mesh) for mesh in meshes]))
    names = {body: body_names[body] for body in bodies} if len(bodies) > 1 else {bodies[0]: None}
    for reader, read in [("h5py", by_h5py), ("vtk", by_vtk if vtkHDFReader else None)]:
        if read is None:
            print(f"skipped: {path.name} read by vtk, which is not installed")
            continue
        for step, ((time, _), mesh) in enumerate(zip(series, meshes)):
            count, found, grids = read(path, step)
            assert (count, found) == (len(series), float(time)), f"{reader}: {count} steps, time {found} of step {step}, {time}"
            assert list(grids) == list(names.values()), f"{reader}: {list(grids)}, {names}"
            for body, block in names.items():
                compare(f"{reader}: {block}", grids[block], mesh, number(mesh) == body)
    whole, parts = path.stat().st_size, sum((directory / file).stat().st_size for _, file in series)
    print(f"{path.name}: {len(names)} grids, {len(series)} snapshots, {whole} bytes, {whole / parts:.3f} of the .vtu files")


def compare(reader, grid, mesh, rows):
    """Compares a grid with some points of a snapshot."""
    points, data, connectivity, ends = grid
    bits(reader, "Points", points, mesh.points[rows])
    assert set(data) == set(mesh.point_data), f"{reader}: {set(data)}"
    for array, values in mesh.point_data.items():
        bits(reader, array, data[array], values[rows])
    corners = mesh.cells[0].data.shape[1]
    bits(reader, "connectivity", connectivity, np.arange(rows.sum(), dtype=np.int64))
    bits(reader, "offsets", ends, np.arange(rows.sum() // corners + 1, dtype=np.int64) * corners)


assert (directory / "particles.vtkhdf").is_file(), "pack the run first: bfree pack DIRECTORY"
body_names = json.loads((directory / "provenance.json").read_text())["bodies"]
for path in sorted(directory.glob("*.vtkhdf")):
    packed(path.stem)
if "--packed" in sys.argv:
    sys.exit(print(f"{checked} values with the same bits"))

series = entries("particles")
rows = {float(row["time"]): row for row in csv.DictReader((directory / "history.csv").open())}
assert len(series) > 3, series
first = None
for time, file in series:
    mesh = meshio.read(directory / file)
    assert list(mesh.point_data) == FIELDS, f"only what was asked for: {list(mesh.point_data)}"
    data = {name: np.asarray(values, float) for name, values in mesh.point_data.items()}
    row = rows[float(time)]
    assert float(mesh.field_data["TimeValue"][0]) == float(time)
    assert [block.type for block in mesh.cells] == ["vertex"]
    same("cells", mesh.cells[0].data.ravel(), np.arange(len(mesh.points)), 1)
    first = mesh.points.copy() if first is None else first
    same("position", data["position"], mesh.points, 1)
    same("displacement", data["displacement"], mesh.points - first, 15)
    f = data["deformation_gradient"].reshape(-1, 3, 3)
    jacobian = np.linalg.det(f)
    same("jacobian", data["jacobian"], jacobian, 1)
    order = ([0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2])
    strain = 0.5 * (np.transpose(f, (0, 2, 1)) @ f - np.eye(3))
    same("strain", data["strain"], strain[:, order[0], order[1]], 1)
    # Ciarlet's law (39) of the scene: K = 170, G = 30; sigma = F S F^T / J
    shear, lam = 30.0, 170.0 - 2.0 / 3.0 * 30.0
    left = f @ np.transpose(f, (0, 2, 1))
    sphere = (0.5 * lam * (jacobian**2 - 1.0) - shear)[:, None, None] * np.eye(3)
    sigma = (shear * left + sphere) / jacobian[:, None, None]
    same("stress", data["stress"], sigma[:, order[0], order[1]], 200)
    same("pressure", data["pressure"], -np.trace(sigma, axis1=1, axis2=2) / 3.0, 200)
    deviator = sigma - np.trace(sigma, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)
    # The root loses half of the digits of a deviator that vanishes.
    mises = np.sqrt(1.5 * np.sum(deviator**2, axis=(1, 2)))
    same("von Mises", data["von_mises"] ** 2, mises**2, 200**2)
    energy = lam / 4.0 * (jacobian**2 - 1.0) - (lam / 2.0 + shear) * np.log(jacobian) + shear * np.trace(strain, axis1=1, axis2=2)
    same("energy density", data["energy_density"], energy, 200)
    same("mass", data["mass"], 4.0 * data["volume"], 1)
    same("body", data["body"], np.zeros(len(mesh.points)), 1)
    same("strain energy", np.sum(data["volume"] * data["energy_density"]), float(row["strain"]), 10)
    same("kinetic energy", 0.5 * np.sum(data["mass"] * np.sum(data["velocity"] ** 2, axis=1)), float(row["kinetic"]), 10)
    momentum = data["mass"] @ data["velocity"]
    same("momentum", momentum, [float(row["momentum_x"]), float(row["momentum_y"]), 0.0], 50)
    assert np.all(data["acceleration"][:, 2] == 0.0)
print(f"{len(series)} snapshots read by meshio, {checked} values as they must be")
