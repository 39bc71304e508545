"""Two equal elastic bars of length L meet with the velocities ±v: d'Alembert's waves of small strains.

The contact lasts 2 L/c, with c = √(E/ρ) and the constant force ρ c v A. Meanwhile a wave runs to each free end and back. Material that a
wave has met once is at rest, and material that it has met twice moves backwards with v.
"""

import math

E, RHO, LENGTH, AREA = 1e7, 1000.0, 1.0, 1.0
SPEED, GAP, END = 0.05, 2e-4, 0.03

c = math.sqrt(E / RHO)
start = GAP / (2 * SPEED)
duration = 2 * LENGTH / c
energy = RHO * AREA * LENGTH * SPEED**2


def force(t):
    return RHO * c * SPEED * AREA if start < t < start + duration else 0.0


def kinetic_energy(t):
    since = min(max(t - start, 0.0), duration)
    return energy * abs(1 - since * c / LENGTH)


KNOWN = {"kinetic energy": kinetic_energy, "contact force": force}
corners = [start * (1 - 1e-9), start * (1 + 1e-9), start + duration / 2]
corners += [(start + duration) * (1 - 1e-9), (start + duration) * (1 + 1e-9)]
POINTS = sorted([i * END / 60 for i in range(61)] + corners)
