"""Cook's membrane by nine-node finite elements: the displacement of (48, 52) from fem.py, extrapolated.

The stress is singular at the clamped corner, so the error falls with a low power of the element size. Three sizes, each half of the one
before, give that power and the limit (Richardson's extrapolation, as Aitken's formula).
"""

LOADS = [0.25, 0.5, 0.75, 1.0]

# python fem.py 16 32 64, with scikit-fem 12.0.2: elements an edge, and (x, y) of the displacement at each load.
ELEMENTS = {
    16: [(-2.320593, 4.617415), (-4.699619, 8.507227), (-6.991443, 11.75922), (-9.124429, 14.496915)],
    32: [(-2.322508, 4.62028), (-4.703162, 8.512061), (-6.996288, 11.765509), (-9.130351, 14.50447)],
    64: [(-2.323295, 4.62143), (-4.704628, 8.514012), (-6.998293, 11.76805), (-9.132788, 14.50752)],
}


def extrapolated(coarse, middle, fine):
    return fine + (fine - middle) ** 2 / ((middle - coarse) - (fine - middle))


def at_load(axis, sign):
    """A function of the load, known at the four loads and at rest."""
    table = {0.0: 0.0}
    for i, load in enumerate(LOADS):
        table[load] = sign * extrapolated(*(ELEMENTS[n][i][axis] for n in (16, 32, 64)))
    return lambda load: table.get(round(load, 9))


KNOWN = {"deflection of the edge": at_load(1, 1), "inward motion of the edge": at_load(0, -1)}
POINTS = [0.0] + LOADS
