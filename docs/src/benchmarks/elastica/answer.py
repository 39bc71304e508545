"""The elastica: an inextensible cantilever without shear, with a force P at its end that keeps its direction (Bisshopp and Drucker).

With α² = P L²/(E I), the modulus k of the elliptic integrals follows from α = K(k) − F(φ, k), where sin φ = 1/(k √2). Then
the deflection is w/L = 1 − 2 (E(k) − E(φ, k))/α, and the end is at the distance 2 k cos φ/α of L from the clamp.
"""

import math


def integral(k, low, power, n=400):
    """∫ (1 − k² sin² φ)^power dφ from low to π/2, by Simpson's rule in the variable of which the integrand is smooth."""
    width = (math.pi / 2 - low) / (2 * n)
    value = lambda i: (1 - (k * math.sin(low + i * width)) ** 2) ** power
    inner = sum((4 if i % 2 else 2) * value(i) for i in range(1, 2 * n))
    return width / 3 * (value(0) + inner + value(2 * n))


def modulus(alpha):
    """Bisection: α grows with k from 0 at k² = 1/2."""
    low, high = math.sqrt(0.5), 1 - 1e-12
    for _ in range(60):
        k = (low + high) / 2
        grown = integral(k, math.asin(min(1.0, 1 / (k * math.sqrt(2)))), -0.5) < alpha
        low, high = (k, high) if grown else (low, k)
    return low


def end(load):
    """Deflection and shortening over L."""
    if load == 0:
        return 0.0, 0.0
    alpha = math.sqrt(load)
    k = modulus(alpha)
    phi = math.asin(min(1.0, 1 / (k * math.sqrt(2))))
    return 1 - 2 * integral(k, phi, 0.5) / alpha, 1 - 2 * k * math.cos(phi) / alpha


KNOWN = {"deflection of the end over L": lambda load: end(load)[0], "shortening over L": lambda load: end(load)[1]}
POINTS = [i * 0.25 for i in range(41)]
