"""A disc that flies head-on against a smooth rigid wall, by finite elements: duration of contact, largest force, rebound.

An independent program (NumPy): bilinear elements with 2 x 2 points in plane strain, lumped mass, central differences. R = 1, density 1,
speed 1; neo-Hookean with Ciarlet's volumetric energy, Young's modulus 1000 and Poisson's ratio 0.3; a penalty of 16 (L + 2 G) for each
depth and reference area at the nodes of the rim. Two equal discs that meet head-on with half of this penalty are the same problem.

    python3 verification/reference/disc_on_wall.py 16 32 64

For each number of elements along a quarter of the circle: duration, largest force, rebound, strain energy after contact.
"""

import sys

import numpy as np

YOUNG, POISSON = 1000.0, 0.3
LAMBDA, SHEAR = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON)), YOUNG / (2 * (1 + POISSON))
PENALTY = 16 * (LAMBDA + 2 * SHEAR)


def mesh(n):
    """Nodes and elements of a square core and four blocks around it."""
    s = np.linspace(-1, 1, n + 1)
    a = 0.45
    blocks = [np.stack(np.meshgrid(a * s, a * s, indexing="ij"), axis=-1)]
    t = np.linspace(0, 1, int(round(0.7 * n)) + 1)[:, None, None]
    inner = np.stack([a * np.ones_like(s), a * s], axis=-1)
    outer = np.stack([np.cos(np.pi / 4 * s), np.sin(np.pi / 4 * s)], axis=-1)
    block = inner * (1 - t) + outer * t
    for turn in range(4):
        c, d = [(1, 0), (0, 1), (-1, 0), (0, -1)][turn]
        blocks.append(block @ np.array([[c, d], [-d, c]], dtype=float))
    numbers, nodes, elements = {}, [], []
    for grid in blocks:
        ids = np.empty(grid.shape[:2], dtype=int)
        for i in np.ndindex(ids.shape):
            key = tuple(np.round(grid[i], 9) + 0.0)
            if key not in numbers:
                numbers[key] = len(nodes)
                nodes.append(grid[i])
            ids[i] = numbers[key]
        elements += [[ids[i, j], ids[i + 1, j], ids[i + 1, j + 1], ids[i, j + 1]] for i in range(ids.shape[0] - 1) for j in range(ids.shape[1] - 1)]
    return np.array(nodes), np.array(elements)


def run(n):
    x, elements = mesh(n)
    g = 1 / np.sqrt(3)
    points = [(-g, -g), (g, -g), (g, g), (-g, g)]
    gradients, weights = [], []
    mass = np.zeros(len(x))
    for xi, eta in points:
        value = 0.25 * np.array([(1 - xi) * (1 - eta), (1 + xi) * (1 - eta), (1 + xi) * (1 + eta), (1 - xi) * (1 + eta)])
        slope = 0.25 * np.array([[-(1 - eta), -(1 - xi)], [1 - eta, -(1 + xi)], [1 + eta, 1 + xi], [-(1 + eta), 1 - xi]])
        jacobian = np.einsum("eai,ak->eik", x[elements], slope)
        weight = np.linalg.det(jacobian)
        assert (weight > 0).all()
        gradients.append(np.einsum("ak,eki->eai", slope, np.linalg.inv(jacobian)))
        weights.append(weight)
        np.add.at(mass, elements, value * weight[:, None])
    rim = np.flatnonzero(np.abs(np.hypot(*x.T) - 1) < 1e-9)
    order = rim[np.argsort(np.arctan2(x[rim, 1], x[rim, 0]))]
    length = np.zeros(len(x))
    length[order] = np.pi * 2 / len(order)
    edge = min(np.linalg.norm(x[elements[:, i]] - x[elements[:, i - 1]], axis=1).min() for i in range(4))
    dt = 0.15 * edge / np.sqrt(LAMBDA + 2 * SHEAR)
    wall = x[:, 0].max() + 0.02
    u, v = np.zeros_like(x), np.tile([1.0, 0.0], (len(x), 1))
    total, first, last, largest, strain = mass.sum(), None, None, 0.0, 0.0
    time, force = 0.0, np.zeros_like(x)
    while last is None or time < last + 0.02:
        v += 0.5 * dt * force / mass[:, None]
        u += dt * v
        time += dt
        force, strain = np.zeros_like(x), 0.0
        for gradient, weight in zip(gradients, weights):
            f = np.eye(2) + np.einsum("eai,eak->eik", u[elements], gradient)
            j = f[:, 0, 0] * f[:, 1, 1] - f[:, 0, 1] * f[:, 1, 0]
            cofactor = np.stack([np.stack([f[:, 1, 1], -f[:, 1, 0]], -1), np.stack([-f[:, 0, 1], f[:, 0, 0]], -1)], -2)
            inverse = cofactor / j[:, None, None]
            stress = (0.5 * LAMBDA * (j * j - 1) - SHEAR)[:, None, None] * inverse + SHEAR * f
            np.add.at(force, elements, -np.einsum("eik,eak,e->eai", stress, gradient, weight))
            energy = 0.25 * LAMBDA * (j * j - 1) - (0.5 * LAMBDA + SHEAR) * np.log(j) + 0.5 * SHEAR * ((f * f).sum((1, 2)) - 2)
            strain += (energy * weight).sum()
        depth = np.maximum(x[:, 0] + u[:, 0] - wall, 0)
        push = PENALTY * length * depth
        force[:, 0] -= push
        v += 0.5 * dt * force / mass[:, None]
        if push.sum() > 0:
            first = first or time
            last = None
        elif first and last is None:
            last = time
        largest = max(largest, push.sum())
    return last - first, largest, -(mass * v[:, 0]).sum() / total, strain, total


if __name__ == "__main__":
    for n in map(int, sys.argv[1:]):
        duration, largest, rebound, strain, total = run(n)
        print(f"{n}: duration {duration:.5f}, largest force {largest:.4f}, rebound {rebound:.5f}, strain energy {strain:.5f}, mass {total:.5f}")
