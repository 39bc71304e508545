"""The check of tangents from Python: consistent laws pass, planted mistakes are found and named, and wrong calls get a sentence."""

import json
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
import tangent_check as tc
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, aslinearoperator

pytest_plugins = ["pytester"]
ROOT = Path(__file__).resolve().parents[3]
I = np.eye(3)
MU, LAME = 1.0, 4.0
SYMMETRIC = (np.einsum("ik,jl->ijkl", I, I) + np.einsum("il,jk->ijkl", I, I)) / 2
VOIGT = ([0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1])


def dyad(a, b):
    return np.einsum("ij,kl->ijkl", a, b)


def piola(F):
    G = np.linalg.inv(F).T
    return MU * (F - G) + LAME * np.log(np.linalg.det(F)) * G


def piola_tangent(F):
    G = np.linalg.inv(F).T
    exchanged = np.einsum("iL,kJ->iJkL", G, G)
    return MU * np.einsum("ik,JL->iJkL", I, I) + LAME * dyad(G, G) + (MU - LAME * np.log(np.linalg.det(F))) * exchanged


def kirchhoff(F):
    return MU * (F @ F.T - I) + LAME * np.log(np.linalg.det(F)) * I


def cauchy(F):
    return kirchhoff(F) / np.linalg.det(F)


def second_piola(F):
    return np.linalg.solve(F, piola(F))


def material_tangent(F):
    D = np.linalg.inv(F.T @ F)
    odot = (np.einsum("ik,jl->ijkl", D, D) + np.einsum("il,jk->ijkl", D, D)) / 2
    return LAME * dyad(D, D) + 2 * (MU - LAME * np.log(np.linalg.det(F))) * odot


def truesdell(F):
    J = np.linalg.det(F)
    return (LAME * dyad(I, I) + 2 * (MU - LAME * np.log(J)) * SYMMETRIC) / J


def jaumann_kirchhoff(F):
    s = cauchy(F)
    H = np.einsum("ik,jl->ijkl", I, s) + np.einsum("il,jk->ijkl", I, s)
    H = (H + H.transpose(1, 0, 2, 3)) / 2
    return truesdell(F) + H


def kirchhoff_gradient(F):
    G = np.linalg.inv(F).T
    return MU * (np.einsum("ik,jL->ijkL", I, F) + np.einsum("iL,jk->ijkL", F, I)) + LAME * dyad(I, G)


CONVENTIONS = {
    "piola": (piola, piola_tangent),
    "second_piola": (second_piola, material_tangent),
    "truesdell": (cauchy, truesdell),
    "abaqus": (cauchy, jaumann_kirchhoff),
    "jaumann_cauchy": (cauchy, lambda F: jaumann_kirchhoff(F) - dyad(cauchy(F), I)),
    "kirchhoff_gradient": (kirchhoff, kirchhoff_gradient),
    "cauchy_gradient": (
        cauchy,
        lambda F: kirchhoff_gradient(F) / np.linalg.det(F) - dyad(cauchy(F), np.linalg.inv(F).T),
    ),
}


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_each_convention_has_its_right_tangent_and_no_other(convention):
    stress, tangent = CONVENTIONS[convention]
    report = tc.check_law(stress, tangent, convention=convention)
    report.assert_consistent()
    assert report.verdict == "consistent" and report.ok and len(report.findings) == 46
    assert all(finding.calls <= 300 and finding.control <= 1e-8 for finding in report.findings)
    # Parts of one entry: below and above 1e-6 of the law.
    for part, verdict in [(1e-7, "inexact"), (1e-5, "wrong")]:
        spoiled = np.ones((3, 3, 3, 3))
        spoiled[0, 0, 1, 1] += part
        assert tc.check_law(stress, lambda F: spoiled * tangent(F), convention=convention).verdict == verdict


def test_vectors_in_any_order_are_tensors():
    vector = lambda s: s[VOIGT]
    matrix = lambda C: C[VOIGT][:, VOIGT[0], VOIGT[1]]
    tc.check_law(
        lambda F: vector(cauchy(F)), lambda F: matrix(truesdell(F)), convention="truesdell"
    ).assert_consistent()
    for order in ("voigt", "abaqus", "explicit", "mfront"):
        tc.check_law(cauchy, truesdell, convention="truesdell", order=order).assert_consistent()
    report = tc.check_law(
        lambda F: vector(cauchy(F)), lambda F: matrix(truesdell(F)), convention="truesdell", order="abaqus"
    )
    assert report.verdict == "wrong"
    # The axes of one quadrature point.
    tc.check_law(
        lambda F: piola(F)[..., None, None], lambda F: piola_tangent(F).reshape(9, 9, 1, 1)
    ).assert_consistent()


def test_two_dimensions():
    def whole(F):
        assert F.shape == (2, 2)
        return np.block([[F, np.zeros((2, 1))], [np.zeros((1, 2)), np.ones((1, 1))]])

    cut = lambda function: lambda F: function(whole(F))[(slice(2),) * (2 if function in (piola, cauchy) else 4)]
    tc.check_law(cut(piola), cut(piola_tangent), dimension=2).assert_consistent()
    tc.check_law(cut(cauchy), cut(truesdell), convention="truesdell", dimension=2).assert_consistent()
    report = tc.check_law(cut(piola), lambda F: -cut(piola_tangent)(F), dimension=2)
    assert report.verdict == "wrong"
    assert "opposite sign" in str(report.diagnoses[0])


@pytest.mark.parametrize(
    "mistake, words",
    [
        (lambda F: piola_tangent(F).transpose(1, 0, 3, 2), "indices ij and ji exchanged"),
        (lambda F: piola_tangent(F) - np.einsum("ik,JL->iJkL", I, second_piola(F)), "geometric part with the stress missing"),
        (lambda F: 0.5 * piola_tangent(F), "times 0.5"),
    ],
)
def test_mistakes_are_named(mistake, words):
    report = tc.check_law(piola, mistake)
    assert report.verdict == "wrong" and not report.ok
    (diagnosis,) = report.diagnoses
    assert words in str(diagnosis) == diagnosis.sentence and diagnosis.candidates == [diagnosis.sentence]
    assert diagnosis.states_that_tell == []


def j2(step, algorithmic=True):
    """Radial return with linear hardening; the stress turns with the step."""
    bulk, shear, yield_stress, hardening = 160.0, 80.0, 0.5, 10.0
    (plastic,) = step.state
    elastic = (bulk - 2 * shear / 3) * dyad(I, I) + 2 * shear * SYMMETRIC
    trial = step.rotation @ step.stress @ step.rotation.T + np.einsum("ijkl,kl", elastic, step.strain_increment)
    deviator = trial - np.trace(trial) / 3 * I
    size = np.linalg.norm(deviator)
    mises = np.sqrt(1.5) * size
    over = mises - yield_stress - hardening * plastic
    if over <= 0:
        return trial, elastic, [plastic]
    flow = over / (3 * shear + hardening)
    n = deviator / size
    stress = trial - np.sqrt(6) * shear * flow * n
    tangent = elastic - 6 * shear**2 * (
        flow / mises * (SYMMETRIC - dyad(I, I) / 3) + (1 / (3 * shear + hardening) - flow / mises) * dyad(n, n)
    )
    return stress, tangent if algorithmic else elastic, [plastic + flow]


def test_a_law_with_memory():
    report = tc.check_law(j2, convention="cauchy_strain", state=[0])
    report.assert_consistent()
    assert report.subject == "j2" and len(report.findings) > 70
    # Paths that yield are made by the check, and a state on the yield surface is a kink.
    assert any("yielding" in finding.name for finding in report.findings)
    assert {finding.reason for finding in report.findings} <= {None, "kink"}
    wrong = tc.check_law(lambda step: j2(step, algorithmic=False), convention="cauchy_strain", state=[0])
    assert wrong.verdict == "wrong" and "elastic" in str(wrong.diagnoses[0])


def test_what_a_step_holds():
    steps = []

    def law(step):
        steps.append(step)
        return piola(step.F), piola_tangent(step.F), step.state + step.dt

    shear = [[1, 0.2, 0], [0, 1, 0], [0, 0, 1]]
    turned = [[0, -1, 0], [1, 0, 0], [0, 0, 1]] @ np.array(shear)
    tc.check_law(law, state=[3.0], states={"shear and turn": [shear, turned]}, dt=0.25).assert_consistent()
    first = steps[0]
    assert (first.F == shear).all() and (first.F_before == I).all() and first.time == 0 and first.dt == 0.25 and first.number == 1
    second = next(step for step in steps if step.number == 2)
    assert (second.F == turned).all() and (second.F_before == shear).all() and second.time == 0.25
    assert second.state == [3.25] and np.allclose(second.stress, piola(np.array(shear)))
    assert np.allclose(second.rotation, [[0, -1, 0], [1, 0, 0], [0, 0, 1]]) and np.allclose(second.strain_increment, 0)
    assert second.strain.shape == (3, 3)
    with pytest.raises(ValueError, match="read-only"):
        first.state[0] = 1


def test_own_states():
    tc.check_law(step_law).assert_consistent()
    report = tc.check_law(piola, piola_tangent, states=[1.1 * I, [1.1 * I, 1.2 * I]])
    assert [finding.name for finding in report.findings] == [
        "state 1, step 1 of 1",
        "state 2, step 1 of 2",
        "state 2, step 2 of 2",
    ]
    refused = tc.check_law(piola, piola_tangent, states={"inside out": -I, "stretched": 1.1 * I})
    assert refused.verdict == "not checked" and "det F is not positive" in refused.findings[0].sentence
    with pytest.raises(ValueError, match=r"bad: F has the shape \(2, 3\); it must be \(3, 3\), or \(n, 3, 3\) for n steps"):
        tc.check_law(piola, piola_tangent, states={"bad": np.ones((2, 3))})
    assert tc.check_law(piola, piola_tangent, states=[]).verdict == "not checked"


def step_law(step):
    return piola(step.F), piola_tangent(step.F)


@pytest.mark.parametrize(
    "stress, tangent, options, sentence",
    [
        (lambda F: piola(F)[:2], piola_tangent, {}, "the stress has the shape (2, 3); the convention 'piola' needs (3, 3) or (9,)"),
        (piola, piola, {}, "the tangent has the shape (3, 3); the convention 'piola' needs (9, 9) or (3, 3, 3, 3)"),
        (lambda step: piola(step.F), None, {}, "the law must return (stress, tangent) or (stress, tangent, state), not ndarray"),
        (step_law, None, {"state": [1]}, "the law returned 0 internal variables; `state` has 1"),
        (piola, piola_tangent, {"state": [1]}, "a law with internal variables is one function"),
        (piola, piola_tangent, {"convention": "truesdell"}, "the stress must be symmetric"),
        (cauchy, piola_tangent, {"convention": "truesdell"}, "the tangent must be symmetric in the two indices of the stress"),
        (piola, piola_tangent, {"convention": "cauchy"}, 'no convention "cauchy"; allowed are "piola", "second_piola"'),
        (piola, piola_tangent, {"order": "voight"}, 'no order "voight" of components; allowed are "voigt"'),
        (piola, piola_tangent, {"dimension": 1}, "dimension = 1: 2 and 3 are allowed"),
        (lambda F: piola(F) + 0j, piola_tangent, {}, "complex numbers"),
    ],
)
def test_wrong_calls_get_a_sentence(stress, tangent, options, sentence):
    with pytest.raises((TypeError, ValueError)) as error:
        tc.check_law(stress, tangent, **options)
    assert sentence in str(error.value)


def test_exceptions():
    def fragile(F):
        if np.linalg.det(F) > 1.5:
            raise RuntimeError("J is too large")
        return piola(F)

    report = tc.check_law(fragile, piola_tangent)
    assert report.verdict == "not checked" and not report.ok
    failed = [finding for finding in report.findings if finding.reason == "call failed"]
    assert 0 < len(failed) < len(report.findings)
    assert "RuntimeError: J is too large (test_check.py, line " in failed[0].sentence
    assert isinstance(report.exception, RuntimeError)
    with pytest.raises(AssertionError, match="RuntimeError: J is") as error:
        report.assert_consistent()
    assert error.value.__cause__ is report.exception

    def broken(F):
        return 1 / 0

    with pytest.raises(ZeroDivisionError) as error:
        tc.check_law(broken, piola_tangent)
    assert error.traceback[-1].name == "broken"

    for function in (lambda F: interrupt() if np.linalg.det(F) > 1.5 else piola(F), lambda F: interrupt()):

        def interrupt():
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            tc.check_law(function, piola_tangent)

    assert tc.check_law(lambda F: np.nan * F, piola_tangent).verdict == "not checked"
    assert tc.check_law(lambda F: 0 * F, lambda F: np.zeros((9, 9))).verdict == "not checked"


def test_reports():
    report = tc.check_law(piola, lambda F: piola_tangent(F).transpose(1, 0, 3, 2), name="my law", seed=7)
    assert str(report).startswith("Tangent check of my law\n") and "Diagnosis: Your tangent" in str(report)
    assert repr(report) == "<tangent check of my law: wrong, 46 findings>"
    assert report.subject == "my law" and report.seed == 7 and "rows 11, 12, 13" in report.convention and report.notes
    assert report.exit_code() == 1 and report.exception is None
    written = json.loads(report.to_json())
    assert written["verdict"] == "wrong" and len(written["findings"]) == 46
    assert ElementTree.fromstring(report.to_junit().encode()).find(".//failure") is not None
    sarif = json.loads(report.to_sarif("mine.py"))
    assert sarif["version"] == "2.1.0" and "mine.py" in report.to_sarif("mine.py")
    assert report.to_github("mine.py").startswith("::error file=mine.py")
    assert report._repr_markdown_() == report.to_markdown() and "| " in report.to_markdown()
    again = tc.check_law(piola, lambda F: piola_tangent(F).transpose(1, 0, 3, 2), name="my law", seed=7)
    assert again.to_json() == report.to_json()
    finding = report.findings[4]
    assert finding.claimed.shape == finding.measured.shape == finding.errors.shape == (9, 9)
    worst = finding.worst
    assert finding.claimed[worst.row, worst.column] == worst.claimed
    assert finding.measured[worst.row, worst.column] == worst.measured
    assert finding.deviation == pytest.approx(abs(worst.claimed - worst.measured) / np.abs(finding.measured).max())
    assert finding.verdict == "wrong" and finding.reason is None and finding.sentence is None and finding.noise < 1e-12


def loose_root(u):
    """x with x³ + x = u by Newton's method from x = 0, ended at a residual of 1e-6."""
    roots = []
    for value in u:
        x = 0.0
        while abs(x**3 + x - value) > 1e-6:
            x -= (x**3 + x - value) / (3 * x**2 + 1)
        roots.append(x)
    return np.array(roots)


def test_an_inexact_tangent_fails_only_if_asked():
    u = np.array([1.4])
    tangent = np.diag(1 / (3 * loose_root(u) ** 2 + 1))
    report = tc.check_tangent(loose_root, tangent, u)
    assert report.verdict == "inexact", report
    # The same with many unknowns, along random directions.
    many = np.full(40, 1.4)
    assert tc.check_tangent(loose_root, np.kron(np.eye(40), tangent), many).verdict == "inexact"
    # A step on whose way the residual does not jump explains nothing.
    assert tc.check_tangent(loose_root, tangent, u, start=u - 1e-9).verdict == "wrong"
    with pytest.raises(ValueError, match="start has the shape"):
        tc.check_tangent(loose_root, tangent, u, start=0)
    assert not report.ok and report.exit_code() == 1 and report.exit_code(allow_inexact=True) == 0
    with pytest.raises(AssertionError, match="inexact"):
        report.assert_consistent()
    assert "::warning" in report.to_github("mine.py", allow_inexact=True) and "::error" in report.to_github("mine.py")


def cubes(u):
    return u**3 + np.roll(u, 1)


def cubes_tangent(u):
    return np.diag(3 * u**2) + np.roll(np.eye(u.size), 1, axis=0)


@pytest.mark.parametrize("size", [5, 200])
def test_every_form_of_a_tangent(size):
    u = np.random.default_rng(1).uniform(0.5, 1.5, size)
    J = cubes_tangent(u)
    forms = {
        "array": J,
        "list": J.tolist(),
        "function": cubes_tangent,
        "sparse": csr_array(J),
        "function of sparse": lambda u: csr_array(cubes_tangent(u)),
        "operator": aslinearoperator(J),
        "operator without transpose": LinearOperator((size, size), matvec=lambda w: J @ w, dtype=float),
        "products": lambda u, w: 3 * u**2 * w + np.roll(w, 1),
    }
    for name, form in forms.items():
        report = tc.check_tangent(cubes, form, u)
        assert report.verdict == "consistent" and report.subject == "cubes", name
    J[3, 4] += 0.01
    without_transpose = LinearOperator((size, size), matvec=lambda w: J @ w, dtype=float)
    for form in (J, csr_array(J), aslinearoperator(J), without_transpose, lambda u, w: J @ w):
        report = tc.check_tangent(cubes, form, u)
        (finding,) = report.findings
        assert report.verdict == "wrong" and (finding.worst.row, finding.worst.column) == (3, 4)
        assert finding.worst.claimed == pytest.approx(0.01) and finding.worst.measured == pytest.approx(0, abs=1e-9)
        assert "∂R[3]/∂u[4]: claimed 1.0e-2" in str(report)
        assert report.notes[-1 if size < 30 else 0] == "No frequent mistake explains the wrong tangent."


def test_nodal_arrays():
    def residual(u):
        assert u.shape == (20, 2) and u.flags.writeable
        u += 0.0
        return u * (u**2).sum(axis=1, keepdims=True)

    def tangent(u):
        J = np.zeros((20, 2, 20, 2))
        for i, v in enumerate(u):
            J[i, :, i] = (v @ v) * np.eye(2) + 2 * np.outer(v, v)
        return J

    u = np.random.default_rng(1).standard_normal((20, 2))
    tc.check_tangent(residual, tangent, u).assert_consistent()
    J = tangent(u)
    J[7, 1, 7, 0] *= 2
    assert "∂R[7, 1]/∂u[7, 0]" in str(tc.check_tangent(residual, J, u))


@pytest.mark.parametrize("size", [6, 100])
def test_mistakes_in_the_terms_are_named(size):
    rng = np.random.default_rng(2)
    A = rng.standard_normal((size, size))
    u = rng.uniform(0.5, 1, size)
    terms = {"linear": (lambda u: A @ u, A), "cubic": (lambda u: u**3, lambda u: np.diag(3 * u**2))}
    residual = lambda u: A @ u + u**3
    D = np.diag(3 * u**2)
    for tangent, sentences in [
        (A + D, []),
        (A, ["The tangent of the whole lacks the term cubic."]),
        (A - D, ["The term cubic has the wrong sign in the tangent of the whole."]),
        (A + D / 3, ["The term cubic stands in the tangent of the whole with the factor 0.333333."]),
        (A.T + D, ["The tangent of the whole is transposed."]),
        (-A - D, ["The tangent of the whole has the wrong sign."]),
    ]:
        report = tc.check_tangent(residual, tangent, u, terms=terms)
        names = [str(diagnosis) for diagnosis in report.diagnoses]
        assert names[: len(sentences)] == sentences and bool(names) == bool(sentences)
        assert [finding.verdict for finding in report.findings[1:]] == ["consistent", "consistent"]
        assert report.ok == (not sentences)
    wrong_term = terms | {"cubic": (lambda u: u**3, lambda u: np.diag(u**2))}
    report = tc.check_tangent(residual, A + D / 3, u, terms=wrong_term)
    assert [finding.name for finding in report.findings if finding.verdict == "wrong"] == ["the whole", "term cubic"]
    assert "The tangent of term cubic is 0.333333 times the right one." in map(str, report.diagnoses)
    other = tc.check_tangent(residual, A + D, u, terms={"linear": terms["linear"]})
    assert any(note.startswith("The derivatives of the terms do not add up") for note in other.notes)


def test_scales_of_unknowns():
    # A displacement of 1e-6 and a pressure of 1e6.
    residual = lambda u: np.array([1e12 * u[0] ** 3 * 1e6 + u[1], np.exp(u[1] / 1e6) + 1e6 * u[0]])
    tangent = lambda u: np.array([[3e18 * u[0] ** 2, 1], [1e6, np.exp(u[1] / 1e6) / 1e6]])
    u = np.array([1e-6, 1e6])
    report = tc.check_tangent(residual, tangent, u, scale=u)
    assert report.verdict == "consistent"
    assert np.allclose(report.findings[0].measured, tangent(u), rtol=1e-6)
    for scale, words in ((-1, "positive"), ([1, 2, 3], "shape"), (0, "positive"), (np.nan, "positive")):
        with pytest.raises(ValueError, match=words):
            tc.check_tangent(residual, tangent, u, scale=scale)


def test_residuals_that_cannot_be_checked():
    u = np.ones(3)
    for call, kind, words in [
        (lambda: tc.check_tangent(cubes, np.eye(4), u), ValueError, r"shape \(4, 4\); a residual with 3 entries and u with 3 need \(3, 3\)"),
        (lambda: tc.check_tangent(cubes, lambda u, w: w[:2], u), ValueError, "product of the tangent has 2 entries, but the residual has 3"),
        (lambda: tc.check_tangent(cubes, np.eye(3), []), ValueError, "u is empty"),
        (lambda: tc.check_tangent(lambda u: 1 / 0, np.eye(3), u), ZeroDivisionError, "division"),
        (lambda: tc.check_tangent(cubes, lambda u: 1 / 0, u), ZeroDivisionError, "division"),
        (lambda: tc.check_tangent(cubes, lambda u, w: 1 / 0, u), ZeroDivisionError, "division"),
        (lambda: tc.check_tangent(cubes, np.eye(3), u, terms={"a": (lambda u: u[:2], np.eye(3))}), ValueError, "term a"),
    ]:
        with pytest.raises(kind, match=words):
            call()
    calls = []

    def fragile(u):
        calls.append(u)
        if len(calls) > 1:
            raise RuntimeError("only once")
        return u

    with pytest.raises(RuntimeError, match="only once"):
        tc.check_tangent(fragile, np.eye(3), u)
    # At a kink the derivative to either side is right, and of others nothing is known.
    kinked = lambda u: u + np.abs(u - 1)
    assert tc.check_tangent(kinked, 2 * np.eye(3), u).ok
    assert tc.check_tangent(kinked, np.eye(3) / 3, u).findings[0].reason == "kink"
    assert tc.check_tangent(lambda u: 0 * u, np.zeros((3, 3)), u).findings[0].reason == "zero response"
    assert tc.check_tangent(lambda u: 0 * u + 1, np.zeros((3, 3)), u).findings[0].reason == "nothing exercised"


def test_newton():
    quadratic = tc.newton_order([1e-1, 1e-2, 1e-4, 1e-8])
    assert quadratic.kind == "quadratic" and quadratic.order == pytest.approx(2) and quadratic.is_quadratic
    assert quadratic.orders == pytest.approx([2, 2]) and str(quadratic) == "quadratic (2.0)"
    assert tc.newton_order([1, 1e-2, 1e-4, 1e-6]).kind == "linear"
    assert tc.newton_order([1, 1e-17]).kind == "round-off at once"
    assert tc.newton_order([1, np.nan]).kind == "not finite" and tc.newton_order([]).order is None
    assert tc.newton_order([1, 1e-3, 1e-6, 1e-7], round_off=1e-7).orders[-1] is None
    solutions = {"step 1": [1e-1, 1e-2, 1e-4, 1e-8], "step 2": np.array([1.0, 0.1])}
    assert "step 1  1.0e-1  1.0e-2  1.0e-4  1.0e-8  quadratic (2.0)" in tc.newton_table(solutions)
    assert tc.newton_table(solutions, "markdown").startswith("| ")
    assert "\\toprule" in tc.newton_table(solutions, "latex")
    assert tc.newton_table(list(solutions.values()), "csv").splitlines()[2].startswith("2,1e0,")
    with pytest.raises(ValueError, match="allowed are text, markdown, latex, csv"):
        tc.newton_table(solutions, "html")


@pytest.fixture(scope="session")
def fortran(tmp_path_factory):
    if not shutil.which("gfortran"):
        pytest.skip("there is no gfortran")

    def compiled(source, *replaced):
        folder = tmp_path_factory.mktemp("law")
        text = (ROOT / "examples" / "laws" / source).read_text()
        for old, new in replaced:
            assert old in text
            text = text.replace(old, new)
        (folder / source).write_text(text)
        library = folder / "libmine.so"
        command = ["gfortran", "-shared", "-fPIC", "-O2", "-I", ROOT / "examples" / "laws", "-o", library, folder / source]
        subprocess.run(command, check=True)
        return library

    return compiled


def test_a_law_in_a_library(fortran):
    properties = [210e3, 0.3, 200, 1000, 100, 10]
    options = {"umat": True, "properties": properties, "state": 1, "tangent": "strain"}
    report = tc.check_law_library(fortran("j2.f90"), **options)
    assert report.ok and "libmine.so" in report.subject
    # A stress that the tangent does not know.
    wrong = tc.check_law_library(fortran("j2.f90", ("matmul(elastic, dstran)", "matmul(elastic, dstran) * 1.001d0")), **options)
    assert wrong.verdict == "wrong"
    with pytest.raises(ValueError, match="one of umat=True"):
        tc.check_law_library("libmine.so")
    with pytest.raises(ValueError, match="nowhere.so"):
        tc.check_law_library("nowhere.so", umat=True)
    flat = tc.check_law_library(fortran("j2.f90"), plane_strain=True, **options)
    assert flat.ok and "12" in flat.convention and "13" not in flat.convention
    with pytest.raises(ValueError, match="exclude each other"):
        tc.check_law_library("libmine.so", umat=True, plane_strain=True, plane_stress=True)
    with pytest.raises(ValueError, match="no tangent"):
        tc.check_law_library("libmine.so", umat=True, tangent="jaumann")


def test_a_crash_in_a_library_is_a_finding(fortran):
    report = tc.check_law_library(
        fortran("j2.f90", ("  bulk = ", "  if (dfgrd1(1, 1) > 1.2d0) stop 3\n  bulk = ")),
        umat=True,
        properties=[210e3, 0.3, 200, 1000, 100, 10],
        state=["plastic strain"],
        tangent="strain",
        states={"small": 1.1 * I, "large": 1.3 * I},
    )
    sentences = [finding.sentence for finding in report.findings if finding.reason == "call failed"]
    assert len(sentences) == 1 and "the library ended its program, with exit code 3" in sentences[0]


PLUGIN_TESTS = """
    import numpy as np

    def cubes(u):
        return u**3

    def test_right(tangent_check):
        report = tangent_check.tangent(cubes, lambda u: np.diag(3 * u**2), [1.0, 2.0])
        assert report.ok

    def test_wrong(tangent_check):
        tangent_check.tangent(cubes, lambda u: np.diag(2 * u**2), [1.0, 2.0])

    def test_not_checked(tangent_check):
        tangent_check.tangent(lambda u: 0 * u, np.zeros((2, 2)), [1.0, 2.0])

    def test_law(tangent_check):
        tangent_check.law(lambda F: F, lambda F: np.eye(9), name="linear")

    def test_newton(tangent_check):
        tangent_check.newton([1e-1, 1e-2, 1e-4, 1e-8])

    def test_linear(tangent_check):
        tangent_check.newton([1, 1e-2, 1e-4, 1e-6], name="a loose solve")

    def test_other():
        pass
"""


def test_the_plugin(pytester):
    pytester.makepyfile(PLUGIN_TESTS)
    result = pytester.runpytest_subprocess("--junitxml=junit.xml")
    result.assert_outcomes(passed=4, failed=3)
    result.stdout.fnmatch_lines(
        [
            "Tangent check of cubes",
            "*∂R?1?/∂u?1?: claimed 8.0e0, measured 1.2e1*",
            "*Diagnosis: The tangent of the whole is 0.666667 times the right one.*",
            "*Response and tangent are zero in all states*",
            "The convergence of a loose solve is not quadratic: linear (1.0).",
            "*= tangent checks =*",
            "test  *subject  *verdict  *checks  *deviation  *seen",
            "*::test_law  *linear  *consistent  *46  *",
            "*::test_linear  *a loose solve  *linear (1.0)*",
            "*::test_not_checked  *a residual  *not checked  *1 *",
            "*::test_right  *cubes  *consistent  *1 *",
            "*::test_wrong  *cubes  *wrong  *1 *",
        ]
    )
    assert "tangent_check" in (pytester.path / "junit.xml").read_text()
    assert "tangent checks" not in pytester.runpytest_subprocess("-k", "other").stdout.str()
