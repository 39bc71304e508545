"""pytest finds this plugin by itself: the fixture `tangent_check`, and a table of all checks of a session.

    def test_the_tangent_of_my_law(tangent_check):
        tangent_check.law(stress, tangent)
"""

import math
from typing import Any

import pytest

import tangent_check as checker

HEADINGS = ("test", "subject", "verdict", "checks", "deviation", "seen")
PROPERTY = "tangent_check"


class TangentCheck:
    """Checks that fail a test with the report, unless the tangent is consistent. A tangent that is not checked fails too."""

    def __init__(self, properties: list[tuple[str, object]]) -> None:
        self._properties = properties

    def law(self, *arguments: Any, allow_inexact: bool = False, **options: Any) -> checker.Report:
        """`tangent_check.check_law`. With `allow_inexact`, an inexact tangent passes."""
        return self._judge(checker.check_law(*arguments, **options), allow_inexact)

    def library(self, *arguments: Any, allow_inexact: bool = False, **options: Any) -> checker.Report:
        """`tangent_check.check_law_library`. With `allow_inexact`, an inexact tangent passes."""
        return self._judge(checker.check_law_library(*arguments, **options), allow_inexact)

    def tangent(self, *arguments: Any, allow_inexact: bool = False, **options: Any) -> checker.Report:
        """`tangent_check.check_tangent`. With `allow_inexact`, an inexact tangent passes."""
        return self._judge(checker.check_tangent(*arguments, **options), allow_inexact)

    def newton(self, norms: Any, *, name: str = "Newton's method", round_off: float | None = None) -> checker.NewtonOrder:
        """`tangent_check.newton_order` of the residual norms of a solution; fails unless it is quadratic, or at round-off at once."""
        order = checker.newton_order(norms, round_off=round_off)
        self._record(name, str(order), "-", "-", "-")
        if not order.is_quadratic:
            table = checker.newton_table({name: norms}, round_off=round_off)
            pytest.fail(f"The convergence of {name} is not quadratic: {order}.\n\n{table}", pytrace=False)
        return order

    def _judge(self, report: checker.Report, allow_inexact: bool) -> checker.Report:
        deviations = [finding.deviation for finding in report.findings if math.isfinite(finding.deviation)]
        seen = [finding.control for finding in report.findings if finding.control is not None]
        self._record(report.subject, report.verdict, str(len(report.findings)), _greatest(deviations), _greatest(seen))
        if report.exit_code(allow_inexact=allow_inexact) != 0:
            pytest.fail(str(report), pytrace=False)
        return report

    def _record(self, *cells: str) -> None:
        # User properties come back from the processes of pytest-xdist, and stand in JUnit reports.
        self._properties.append((PROPERTY, list(cells)))


def _greatest(values: list[float]) -> str:
    return f"{max(values):.1e}".replace("e-0", "e-") if values else "-"


@pytest.fixture
def tangent_check(request: pytest.FixtureRequest) -> TangentCheck:
    """Checks of tangents and of Newton's convergence."""
    return TangentCheck(request.node.user_properties)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """The table of all checks."""
    rows = [
        (report.nodeid, *cells)
        for reports in terminalreporter.stats.values()
        for report in reports
        if getattr(report, "when", None) == "call"
        for name, cells in report.user_properties
        if name == PROPERTY
    ]
    if not rows:
        return
    terminalreporter.section("tangent checks")
    widths = [max(map(len, column)) for column in zip(HEADINGS, *rows)]
    for row in (HEADINGS, *sorted(rows)):
        line = "  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip()
        terminalreporter.write_line(line, red=row[2] in ("wrong", "not checked"))
    terminalreporter.write_line(
        "Deviation: the greatest, relative to the greatest entry. Seen: the smallest planted error that each check saw, relative to its entry."
    )
