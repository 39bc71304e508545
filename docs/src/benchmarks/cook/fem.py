"""Cook's membrane by nine-node finite elements of scikit-fem, an independent program: writes the table of answer.py.

    python fem.py 8 16 32 64        (needs scikit-fem 12 and SciPy)

Total Lagrangian, the law W = Λ/4 (J² − 1) − Λ/2 ln J − G ln J + G/2 (tr C − 3), plane strain, Newton's method to a residual of 1e-11 N/mm.
"""

import sys

import numpy as np
from skfem import Basis, BilinearForm, ElementQuad2, ElementVector, FacetBasis, LinearForm, MeshQuad, condense, solve
from skfem.helpers import ddot, grad, identity, inv, transpose

E, NU, TRACTION = 1.0985, 0.3, 0.0625
LAMBDA, SHEAR = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
LOADS = [0.25, 0.5, 0.75, 1.0]


def mul(a, b):
    return np.einsum("ij...,jk...->ik...", a, b)


def kinematics(w):
    F = grad(w["u"]) + identity(grad(w["u"]))
    J = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
    return F, J, transpose(inv(F))


@LinearForm
def internal(v, w):
    """P = G (F − F⁻ᵀ) + Λ/2 (J² − 1) F⁻ᵀ"""
    F, J, G = kinematics(w)
    return ddot(SHEAR * (F - G) + LAMBDA / 2 * (J**2 - 1) * G, grad(v))


@BilinearForm
def tangent(u, v, w):
    """δP = G δF + (G − Λ/2 (J² − 1)) F⁻ᵀ δFᵀ F⁻ᵀ + Λ J² (F⁻ᵀ : δF) F⁻ᵀ"""
    _, J, G = kinematics(w)
    dF = grad(u)
    turned = mul(mul(G, transpose(dF)), G)
    return ddot(SHEAR * dF + (SHEAR - LAMBDA / 2 * (J**2 - 1)) * turned + LAMBDA * J**2 * ddot(G, dF) * G, grad(v))


@LinearForm
def load(v, w):
    return TRACTION * v[1]


def membrane(cells):
    mesh = MeshQuad.init_tensor(np.linspace(0, 1, cells + 1), np.linspace(0, 1, cells + 1))
    s, t = mesh.p
    return MeshQuad(np.array([48 * s, (1 - s) * 44 * t + s * (44 + 16 * t)]), mesh.t)


def tip(cells):
    """The displacement of (48, 52) at each load."""
    mesh = membrane(cells)
    basis = Basis(mesh, ElementVector(ElementQuad2()), intorder=6)
    right = FacetBasis(mesh, basis.elem, facets=mesh.facets_satisfying(lambda x: np.isclose(x[0], 48)), intorder=6)
    held = basis.get_dofs(lambda x: np.isclose(x[0], 0)).all()
    force, u, found = load.assemble(right), basis.zeros(), []
    free = basis.complement_dofs(held)
    place = np.nonzero(np.isclose(basis.doflocs[0], 48) & np.isclose(basis.doflocs[1], 52))[0]
    for factor in LOADS:
        for _ in range(30):
            at = basis.interpolate(u)
            residual = factor * force - internal.assemble(basis, u=at)
            if np.linalg.norm(residual[free]) < 1e-11:
                break
            u = u + solve(*condense(tangent.assemble(basis, u=at), residual, D=held))
        else:
            raise RuntimeError("Newton's method did not converge")
        found.append(u[place])
    return found


for cells in map(int, sys.argv[1:]):
    print(cells, [[round(float(c), 6) for c in u] for u in tip(cells)], flush=True)
