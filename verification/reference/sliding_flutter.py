"""Flutter of an elastic block that slides on a rigid floor with Coulomb friction: growth rates of its linear vibrations.

Plane strain, bilinear elements, consistent mass, penalty k = s min(L + 2G, 4G)/h per area as in bfree. In full slip in the direction +x, the contact
at a node of the floor with the area A has the forces f_y = -k A u_y and f_x = -mu p A = mu k A u_y. The second one makes the stiffness unsymmetric:
M u'' + B u' + (K + C) u = 0 can have solutions that grow, in the continuum as in any discretisation. B = beta K is material damping.

    python3 sliding_flutter.py
"""
import numpy as np
from scipy.linalg import eig, solve

YOUNG, POISSON, DENSITY = 1e7, 0.3, 1000.0
LENGTH, HEIGHT = 1.0, 0.5
SPACING = 0.125  # of bfree's grid, which scales the penalty


def element(a, b):
    """Stiffness and mass of a rectangle a x b in plane strain, by 2 x 2 Gauss points."""
    lam = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    shear = YOUNG / (2 * (1 + POISSON))
    law = np.array([[lam + 2 * shear, lam, 0], [lam, lam + 2 * shear, 0], [0, 0, shear]])
    stiffness, mass = np.zeros((8, 8)), np.zeros((8, 8))
    corner = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    for x in (-1, 1):
        for y in (-1, 1):
            at = np.array([x, y]) / np.sqrt(3)
            n = (1 + corner[:, 0] * at[0]) * (1 + corner[:, 1] * at[1]) / 4
            dx = corner[:, 0] * (1 + corner[:, 1] * at[1]) / 4 * 2 / a
            dy = corner[:, 1] * (1 + corner[:, 0] * at[0]) / 4 * 2 / b
            strain = np.zeros((3, 8))
            strain[0, 0::2], strain[1, 1::2] = dx, dy
            strain[2, 0::2], strain[2, 1::2] = dy, dx
            stiffness += strain.T @ law @ strain * a * b / 4
            mass += DENSITY * np.kron(np.outer(n, n), np.eye(2)) * a * b / 4
    return stiffness, mass


def growth(friction, stiffness, cells, damping=0.0):
    """The largest growth rate of a vibration in 1/s, and its angular frequency."""
    rows = cells // 2
    a, b = LENGTH / cells, HEIGHT / rows
    node = lambda i, j: j * (cells + 1) + i
    size = 2 * (cells + 1) * (rows + 1)
    k, m, c = np.zeros((size, size)), np.zeros((size, size)), np.zeros((size, size))
    of_element, mass = element(a, b)
    for i in range(cells):
        for j in range(rows):
            nodes = [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)]
            dofs = [2 * n + d for n in nodes for d in (0, 1)]
            k[np.ix_(dofs, dofs)] += of_element
            m[np.ix_(dofs, dofs)] += mass
    lam, shear = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON)), YOUNG / (2 * (1 + POISSON))
    penalty = stiffness * min(lam + 2 * shear, 4 * shear) / SPACING
    for i in range(cells + 1):
        area = a * (0.5 if i in (0, cells) else 1.0)
        x, y = 2 * node(i, 0), 2 * node(i, 0) + 1
        c[y, y] += penalty * area
        c[x, y] -= friction * penalty * area
    inverse = lambda matrix: solve(m, matrix, assume_a="pos")
    if damping == 0:
        rates = np.sqrt(-eig(inverse(k + c), right=False).astype(complex))
        rates = np.where(rates.real < 0, -rates, rates)
    else:
        zero, one = np.zeros_like(k), np.eye(size)
        rates = eig(np.block([[zero, one], [-inverse(k + c), -inverse(damping * k)]]), right=False)
    # The free slide along the floor is no vibration.
    rates = rates[np.abs(rates.imag) > 1]
    worst = rates[np.argmax(rates.real)]
    return worst.real, abs(worst.imag)


if __name__ == "__main__":
    print("growth 1/s, frequency 1/s")
    for friction in (0.2, 0.4, 0.58):
        for cells in (8, 16):
            print(f"mu {friction}, s = 1, {cells} cells: %.1f at %.0f" % growth(friction, 1.0, cells))
    for stiffness in (1.0, 0.3, 0.1, 0.03):
        print(f"mu 0.58, s = {stiffness}, 16 cells: %.1f at %.0f" % growth(0.58, stiffness, 16))
    for damping in (1e-4, 3e-4, 1e-3):
        for friction in (0.2, 0.58):
            print(f"mu {friction}, s = 1, 8 cells, beta = {damping}: %.2f at %.0f" % growth(friction, 1.0, 8, damping))
