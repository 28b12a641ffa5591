#!/usr/bin/env python3
"""Reads ctest's JUnit report for tests/run.

Prints "PASSED FAILED" (counts of ctest entries), then for each failed entry
"failed NAME" and the end of what it printed, "printed LINE", then the reason of
every GTEST_SKIP, "skipped TIMES REASON": a binary that skipped a case has passed
for ctest. An entry that ctest did not run counts as failed.

Usage: ctest_report.py REPORT.xml
"""

import collections
import re
import sys
import xml.etree.ElementTree

SHOWN_LINES = 30
SKIP = re.compile(r"^.*: Skipped\n(.*)$", re.M)


def main():
    suite = xml.etree.ElementTree.parse(sys.argv[1]).getroot()
    failed = []
    passed = 0
    skips = collections.Counter()
    for case in suite.iter("testcase"):
        if case.get("status") == "run":
            passed += 1
        else:
            failed.append(case)
        output = case.findtext("system-out") or ""
        skips.update(match.group(1).strip() for match in SKIP.finditer(output))
    print(passed, len(failed))
    for case in failed:
        print("failed", case.get("name"))
        lines = (case.findtext("system-out") or "").splitlines()
        for line in lines[-SHOWN_LINES:]:
            print("printed", line)
    for reason, times in skips.most_common():
        print("skipped", times, reason)


if __name__ == "__main__":
    main()
