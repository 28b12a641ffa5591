#!/usr/bin/env python3
"""Reads ctest's JUnit report for tests/run.

Prints "PASSED FAILED" (counts of ctest entries), then one line for each failed
entry, "failed NAME", then the reason of every GTEST_SKIP, "skipped TIMES
REASON": a binary that skipped a case has passed for ctest. An entry that ctest
did not run counts as failed.

Usage: ctest_report.py REPORT.xml
"""

import collections
import re
import sys
import xml.etree.ElementTree

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
            failed.append(case.get("name"))
        output = case.findtext("system-out") or ""
        skips.update(match.group(1).strip() for match in SKIP.finditer(output))
    print(passed, len(failed))
    for name in failed:
        print("failed", name)
    for reason, times in skips.most_common():
        print("skipped", times, reason)


if __name__ == "__main__":
    main()
