"""Prints, after the tests, how far from Pinocchio each quantity was."""

import comparison
import pytest


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if not comparison.worst:
        return
    terminalreporter.section("greatest differences from Pinocchio, relative to 1 + max |theirs|")
    for what, (share, difference, where) in sorted(comparison.worst.items()):
        terminalreporter.write_line(f"{what:<36} {difference:8.1e}  {100 * share:5.1f} % of what is allowed  {where}")
