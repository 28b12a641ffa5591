#!/usr/bin/env python3
"""Checks who includes whom; fails on any file that breaks the house's rule.

The rule, one direction (CONTRIBUTING.md, "The rooms"):

    base <- map/geodesy <- map/{local,global,contacts} <- map/query
         <- map/obstacle_map <- storage <- server
    proto <- server, client;  client <- sim_feeder (plus map/geodesy)

It also keeps each outside library in the rooms that own it, bans threads, I/O
and wall clocks from map/, and checks that quoted includes start at the project
root, that header guards are FATHOM_<PATH>_H_, and that no C++ file grows past
600 lines. It reads text, so it needs no build.

Usage: check_includes.py [ROOT]     exit 0: clean, 1: findings, 2: misuse
"""

import os
import re
import sys

MAP_ROOMS = ("map/geodesy", "map/local", "map/global", "map/contacts",
             "map/query", "map")

# Room -> rooms of ours that it may include, besides itself. A file belongs to
# the longest room that its path starts with; `map` is obstacle_map.
MAY_INCLUDE = {
    "base": (),
    "map/geodesy": ("base",),
    "map/local": ("base", "map/geodesy"),
    "map/global": ("base", "map/geodesy"),
    "map/contacts": ("base", "map/geodesy"),
    "map/query": ("base", "map/geodesy", "map/local", "map/global",
                  "map/contacts"),
    "map": ("base",) + MAP_ROOMS,
    "storage": ("base",) + MAP_ROOMS,
    "server": ("base", "storage", "proto") + MAP_ROOMS,
    "client": ("base", "proto"),
    "sim_feeder": ("base", "client", "proto", "map/geodesy"),
    "tests": ("base", "storage", "server", "client", "sim_feeder",
              "proto") + MAP_ROOMS,
}

# (pattern of an include, rooms or folders that may write it, why). Tests may
# use any library.
LIBRARIES = (
    (r"sqlite3(ext)?\.h$", ("storage",), "SQLite lives in storage/"),
    (r"zstd\.h$|boost/", ("storage",), "codecs live in storage/"),
    (r"GeographicLib/", ("map/geodesy",), "GeographicLib: map/geodesy/ only"),
    (r"(gdal|ogr|cpl_)\w*\.h$", ("client/cli", "sim_feeder"),
     "GDAL never enters the server or the client library"),
    (r"cairo", ("client/cli", "sim_feeder"), "drawing is for command lines"),
    (r"nlohmann/", ("client", "sim_feeder"),
     "the server parses no files but its own"),
    (r"CLI/", ("server", "client", "sim_feeder"), "flags are for programs"),
    (r"spdlog/|fmt/", ("base",), "log through base/log.h"),
    (r"google/protobuf/|grpc/|grpcpp/|\.pb\.h$|fathom/v1/",
     ("server", "client", "sim_feeder"),
     "protobuf and gRPC stop at the edge"),
    (r"gtest/|gmock/|benchmark/", (), "test libraries are for tests/"),
)

# Banned in map/: it is pure.
MAP_BANNED_INCLUDES = re.compile(
    r"^(thread|mutex|shared_mutex|condition_variable|future|semaphore|latch|"
    r"barrier|stop_token|fstream|iostream|cstdio|stdio\.h|filesystem|unistd\.h"
    r"|fcntl\.h|sys/.*|ctime|time\.h|base/mutex\.h|base/clock\.h|base/log\.h)$")
# The one lock of map/: readers of a packed tile unpack it, and views end, on any
# thread. It changes no answer (docs/adr/0013).
MAP_LOCKS = {("map/global/tile_memory.h", "base/mutex.h")}
MAP_BANNED_TEXT = (
    (re.compile(r"\b\w*clock(\w|::)*::now\b"), "a clock; take a Time instead"),
    (re.compile(r"\bstd::(getenv|rand|time|thread|async)\b"),
     "not pure: environment, hidden state or threads"),
    (re.compile(r"\brandom_device\b"), "unseeded randomness"),
)

INCLUDE = re.compile(r'^[ \t]*#[ \t]*include\s*(?:"([^"]+)"|<([^>]+)>)', re.M)
COMMENT = re.compile(
    r"""'(?:\\.|[^'\\\n])'|"(?:\\.|[^"\\\n])*"|//[^\n]*|/\*.*?\*/""", re.S)
SUFFIXES = (".h", ".cc")
MAX_LINES = 600
SKIPPED_FOLDERS = {"build", ".git", "node_modules", "docs"}


def room_of(path):
    """The room that a path relative to the root belongs to, or None."""
    for room in sorted(MAY_INCLUDE, key=len, reverse=True):
        if path.startswith(room + "/"):
            return room
    if path.startswith("proto/"):
        return "proto"
    return None


def without_comments(text):
    """Blanks comments, keeps line numbers and string literals."""

    def blank(match):
        token = match.group(0)
        if token[0] in "\"'":
            return token
        return re.sub(r"[^\n]", " ", token)

    return COMMENT.sub(blank, text)


def check_ours(path, room, target, exists):
    """Finding for a quoted include, or None."""
    sibling = os.path.join(os.path.dirname(path), target)
    if not exists(target):
        if exists(os.path.normpath(sibling)):
            return f'write "{os.path.normpath(sibling)}" from the project root'
        return None
    owner = room_of(target)
    if owner is None or owner == room:
        return None
    if owner not in MAY_INCLUDE[room]:
        return f"{room} must not include {owner}"
    return None


def check_library(path, room, target):
    """Finding for an outside library, or None."""
    if room == "tests":
        return None
    for pattern, folders, why in LIBRARIES:
        if re.match(pattern, target) or re.search("/(" + pattern + ")", target):
            if not any(path.startswith(f + "/") for f in folders):
                return why
    return None


def check_file(root, path):
    """Yields "path:line: finding" for one file."""
    room = room_of(path)
    with open(os.path.join(root, path), encoding="utf-8") as file:
        raw = file.read()
    text = without_comments(raw)

    def line_of(position):
        return text.count("\n", 0, position) + 1

    def exists(target):
        return os.path.isfile(os.path.join(root, target))

    for match in INCLUDE.finditer(text):
        quoted, angled = match.groups()
        target = quoted or angled
        findings = [check_library(path, room, target)]
        if quoted:
            findings.append(check_ours(path, room, target, exists))
        elif exists(target) and room_of(target):
            findings.append("our own headers are included with quotes")
        if (room in MAP_ROOMS and MAP_BANNED_INCLUDES.match(target)
                and (path, target) not in MAP_LOCKS):
            findings.append("map/ is pure: no I/O, threads or clocks")
        for finding in filter(None, findings):
            yield f"{path}:{line_of(match.start())}: {target}: {finding}"
    if room in MAP_ROOMS:
        for pattern, why in MAP_BANNED_TEXT:
            for match in pattern.finditer(text):
                yield (f"{path}:{line_of(match.start())}: "
                       f"{match.group(0)}: {why}")
    if path.endswith(".h"):
        guard = "FATHOM_" + re.sub(r"[^A-Z0-9]", "_", path.upper()) + "_"
        if f"#ifndef {guard}\n#define {guard}\n" not in raw:
            yield f"{path}:1: header guard is not {guard}"
    lines = raw.count("\n")
    if lines > MAX_LINES:
        yield f"{path}:{lines}: more than {MAX_LINES} lines; split the file"


def files_of(root):
    """Paths of our C++ files, relative to the root, sorted."""
    paths = []
    for folder, folders, names in os.walk(root):
        folders[:] = [f for f in folders if f not in SKIPPED_FOLDERS]
        for name in names:
            path = os.path.relpath(os.path.join(folder, name), root)
            if name.endswith(SUFFIXES) and room_of(path) in MAY_INCLUDE:
                paths.append(path)
    return sorted(paths)


def main(argv):
    if len(argv) > 2 or (len(argv) == 2 and argv[1].startswith("-")):
        print(__doc__)
        return 2
    here = os.path.dirname(os.path.abspath(__file__))
    root = argv[1] if len(argv) == 2 else os.path.join(here, "..", "..")
    paths = files_of(root)
    findings = [f for path in paths for f in check_file(root, path)]
    for finding in findings:
        print(finding)
    print(f"{len(paths)} files, {len(findings)} findings")
    if not paths:
        print(f"no C++ file under {root}: wrong folder?")
        return 2
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
