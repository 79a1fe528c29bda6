"""Prints the largest difference of each quantity from Pinocchio after the tests. The option --validation names a file
to which the differences are written."""

from pathlib import Path

import comparison
import pytest
import validation


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--validation", metavar="FILE", help="where to write the table of all differences (VALIDATION.md)")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, exitstatus: int, config: pytest.Config) -> None:
    if not comparison.records:
        return
    terminalreporter.section("greatest differences from Pinocchio, relative to 1 + max |theirs|")
    for what, r in sorted(comparison.records.items()):
        terminalreporter.write_line(
            f"{what:<44} {r.difference:8.1e}  {100 * r.share:5.1f} % of what is allowed  {r.where}"
        )
    path = config.getoption("--validation")
    if path and exitstatus == pytest.ExitCode.OK:
        before = Path(path).read_text(encoding="utf-8") if Path(path).exists() else ""
        Path(path).write_text(validation.report() + validation.kept(before), encoding="utf-8")
        terminalreporter.write_line(f"written to {path}")
    elif path:
        terminalreporter.write_line(f"{path} is not written, as some tests failed")
