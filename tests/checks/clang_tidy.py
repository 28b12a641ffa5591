#!/usr/bin/env python3
"""Runs clang-tidy on our .cc files, and only on those that changed.

A file is skipped when it was clean before with the same inputs: its own text,
every header that its object was built from (ninja's dependency log), its
compile command, the .clang-tidy files and the version of clang-tidy. So build
first; a file without an object is always checked. Clean keys are empty files in
the user's cache folder (fathom/tidy), so a fresh clone knows them too.

clang's -Wthread-safety is on: GUARDED_BY is checked here (base/mutex.h).

Usage: clang_tidy.py [--build DIR] [--jobs N] [--skip ROOM]... [FILE...]
Exit 0: clean, 1: findings, 2: misuse
"""

import argparse
import concurrent.futures
import hashlib
import json
import os
import shlex
import subprocess
import sys
import time

ROOT = os.path.normpath(os.path.join(os.path.dirname(os.path.abspath(__file__)),
                                     "..", ".."))
ROOMS = ("base", "map", "storage", "server", "client", "sim_feeder", "tests")
# For clang only: g++ options that clang lacks are no finding.
EXTRA = ["--extra-arg=-Wthread-safety",
         "--extra-arg=-Wno-unknown-warning-option",
         # clang 14 knows these and g++ 12 does not warn: not our contract.
         "--extra-arg=-Wno-unused-command-line-argument"]


def read_bytes(path):
    with open(path, "rb") as file:
        return file.read()


def commands_of(build):
    """{absolute source: compile command} of our sources, in a fixed order."""
    with open(os.path.join(build, "compile_commands.json"),
              encoding="utf-8") as file:
        entries = json.load(file)
    result = {}
    for entry in entries:
        path = os.path.normpath(os.path.join(entry["directory"],
                                             entry["file"]))
        relative = os.path.relpath(path, ROOT)
        if relative.split(os.sep)[0] in ROOMS:
            result[path] = entry["command"]
    return dict(sorted(result.items()))


def dependencies_of(build):
    """{object path relative to the build: [dependency]} from ninja's log."""
    output = subprocess.run(["ninja", "-C", build, "-t", "deps"],
                            capture_output=True, text=True, check=True).stdout
    result = {}
    current = []
    for line in output.splitlines():
        if line.startswith("    "):
            current.append(line.strip())
        elif ": #deps" in line:
            current = []
            # STALE: the object no longer matches its sources.
            if "(VALID)" in line:
                result[line.split(": #deps")[0]] = current
    return result


def object_of(command):
    words = shlex.split(command)
    return words[words.index("-o") + 1] if "-o" in words else None


class Fingerprints:
    """Digest of a file: text for ours, size and time for the system's."""

    def __init__(self, build):
        self._build = build
        self._seen = {}

    def of(self, path):
        path = os.path.normpath(os.path.join(self._build, path))
        if path not in self._seen:
            if path.startswith("/usr/"):
                stat = os.stat(path)
                mark = f"{stat.st_size} {stat.st_mtime_ns}"
            else:
                mark = hashlib.sha256(read_bytes(path)).hexdigest()
            self._seen[path] = f"{os.path.relpath(path, ROOT)} {mark}"
        return self._seen[path]


def key_of(source, command, dependencies, fingerprints, common):
    """What this check depends on, as a digest; None if not known."""
    objects = object_of(command)
    if objects not in dependencies:
        return None
    digest = hashlib.sha256(common)
    digest.update(command.replace(ROOT, "").encode())
    try:
        for path in [source] + sorted(dependencies[objects]):
            digest.update(fingerprints.of(path).encode())
    except OSError:
        return None
    return digest.hexdigest()


def tidy(build, source):
    """(seconds, exit code, what clang-tidy says) for one file."""
    start = time.monotonic()
    result = subprocess.run(
        ["clang-tidy", "-p", build, "--quiet"] + EXTRA + [source],
        capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    text = result.stdout.replace(ROOT + os.sep, "")
    if result.returncode and not text.strip():
        text = result.stderr
    return time.monotonic() - start, result.returncode, text


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--build", default=os.path.join(ROOT, "build", "dev"))
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--skip", action="append", default=[], metavar="ROOM")
    parser.add_argument("files", nargs="*", metavar="FILE")
    options = parser.parse_args()
    build = os.path.abspath(options.build)
    if not os.path.exists(os.path.join(build, "compile_commands.json")):
        print(f"no compile_commands.json in {build}: configure it first")
        return 2

    commands = commands_of(build)
    if options.files:
        wanted = {os.path.abspath(file) for file in options.files}
        unknown = wanted - set(commands)
        if unknown:
            print(f"not compiled: {' '.join(sorted(unknown))}")
            return 2
        commands = {s: c for s, c in commands.items() if s in wanted}
    commands = {s: c for s, c in commands.items()
                if os.path.relpath(s, ROOT).split(os.sep)[0]
                not in options.skip}
    if not commands:
        print("no source of ours in compile_commands.json: wrong folder?")
        return 2

    cache = os.path.join(
        os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"),
        "fathom", "tidy")
    os.makedirs(cache, exist_ok=True)
    version = subprocess.run(["clang-tidy", "--version"], capture_output=True,
                             check=True).stdout
    common = (version + "".join(EXTRA).encode() +
              read_bytes(os.path.join(ROOT, ".clang-tidy")) +
              read_bytes(os.path.join(ROOT, "tests", ".clang-tidy")))
    dependencies = dependencies_of(build)
    fingerprints = Fingerprints(build)
    keys = {source: key_of(source, command, dependencies, fingerprints, common)
            for source, command in commands.items()}
    pending = [source for source in commands
               if keys[source] is None or
               not os.path.exists(os.path.join(cache, keys[source]))]
    print(f"{len(commands)} files, {len(commands) - len(pending)} unchanged")

    dirty = 0
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        runs = {pool.submit(tidy, build, source): source for source in pending}
        for run in concurrent.futures.as_completed(runs):
            source = runs[run]
            seconds, code, text = run.result()
            relative = os.path.relpath(source, ROOT)
            print(f"{'FAIL' if code else 'ok'} {relative} {seconds:.1f} s",
                  flush=True)
            if code:
                dirty += 1
                print(text)
            elif keys[source]:
                with open(os.path.join(cache, keys[source]), "w",
                          encoding="utf-8"):
                    pass
    print(f"{len(commands) - dirty} files clean, {dirty} with findings")
    return 1 if dirty else 0


if __name__ == "__main__":
    sys.exit(main())
