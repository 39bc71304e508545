"""A tube with the radii a and b under the pressure p in the hole, in plane strain, of a metal without hardening (Hill), at small strain.

The tube yields between a and c, with p = Y/2 (2 ln(c/a) + 1 − c²/b²) and Y = 2 σ_y/√3. Outside c it is elastic, and the outer surface moves by
(1 − ν²) Y c²/(E b). Below the pressure at which the hole yields, this is Lamé's 2 (1 − ν²) p a² b/(E (b² − a²)).
"""

import math

E, NU, YIELD, INNER, OUTER, LARGEST = 21000.0, 0.4999, 0.24, 100.0, 200.0, 0.18

flow = 2 * YIELD / math.sqrt(3)


def pressure(front):
    return flow / 2 * (2 * math.log(front / INNER) + 1 - (front / OUTER) ** 2)


def front(p):
    """c by bisection: the pressure grows with it up to the outer surface."""
    low, high = INNER, OUTER
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if pressure(middle) < p else (low, middle)
    return low


def widening(p):
    if p <= pressure(INNER):
        return 2 * (1 - NU**2) * p * INNER**2 * OUTER / (E * (OUTER**2 - INNER**2))
    return (1 - NU**2) * flow * front(p) ** 2 / (E * OUTER)


KNOWN = {"widening of the outside": widening}
POINTS = [i * LARGEST / 90 for i in range(91)]
