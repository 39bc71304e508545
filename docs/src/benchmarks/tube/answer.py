"""A tube with the radii a and b of incompressible neo-Hookean rubber, in plane strain, under the pressure p in the hole.

The volume does not change: λ_b² = 1 + (a²/b²)(λ_a² − 1) with the stretches λ = r/R of the radii. Equilibrium gives
p = G (ln(λ_a/λ_b) + (λ_a² − λ_b²)/(2 λ_a² λ_b²)), which grows with λ_a. Bisection inverts it.
"""

import math

SHEAR, INNER, OUTER, LARGEST = 1.0, 10.0, 20.0, 0.45


def outside(stretch):
    return math.sqrt(1 + (INNER / OUTER) ** 2 * (stretch**2 - 1))


def pressure(stretch):
    a, b = stretch, outside(stretch)
    return SHEAR * (math.log(a / b) + (a**2 - b**2) / (2 * a**2 * b**2))


def stretch(p):
    low, high = 1.0, 10.0
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if pressure(middle) < p else (low, middle)
    return low


KNOWN = {
    "widening of the hole": lambda p: INNER * (stretch(p) - 1),
    "widening of the outside": lambda p: OUTER * (outside(stretch(p)) - 1),
}
POINTS = [i * LARGEST / 45 for i in range(46)]
