"""Three ways to hold a body out of a rigid wall in an implicit dynamic solve, measured against each other.

An independent program (NumPy, dense matrices). Steps are Newmark's (beta = 1/4, gamma = 1/2) or generalised-alpha's with a spectral radius
of 0.5 at infinity; internal and contact forces are taken at the balance instant. A step makes one potential least (inertia, strain, contact)
by Newton's method, with halving until the potential or the residual falls; the residual is brought to 1e-8 of the reference force. With h
the size of an element and E Young's modulus, the contact is one of

    penalty  s      pressure = s E/h depth
    augmented s t   pressure = max(0, multiplier + s E/h depth); after each Newton solve the multiplier becomes the pressure, at most 30 times,
                    until depth <= t h and gap times pressure <= t h times the reference pressure; the next step starts from this multiplier
    barrier s d     energy per area -k (g - d h)^2 ln(g/(d h)) at gaps g between 0 and d h, with k such that the pressure at g = d h/2 is
                    s E/h g; a Newton step (and the first guess) goes at most 0.9 of the way to the wall; the body starts d h farther off, earlier

Bodies. `bar`: linear elements, linear elastic, E = 3e7, density 0.73, length 10, area 1, gap 0.01, speed 202.2; exactly, a force of 946,244
acts from 4.946e-5 to 3.1693e-3. `disc`: the disc of disc_on_wall.py (neo-Hookean; see there), touching at 0.02; the reference is that
program's answer with 48 elements: duration 0.20803, largest force 48.72, rebound 0.98540. Half a step per element and wave, consistent mass.

    python3 verification/reference/contact_forms.py bar 20 40 80
    python3 verification/reference/contact_forms.py disc 8              (`lumped` at the end: lumped mass)

Columns. solves: linear solves per step, averaged from first to last contact; worst: most in one step; cuts: halvings and capped steps in the
run; failed: steps in which Newton (60 solves) or the multipliers (30 updates) did not converge; impact, release: errors of the instants
at which the force first exceeds and last falls below 1 % of the reference, in % of the reference duration; force: error in % of the mean
force between 10 and 90 % of this duration after impact, and spread, the standard deviation there, in % (disc: error of the largest force,
no spread); gap: least gap over h at ends of steps, negative for depth; lost: fall of kinetic plus strain energy over the whole run, in %;
rebound: speed of the centre of mass over that before; excess: most by which kinetic plus strain plus contact energy (of the penalty, and of
the barrier where all gaps are positive) exceeds its start, in %, with * above 0.1.
"""

import sys
import time as clock
from types import SimpleNamespace

import numpy as np

import disc_on_wall as wall

SCHEMES = {"Newmark": (0.0, 0.5, 0.25), "gen-alpha": (1 / 3, 5 / 6, 4 / 9)}  # alpha_f, gamma, beta; alpha_m is 0 for both
FORMS = ([("penalty", s, 0) for s in (0.3, 1, 3, 10, 100)] + [("augmented", 1, 1e-3), ("augmented", 10, 1e-3), ("augmented", 10, 1e-6)]
         + [("barrier", s, d) for s in (1, 10) for d in (0.1, 0.3, 1)])


def bar(n, lumped):
    young, density, length, gap, speed = 3e7, 0.73, 10.0, 0.01, 202.2
    h, wave, mass, stiffness = length / n, np.sqrt(young / density), np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
    for e in range(n):
        mass[e:e + 2, e:e + 2] += density * h / 6 * (3 * np.eye(2) if lumped else np.array([[2, 1], [1, 2]]))
        stiffness[e:e + 2, e:e + 2] += young / h * np.array([[1, -1], [-1, 1]])
    force, duration = density * wave * speed, 2 * length / wave
    return SimpleNamespace(name=f"bar {n}", elastic=lambda u: (0.5 * u @ stiffness @ u, stiffness @ u, stiffness), mass=mass, h=h, young=young,
                           contact=np.array([n]), area=np.ones(1), gap=np.array([gap]), velocity=np.full(n + 1, speed), dt=0.5 * h / wave,
                           impact=gap / speed, duration=duration, end=1.5 * (gap / speed + duration), force=force, pressure=force, plateau=True)


def disc(n, lumped):
    x, elements = wall.mesh(n)
    lame, shear, size, g = wall.LAMBDA, wall.SHEAR, 2 * len(x), 1 / np.sqrt(3)
    index, operators, weights, scalar = (2 * elements[:, :, None] + np.arange(2)).reshape(-1, 8), [], [], np.zeros((len(x), len(x)))
    for xi, eta in [(-g, -g), (g, -g), (g, g), (-g, g)]:
        value = 0.25 * np.array([(1 - xi) * (1 - eta), (1 + xi) * (1 - eta), (1 + xi) * (1 + eta), (1 - xi) * (1 + eta)])
        slope = 0.25 * np.array([[-(1 - eta), -(1 - xi)], [1 - eta, -(1 + xi)], [1 + eta, 1 + xi], [-(1 + eta), 1 - xi]])
        jacobian = np.einsum("eai,ak->eik", x[elements], slope)
        weights.append(np.linalg.det(jacobian))
        gradient = np.einsum("ak,eki->eai", slope, np.linalg.inv(jacobian))
        operators.append(np.einsum("ij,eak->eikaj", np.eye(2), gradient).reshape(-1, 4, 8))  # from displacements to their gradient
        np.add.at(scalar, (elements[:, :, None], elements[:, None, :]), np.einsum("a,b,e->eab", value, value, weights[-1]))
    operator, weight, index = np.concatenate(operators), np.concatenate(weights), np.tile(index, (4, 1))
    back, pairs = operator.transpose(0, 2, 1), (index[:, :, None] * size + index[:, None, :]).ravel()

    def elastic(u):
        f = np.eye(2) + (operator @ u[index][:, :, None]).reshape(-1, 2, 2)
        j = np.linalg.det(f)
        if (j <= 0).any():
            return np.inf, np.zeros(size), np.zeros((size, size))
        v, a = np.linalg.inv(f).transpose(0, 2, 1), 0.5 * lame * (j * j - 1) - shear
        stress = (a[:, None, None] * v + shear * f) * weight[:, None, None]
        moduli = np.einsum("e,eik,ejl->eikjl", weight * lame * j * j, v, v) - np.einsum("e,eil,ejk->eikjl", weight * a, v, v)
        moduli = moduli.reshape(-1, 4, 4) + shear * weight[:, None, None] * np.eye(4)
        energy = (weight * (0.25 * lame * (j * j - 1) - (0.5 * lame + shear) * np.log(j) + 0.5 * shear * ((f * f).sum((1, 2)) - 2))).sum()
        return (energy, np.bincount(index.ravel(), (back @ stress.reshape(-1, 4, 1)).ravel(), size),
                np.bincount(pairs, (back @ (moduli @ operator)).ravel(), size * size).reshape(size, size))

    rim = np.flatnonzero((np.abs(np.hypot(*x.T) - 1) < 1e-9) & (x[:, 0] > 0.3))
    h, duration, largest = np.pi / (2 * n), 0.20803, 48.72
    mass = np.kron(np.diag(scalar.sum(1)) if lumped else scalar, np.eye(2))
    return SimpleNamespace(name=f"disc {n}", elastic=elastic, mass=mass, h=h, young=wall.YOUNG, contact=2 * rim, area=np.full(len(rim), h),
                           gap=1.02 - x[rim, 0], velocity=np.tile([1.0, 0.0], len(x)), dt=0.5 * h / np.sqrt(lame + 2 * shear),
                           impact=0.02, duration=duration, end=0.02 + 1.6 * duration, force=largest, pressure=largest, plateau=False)


def law(form, strength, d, gap, multiplier):
    """Energy, pressure and stiffness for each area."""
    if form == "barrier":
        g, log = np.clip(gap, 1e-300, d), np.log(np.clip(gap, 1e-300, d) / d)
        if (gap <= 0).any():
            return np.full_like(g, np.inf), 0 * g, 0 * g
        return -strength * (g - d) ** 2 * log, strength * (2 * (g - d) * log + (g - d) ** 2 / g), strength * (-2 * log - 4 * (g - d) / g + (1 - d / g) ** 2)
    pressure = np.maximum(0, multiplier - strength * gap)
    return pressure ** 2 / (2 * strength), pressure, strength * (pressure > 0)


def reach(form, gap, step):
    """The part of a step that the barrier allows."""
    return min(1.0, 0.9 * (gap[step > 0] / step[step > 0]).min()) if form == "barrier" and (step > 0).any() else 1.0


def newton(body, w, free, inertia, form, strength, d, far, multiplier):
    """The least potential from w on (without forces it is at `free`); also the pressure, the solves, the cuts, whether it failed."""
    def evaluate(w):
        energy, force, tangent = body.elastic(w)
        psi, pressure, stiffness = law(form, strength, d, far - w[body.contact], multiplier)
        push = inertia * body.mass @ (w - free)
        residual, tangent = push + force, tangent + inertia * body.mass
        residual[body.contact] += body.area * pressure
        tangent[body.contact, body.contact] += body.area * stiffness
        return 0.5 * push @ (w - free) + energy + body.area @ psi, residual, tangent, pressure

    (potential, residual, tangent, pressure), solves, cuts = evaluate(w), 0, 0
    while np.linalg.norm(residual) > 1e-8 * body.force and solves < 60:
        step, solves = -np.linalg.solve(tangent, residual), solves + 1
        t = reach(form, far - w[body.contact], step[body.contact])
        cuts, new = cuts + (t < 1), evaluate(w + t * step)
        while t > 1e-6 and not (new[0] <= potential + 1e-4 * t * residual @ step
                                or np.isfinite(new[0]) and np.linalg.norm(new[1]) < np.linalg.norm(residual)):
            t, cuts, new = 0.5 * t, cuts + 1, evaluate(w + 0.5 * t * step)
        w, (potential, residual, tangent, pressure) = w + t * step, new
    return w, pressure, solves, cuts, np.linalg.norm(residual) > 1e-8 * body.force


def march(body, scheme, form, s, d):
    """Times and forces at balance; solves, strain plus kinetic energies, all energies, least gaps of the steps; cuts, failures, last velocity."""
    (alpha, gamma, beta), dt, mass, contact, tolerance = SCHEMES[scheme], body.dt, body.mass, body.contact, d * body.h
    d = tolerance if form == "barrier" else 0.0
    strength = s * body.young / body.h / (2 * np.log(2) + 1 if form == "barrier" else 1)
    far, now, multiplier = body.gap + d, -d / body.velocity.max(), np.zeros(len(contact))
    u, v, a, w = 0 * body.velocity, body.velocity.copy(), 0 * body.velocity, 0 * body.velocity
    rows, cuts, failed = [], 0, 0
    while now < body.end:
        ahead = u + dt * v + dt ** 2 * (0.5 - beta) * a
        free = (1 - alpha) * ahead + alpha * u
        t = reach(form, far - w[contact], (free - w)[contact])
        w, cuts, solves, updates = w + t * (free - w), cuts + (t < 1), 0, 0
        while True:
            w, pressure, more, cut, bad = newton(body, w, free, 1 / ((1 - alpha) * beta * dt ** 2), form, strength, d, far, multiplier)
            gap, solves, cuts = far - w[contact], solves + more, cuts + cut
            multiplier = pressure if form == "augmented" else multiplier
            open_ = gap.min() < -tolerance or (np.maximum(gap, 0) * pressure).max() > tolerance * body.pressure
            if form != "augmented" or not open_ or updates == 30:
                break
            updates += 1
        failed += bad or form == "augmented" and open_
        new = (w - alpha * u) / (1 - alpha)
        after = (new - ahead) / (beta * dt ** 2)
        u, v, a = new, v + dt * ((1 - gamma) * a + gamma * after), after
        energy, gap = 0.5 * v @ mass @ v + body.elastic(u)[0], far - u[contact]
        stored = 0.0 if form == "augmented" else body.area @ law(form, strength, d, gap, 0)[0]
        rows.append((now + (1 - alpha) * dt, body.area @ pressure, solves, energy, energy + (stored if np.isfinite(stored) else 0), gap.min()))
        now += dt
    return *np.array(rows).T, cuts, failed, v


def report(body, scheme, form, s, d):
    times, forces, solves, energies, totals, gaps, cuts, failed, v = march(body, scheme, form, s, d)
    start, level, end = 0.5 * body.velocity @ body.mass @ body.velocity, 0.01 * body.force, body.impact + body.duration
    on = np.flatnonzero(forces > level)
    i, k = max(on[0], 1), min(on[-1], len(forces) - 2)
    impact, release = (times[m] + body.dt * (level - forces[m]) / (forces[m + 1] - forces[m]) for m in (i - 1, k))
    middle = forces[(times > impact + 0.1 * body.duration) & (times < impact + 0.9 * body.duration)]
    force, spread = (middle.mean(), f"{100 * middle.std() / body.force:.2f}") if body.plateau else (forces.max(), "")
    rebound, excess = -(body.velocity @ body.mass @ v) / (2 * start), 100 * (totals.max() / start - 1)
    print(f"| {body.name} | {scheme} | {form} {s}{f', {d:g}' if d else ''} | {solves[i:k + 1].mean():.2f} | {solves.max():.0f} | {cuts} | {failed} "
          f"| {100 * (impact - body.impact) / body.duration:.2f} | {100 * (release - end) / body.duration:.2f} | {100 * (force / body.force - 1):.2f} "
          f"| {spread} | {gaps.min() / body.h:.5f} | {100 * (1 - energies[-1] / start):.3f} | {rebound:.4f} | {excess:.3f}{'*' if excess > 0.1 else ''} |", flush=True)


if __name__ == "__main__":
    free, lumped = bar(80, "lumped" in sys.argv), "lumped" in sys.argv
    free.velocity, free.gap = 202.2 * np.linspace(-1, 1, 81) ** 3, np.array([1e9])
    energies = march(free, "Newmark", "penalty", 1, 0)[3]
    print(f"Check, bar in free vibration by Newmark: energy constant to {np.ptp(energies) / energies[0]:.1e}\n\n| body | scheme | contact | solves | worst "
          "| cuts | failed | impact | release | force | spread | gap | lost | rebound | excess |\n" + "|---" * 15 + "|")
    for n in map(int, filter(str.isdigit, sys.argv)):
        for scheme in SCHEMES:
            for form in FORMS:
                report({"bar": bar, "disc": disc}[sys.argv[1]](n, lumped), scheme, *form)
    print(f"\n{clock.process_time():.0f} s of processor time")
