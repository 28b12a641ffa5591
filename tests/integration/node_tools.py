"""The tools of tests/node (buf, @grpc/grpc-js), installed where tests/run has
not yet."""

import fcntl
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

from live_server import ROOT

NODE = ROOT / "tests" / "node"
BUF = NODE / "node_modules" / ".bin" / "buf"


def install():
    """Skips the caller's tests where there is no node or npm."""
    missing = [name for name in ("node", "npm") if not shutil.which(name)]
    if missing:
        reason = f"not installed: {', '.join(missing)}"
        print(f"skipped: {reason}", file=sys.stderr)
        raise unittest.SkipTest(reason)
    lock_path = pathlib.Path(tempfile.gettempdir()) / "fathom-npm-ci.lock"
    with open(lock_path, "w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # Tests of two builds at once.
        if not BUF.exists():
            subprocess.run(
                ["npm", "ci", "--prefix", NODE, "--ignore-scripts",
                 "--no-audit", "--no-fund", "--no-progress",
                 "--loglevel=error"], check=True, timeout=240)
