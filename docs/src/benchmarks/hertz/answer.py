"""Hertz's contact along a line: a rigid cylinder of radius R on an elastic half-space, with the force F per length.

Half width b = √(4 F R/(π E*)), largest pressure p₀ = √(F E*/(π R)), with E* = E/(1 − ν²).
"""

import math

E, NU, RADIUS, LARGEST = 1000.0, 0.3, 10.0, 27.0

plane = E / (1 - NU**2)

KNOWN = {
    "half width of the contact": lambda force: math.sqrt(4 * force * RADIUS / (math.pi * plane)),
    "largest pressure": lambda force: math.sqrt(force * plane / (math.pi * RADIUS)),
}
POINTS = [LARGEST * (i / 60) ** 2 for i in range(61)]
