"""A bar of length L, fixed at X = 0 and free at X = L, feels the acceleration g along the bar from t = 0 on: u_tt = c² u_xx + g.

Motion and force have the period 4 L/c of the first eigenfrequency c/(4 L). The acceleration of the free end is g, −g, −g, g in the four
quarters. The force at the fixed end grows by ρ g c A in time, to twice the weight at 2 L/c, and falls back.
"""

import math

E, RHO, LENGTH, AREA, G, END = 1e7, 1000.0, 1.0, 1.0, 0.1, 0.08

c = math.sqrt(E / RHO)
quarter = LENGTH / c


def displacement(t):
    since = math.fmod(t, 4 * quarter)
    if since > 2 * quarter:
        since = 4 * quarter - since
    if since <= quarter:
        return G * since**2 / 2
    return G * quarter**2 - G * (2 * quarter - since) ** 2 / 2


def force(t):
    since = math.fmod(t, 4 * quarter)
    return RHO * G * c * AREA * min(since, 4 * quarter - since)


KNOWN = {"displacement of the end": displacement, "force at the fixed end": force}
POINTS = [i * END / 160 for i in range(161)]
