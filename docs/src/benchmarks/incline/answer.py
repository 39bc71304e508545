"""A rigid block on an incline of the angle θ with the friction coefficient μ < tan θ: acceleration g (sin θ − μ cos θ).

Gravity grows linearly from 0 to g in the time T, and stays.
"""

import math

G, THETA, FRICTION, RISE, END = 10.0, math.radians(45), 0.2, 0.1, 0.8

acceleration = G * (math.sin(THETA) - FRICTION * math.cos(THETA))


def way(t):
    if t <= RISE:
        return acceleration * t**3 / (6 * RISE)
    since = t - RISE
    return acceleration * (RISE**2 / 6 + RISE / 2 * since + since**2 / 2)


KNOWN = {"way of the centre": way}
POINTS = [i * END / 80 for i in range(81)]
