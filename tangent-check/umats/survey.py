#!/usr/bin/env python3
"""The verdicts over UMATs of public repositories, as a page of the manual; each wrong one is judged by a second program, this one.

survey.py PROGRAM PAGE FOLDER… ; the folders are clones of the repositories. The parameters are those of the input files beside a UMAT. The second program
shares nothing with the first: it calls the compiled law by ctypes, on random paths of its own, and takes central differences.
"""

import ctypes
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

PAIRS = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
STUBS = """
void getoutdir_(char *s, int *n, long l) { for (long i = 0; i < l; i++) s[i] = ' '; s[0] = '.'; *n = 1; }
void getjobname_(char *s, int *n, long l) { getoutdir_(s, n, l); }
void xit_(void) { _Exit(9); } void stdb_abqerr_(void) {} void getvrm_(void) {} void getnumcpus_(int *n) { *n = 1; } void getrank_(int *n) { *n = 0; }
void mutexinit_(void) {} void mutexlock_(void) {} void mutexunlock_(void) {}
"""


def run(program, source, arguments):
    """(exit code, report or None, last words) of the checker in the folder of the source."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        command = [program, source.name, *arguments, "--total-limit", "20", "--report", f"json={report}"]
        done = subprocess.run(command, cwd=source.parent, capture_output=True, errors="replace")
        found = json.loads(report.read_text()) if report.exists() and report.read_text() else None
        return done.returncode, found, done.stderr


def reason(words):
    """Why a law was not checked, in a few words."""
    if "does not compile" in words:
        missing = re.search(r"Cannot open (?:included|module) file .(\S+?).(?:\s|$)", words)
        return f"needs {missing[1]}" if missing else "is no Fortran that compiles"
    if "End of file" in words or "No such file" in words:
        return "needs a data file"
    found = re.search(r"because: .*?\]\]: (.*)", words) or re.search(r"error: (.*)", words)
    return found[1][:90] if found else "no answer"


def judged(program, source):
    """The options, the report or None, and the reason without one."""
    inputs = sorted(source.parent.glob("*.inp"), key=lambda file: ("cube" not in file.name, file.name))
    inputs = [file for file in inputs if parameters(file) != ([], 0)]
    words = "there is no input file with its parameters"
    code, _, said = run(program, source, ["--state", "1"])
    if "does not compile" in said or "while it was loaded" in said or "undefined symbol" in said:
        return [], None, reason(said)
    for file in inputs:
        options = [file.name]
        code, report, said = run(program, source, options)
        if report is None:
            words = reason(said)
            continue
        if report["verdict"] != "consistent" and any("--tangent strain" in note for note in report["notes"]):
            options = [file.name, "--tangent", "strain"]
            _, report, _ = run(program, source, options)
        return options, report, ""
    return [], None, words


def number(field):
    try:
        return float(field.lower().replace("d", "e"))
    except ValueError:
        return np.nan


def parameters(file, depth=0, known=None):
    """PROPS and NSTATV of the first user material of an input file."""
    known = {} if known is None else known
    keyword, props, count, size = "", [], 0, 0
    for line in file.read_text(errors="replace").splitlines():
        if line.startswith("**") or not line.strip():
            continue
        if line.startswith("*"):
            keyword = line.lower().replace(" ", "")
            included = re.match(r"\*include,(?:input|file)=(.*)", line.replace(" ", ""), re.I)
            if included and (file.parent / included[1]).is_file() and depth < 5:
                inner = parameters(file.parent / included[1], depth + 1, known)
                props, size = props or inner[0], size or inner[1]
            constants = re.search(r"constants=(\d+)", keyword)
            count = int(constants[1]) if constants else count
        elif keyword.startswith("*parameter") and "=" in line:
            known[line.split("=")[0].strip().upper()] = line.split("=")[1].strip()
        elif keyword.startswith("*usermaterial") and len(props) < count:
            fields = [known.get(field.strip().strip("<>").upper(), field) for field in line.split(",") if field.strip()]
            props += [number(field) for field in fields]
        elif keyword.startswith("*depvar") and not size:
            size = int(line.split(",")[0])
    return props[:count] if count else props, size


def second_program(source, options):
    """The greatest deviation from central differences, relative to the greatest entry; run in a process of its own."""
    props, size = parameters(source.parent / options[0])
    strain = "strain" in options
    with tempfile.TemporaryDirectory() as folder:
        library, stubs = Path(folder) / "law.so", Path(folder) / "stubs.c"
        stubs.write_text(STUBS)
        for name in ("ABA_PARAM.INC", "aba_param.inc"):
            (Path(folder) / name).write_text("      implicit real*8(a-h,o-z)\n      parameter (nprecd=2)\n")
        flags = "-shared -fPIC -O1 -w -std=legacy -ffixed-line-length-none -ffree-line-length-none".split()
        for form in ([], ["-ffree-form"]):
            command = ["gfortran", *flags, *form, f"-I{folder}", f"-J{folder}", "-I.", source.name, str(stubs), "-o", str(library)]
            if subprocess.run(command, cwd=source.parent, capture_output=True).returncode == 0:
                break
        law = ctypes.CDLL(str(library))
        if hasattr(law, "uexternaldb_"):
            whole, number = ctypes.c_int(0), (ctypes.c_double * 2)()
            law.uexternaldb_(*[ctypes.byref(whole)] * 2, number, number, *[ctypes.byref(whole)] * 2)
        return max(deviation(law, props, size, strain, np.random.default_rng(seed), scale) for seed in range(6) for scale in (1e-3, 0.02, 0.2, 0.5))


def call(law, props, size, F, de, before=None):
    """STRESS, DDSDDE and STATEV of a step from rest, or behind a step that ended with (STRESS, STATEV, F, STRAN)."""
    zeros = lambda count: np.zeros(max(count, 1))
    stress, state, F0, six = before or (zeros(6), zeros(size + 200), np.eye(3), zeros(6))
    stress, state, F0, six, tangent, four = stress.copy(), state.copy(), np.asfortranarray(F0), six.copy(), np.zeros((6, 6), order="F"), zeros(4)
    strain = np.array([de[i, j] * (1 if i == j else 2) for i, j in PAIRS])
    whole = lambda value: ctypes.byref(ctypes.c_int(value))
    real = lambda value: ctypes.byref(ctypes.c_double(value))
    at = lambda array: array.ctypes.data_as(ctypes.c_void_p)
    F, one, props = np.asfortranarray(F), np.eye(3, order="F"), np.array(props or [0.0])
    law.umat_(at(stress), at(state), at(tangent), real(0), real(0), real(0), real(0), at(zeros(6)), at(zeros(6)), real(0), at(six), at(strain), at(zeros(2)),
              real(0.1), real(0), real(0), at(four), at(four), b"UD".ljust(80), whole(3), whole(3), whole(6), whole(size), at(props), whole(len(props)),
              at(zeros(3)), at(one), real(1e36), real(1), at(F0), at(F), whole(1), whole(1), whole(1), whole(1), at(np.ones(4, np.int32)), whole(1),
              ctypes.c_long(80))
    return stress, tangent, state


def deviation(law, props, size, strain, random, scale):
    """Of the last step of a path of one to four steps in random directions. The smallest over three increments, so that neither round-off nor a kink counts."""
    exp = lambda a: sum((np.linalg.matrix_power(a, n) / np.prod(range(1, n + 1)) for n in range(1, 20)), np.eye(3))
    F, six, before = np.eye(3), np.zeros(6), None
    for step in range(random.integers(1, 5)):
        if step:
            stress, _, state = call(law, props, size, F, e, before)
            before = stress, state, F, six + [e[i, j] * (1 if i == j else 2) for i, j in PAIRS]
            six = before[3]
        e = random.normal(size=(3, 3)) * scale / 2
        e = (e + e.T) / 2
        F = exp(e) @ F
    answer = lambda d: call(law, props, size, F if strain else exp(d) @ F, e + d if strain else e, before)[0] * (1 if strain else np.exp(np.trace(d)))
    claimed = call(law, props, size, F, e, before)[1]
    found = []
    for h in (1e-4, 1e-5, 1e-6):
        worst = 0.0
        for column, (i, j) in enumerate(PAIRS):
            d = np.zeros((3, 3))
            d[i, j] = d[j, i] = h if i == j else h / 2
            measured = (answer(d) - answer(-d)) / (2 * h)
            worst = max(worst, np.abs(measured - claimed[:, column]).max())
        found.append(worst / np.abs(claimed).max())
    return np.nan_to_num(min(found))


def confirmed(source, options):
    command = [sys.executable, __file__, "--second", str(source), *options]
    try:
        done = subprocess.run(command, cwd=source.parent, capture_output=True, text=True, timeout=120, errors="replace")
    except subprocess.TimeoutExpired:
        return "no answer"
    words = done.stdout.split()
    if done.returncode or not words:
        return "no answer"
    # Its paths may miss a few states.
    return f"{float(words[-1]):.0e}" if float(words[-1]) > 1e-7 else "not seen"


def page_of(rows, reasons, repositories):
    """The page: the laws with a verdict, and why the others have none."""
    others = "".join(f"| {why} | {count} |\n" for why, count in sorted(reasons.items(), key=lambda item: -item[1]))
    return f"""# Verdicts over public UMATs

`tangent-check/umats/survey.py` wrote this page. Each UMAT of {repositories} was checked as it is, with the
parameters of the input file beside it. A deviation is relative to the greatest entry of the tangent. The last column is the greatest one that a second
program found, which shares no code with the first, by central differences on random paths of its own. "Wrong" is a verdict over the tangent for Abaqus'
convention or small strain, whichever fits better, and no judgement of the stress: such a law may converge slowly, and still be right where it converges.

| UMAT | verdict | states | second program |
|---|---|---|---|
{chr(10).join(rows)}

{sum(reasons.values())} others have no verdict:

| why | UMATs |
|---|---|
{others}"""


def main():
    program, page, *folders = sys.argv[1:]
    rows, reasons = [], {}
    for folder in map(Path, folders):
        for source in sorted(folder.rglob("*.[fF]*")):
            if source.suffix.lower() not in (".f", ".for", ".f90") or "src" in source.relative_to(folder).parts[:-1] and "_" in source.name[:1]:
                continue
            if not re.search(r"^[^!cC*\n]*subroutine +umat *\(", source.read_text(errors="replace"), re.I | re.M):
                continue
            options, report, why = judged(str(Path(program).resolve()), source.resolve())
            if report is None:
                kind = re.sub(r"^[^:]*\.inp: ", "its input file: ", re.sub(r"^needs .*", "needs another file", why))
                reasons[kind] = reasons.get(kind, 0) + 1
                continue
            name = f"{folder.name.replace('+', '/')}: {source.relative_to(folder)}"
            judgements = [finding for finding in report["findings"] if finding["verdict"] != "not checked"]
            wrong = [finding for finding in judgements if finding["verdict"] == "wrong"]
            greatest = max((finding["deviation"] or 0 for finding in wrong), default=0)
            words = f"{len(wrong)} of {len(report['findings'])} states, by up to {greatest:.0e}" if wrong else f"{len(judgements)} states"
            second = confirmed(source.resolve(), options) if wrong else ""
            rows.append(f"| `{name}` | {report['verdict']} | {words} | {second} |")
            print(rows[-1], flush=True)
    repositories = ", ".join(f"`{Path(folder).name.replace('+', '/')}`" for folder in folders)
    Path(page).write_text(page_of(rows, reasons, repositories))


if __name__ == "__main__":
    if sys.argv[1] == "--second":
        print(second_program(Path(sys.argv[2]), sys.argv[3:]))
    else:
        main()
