"""The limit load of a strip footing on weightless clay of the cohesion c: F/(B c) = 2 + π (Prandtl). The way to the limit is not known."""

import math

LIMIT, LAST = 4.0, 5.0


def factor(settlement):
    return 2 + math.pi if settlement > LIMIT - 1e-9 else None


KNOWN = {"bearing factor": factor}
POINTS = [LIMIT, LAST]
