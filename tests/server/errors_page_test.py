"""docs/errors.md lists every reason that the server can give, and no other.

Usage: errors_page_test.py ROOT
"""

import pathlib
import re
import sys


def reasons_of_calls(root):
    """What server/ attaches as ErrorInfo.reason, by the literals."""
    found = set()
    for source in (root / "server").glob("*.cc"):
        found |= set(re.findall(r'AttachReason\(\s*status,\s*"([A-Z_]+)"',
                                source.read_text()))
    return found


def reasons_of_fields(root):
    text = (root / "proto/fathom/v1/types.proto").read_text()
    names = set(re.findall(r"^\s*REJECT_REASON_(\w+) = \d+;", text, re.M))
    return names - {"UNSPECIFIED"}


def reasons_listed(root):
    calls, fields = [], []
    where = None
    for line in (root / "docs/errors.md").read_text().splitlines():
        if line.startswith("## "):
            where = {"## Reasons of calls": calls,
                     "## Reasons of fields and measurements": fields}.get(line)
        row = re.match(r"\| `([A-Z_]+)` \|", line)
        if row and where is not None:
            where.append(row.group(1))
    return calls, fields


def main():
    root = pathlib.Path(sys.argv[1])
    failures = []
    for source, listed in zip((reasons_of_calls(root), reasons_of_fields(root)),
                              reasons_listed(root)):
        if not source:
            failures.append("no reason found in the source: has it moved?")
        if len(listed) != len(set(listed)):
            failures.append(f"listed twice: {sorted(listed)}")
        failures += [f"docs/errors.md lacks {reason}"
                     for reason in sorted(source - set(listed))]
        failures += [f"docs/errors.md lists {reason}, which is not given"
                     for reason in sorted(set(listed) - source)]
    print("\n".join(failures) or "docs/errors.md lists every reason")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
