"""Reads the snapshots of a run with meshio and compares every field with what it must be.

usage: read_back.py DIRECTORY — of a run in 2D with all fields in `output.fields`, one body, and no loads."""
import csv
import re
import sys
from pathlib import Path

import meshio
import numpy as np

FIELDS = ["position", "displacement", "velocity", "acceleration", "deformation_gradient", "jacobian", "strain", "stress",
          "pressure", "von_mises", "energy_density", "mass", "volume", "body"]
directory = Path(sys.argv[1])
checked = 0


def same(name, found, expected, scale):
    """To rounding, of values of size `scale`."""
    global checked
    found, expected = np.asarray(found, float), np.asarray(expected, float)
    assert found.shape == expected.shape, f"{name}: {found.shape} and {expected.shape}"
    error = np.max(np.abs(found - expected), initial=0.0)
    assert error <= 1e-12 * scale, f"{name}: off by {error} of {scale}"
    checked += found.size


series = re.findall(r'timestep="([^"]*)" part="0" file="([^"]*)"', (directory / "particles.pvd").read_text())
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
