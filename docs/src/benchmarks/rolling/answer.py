"""A rigid disc of radius R that rolls down an incline of the angle θ: acceleration ⅔ g sin θ of its centre, if tan θ ≤ 3 μ.

Gravity grows linearly from 0 to g in the time T, and stays. The point on the rim is farthest from the incline at t = 0.
"""

import math

G, THETA, RADIUS, RISE, END = 9.81, math.radians(20), 0.5, 0.2, 1.0
START = 0.17101

acceleration = G * math.sin(THETA) * 2 / 3


def way(t):
    if t <= RISE:
        return acceleration * t**3 / (6 * RISE)
    since = t - RISE
    return acceleration * (RISE**2 / 6 + RISE / 2 * since + since**2 / 2)


def rim(t):
    return START + way(t) * math.cos(THETA) + RADIUS * math.sin(THETA + way(t) / RADIUS)


KNOWN = {"way of the centre": way, "x of the point on the rim": rim}
POINTS = [i * END / 100 for i in range(101)]
