"""A column of height L under its weight, in uniaxial strain, at finite strain.

The law is W = Λ/4 (J² − 1) − Λ/2 ln J − G ln J + G/2 (tr C − 3). With the stretch F along the column, the stress along it is P = M (F − 1/F)
with M = Λ/2 + G. Equilibrium at the distance s below the top, P = −ρ g s, gives F = (√(q² + 4) − q)/2 with q = ρ g s/M. The stress on the side
walls is Λ/2 (F² − 1) = −Λ/2 q F per reference area.
"""

import math

LAMBDA, SHEAR, RHO, HEIGHT, LARGEST = 5e4, 3e4, 2700.0, 1.0, 29.43

modulus = LAMBDA / 2 + SHEAR


def settlement(g):
    """∫ (1 − F) ds"""
    q = RHO * g * HEIGHT / modulus
    if q == 0:
        return 0.0
    integral = -(q**2) / 4 + q / 4 * math.sqrt(q**2 + 4) + math.asinh(q / 2)
    return HEIGHT * (1 - integral / q)


def wall_force(g):
    """∫ Λ/2 q F ds, per unit of thickness"""
    q = RHO * g * HEIGHT / modulus
    if q == 0:
        return 0.0
    integral = ((q**2 + 4) ** 1.5 - 8 - q**3) / 6
    return LAMBDA / 2 * HEIGHT * integral / q


KNOWN = {"settlement of the top": settlement, "force on a side wall": wall_force}
POINTS = [i * LARGEST / 40 for i in range(41)]
