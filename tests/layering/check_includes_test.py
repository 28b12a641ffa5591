#!/usr/bin/env python3
"""Tests check_includes.py on small trees that keep or break each rule."""

import os
import re
import subprocess
import sys
import tempfile
import unittest

SCRIPT = os.path.join(os.path.dirname(os.path.abspath(__file__)),
                      "check_includes.py")


def header(path, body=""):
    """A header at `path` with the right guard."""
    guard = "FATHOM_" + re.sub(r"[^A-Z0-9]", "_", path.upper()) + "_"
    return f"#ifndef {guard}\n#define {guard}\n{body}\n#endif\n"


# One header a room, so that includes have a target.
HEADERS = ("base/time.h", "base/mutex.h", "map/geodesy/frame.h",
           "map/local/grid.h", "map/global/tree.h", "map/contacts/contact.h",
           "map/query/query.h", "map/obstacle_map.h", "storage/mission.h",
           "server/keeper.h", "client/client.h", "sim_feeder/sonar.h",
           "tests/testing/fake.h")


class CheckIncludes(unittest.TestCase):

    def run_on(self, files):
        """Writes a tree of HEADERS plus `files`; (exit code, output)."""
        with tempfile.TemporaryDirectory() as root:
            tree = {path: header(path) for path in HEADERS}
            tree.update(files)
            for path, text in tree.items():
                full = os.path.join(root, path)
                os.makedirs(os.path.dirname(full), exist_ok=True)
                with open(full, "w", encoding="utf-8") as file:
                    file.write(text)
            result = subprocess.run([sys.executable, SCRIPT, root],
                                    capture_output=True, text=True,
                                    check=False)
            return result.returncode, result.stdout

    def assert_clean(self, path, text):
        code, output = self.run_on({path: text})
        self.assertEqual(code, 0, output)

    def assert_finds(self, path, text, expected):
        code, output = self.run_on({path: text})
        self.assertEqual(code, 1, output)
        self.assertIn(expected, output)
        self.assertIn(", 1 findings", output)

    def test_the_permitted_direction_is_clean(self):
        order = {
            "map/geodesy/a.cc": ["base/time.h"],
            "map/local/a.cc": ["base/time.h", "map/geodesy/frame.h"],
            "map/query/a.cc": ["map/local/grid.h", "map/global/tree.h",
                               "map/contacts/contact.h"],
            "map/obstacle_map.cc": ["map/obstacle_map.h",
                                    "map/query/query.h"],
            "storage/a.cc": ["map/obstacle_map.h", "map/global/tree.h"],
            "server/a.cc": ["storage/mission.h", "map/query/query.h",
                            "fathom/v1/types.pb.h"],
            "client/a.cc": ["base/time.h", "fathom/v1/types.pb.h"],
            "sim_feeder/a.cc": ["client/client.h", "map/geodesy/frame.h"],
            "tests/server/a.cc": ["server/keeper.h", "tests/testing/fake.h",
                                  "sqlite3.h"],
        }
        code, output = self.run_on({
            path: "".join(f'#include "{t}"\n' for t in targets)
            for path, targets in order.items()})
        self.assertEqual(code, 0, output)
        self.assertIn(f"{len(HEADERS) + len(order)} files, 0 findings",
                      output)

    def test_every_other_direction_is_found(self):
        broken = (
            ("base/a.cc", "map/geodesy/frame.h"),
            ("map/geodesy/a.cc", "map/local/grid.h"),
            ("map/local/a.cc", "map/global/tree.h"),
            ("map/global/a.cc", "map/contacts/contact.h"),
            ("map/contacts/a.cc", "map/local/grid.h"),
            ("map/local/a.cc", "map/query/query.h"),
            ("map/query/a.cc", "map/obstacle_map.h"),
            ("map/obstacle_map.cc", "storage/mission.h"),
            ("storage/a.cc", "server/keeper.h"),
            ("client/a.cc", "map/geodesy/frame.h"),
            ("client/a.cc", "server/keeper.h"),
            ("client/a.cc", "sim_feeder/sonar.h"),
            ("server/a.cc", "client/client.h"),
            ("sim_feeder/a.cc", "map/local/grid.h"),
            ("sim_feeder/a.cc", "map/global/tree.h"),
            ("sim_feeder/a.cc", "map/contacts/contact.h"),
            ("sim_feeder/a.cc", "map/query/query.h"),
            ("sim_feeder/a.cc", "map/obstacle_map.h"),
            ("sim_feeder/a.cc", "server/keeper.h"),
            ("server/a.cc", "tests/testing/fake.h"),
        )
        for path, target in broken:
            with self.subTest(path=path, target=target):
                self.assert_finds(path, f'\n#include "{target}"\n',
                                  f"{path}:2: {target}: ")

    def test_a_library_outside_its_room_is_found(self):
        broken = (
            ("server/a.cc", "sqlite3.h"),
            ("map/local/a.cc", "GeographicLib/Geodesic.hpp"),
            ("server/a.cc", "gdal_priv.h"),
            ("client/a.cc", "gdal/gdal_priv.h"),
            ("server/a.cc", "nlohmann/json.hpp"),
            ("storage/a.cc", "fathom/v1/types.pb.h"),
            ("map/query/a.cc", "google/protobuf/message.h"),
            ("storage/a.cc", "grpcpp/grpcpp.h"),
            ("base/a.cc", "gtest/gtest.h"),
            ("server/a.cc", "spdlog/spdlog.h"),
            ("server/a.cc", "zstd.h"),
        )
        for path, target in broken:
            with self.subTest(path=path, target=target):
                self.assert_finds(path, f"#include <{target}>\n", target)

    def test_a_library_in_its_room_is_clean(self):
        for path, target in (("storage/a.cc", "sqlite3.h"),
                             ("storage/a.cc", "boost/crc.hpp"),
                             ("map/geodesy/a.cc", "GeographicLib/Geodesic.hpp"),
                             ("client/cli/a.cc", "gdal_priv.h"),
                             ("sim_feeder/a.cc", "gdal_priv.h"),
                             ("base/log.cc", "spdlog/spdlog.h"),
                             ("map/local/a.cc", "Eigen/Core")):
            with self.subTest(path=path, target=target):
                self.assert_clean(path, f"#include <{target}>\n")

    def test_map_is_pure(self):
        for target in ("thread", "mutex", "fstream", "condition_variable",
                       "filesystem", "unistd.h"):
            with self.subTest(target=target):
                self.assert_finds("map/local/a.cc", f"#include <{target}>\n",
                                  "map/ is pure")
        self.assert_finds("map/query/a.cc", '#include "base/mutex.h"\n',
                          "map/ is pure")
        self.assert_finds("map/obstacle_map.cc",
                          "auto t = std::chrono::system_clock::now();\n",
                          "take a Time instead")
        self.assert_clean("server/a.cc", "#include <thread>\n"
                          "auto t = std::chrono::system_clock::now();\n")
        # But for the one that ADR 13 grants, to this file alone.
        path = "map/global/tile_memory.h"
        self.assert_clean(path, header(path, '#include "base/mutex.h"'))
        self.assert_finds(path, header(path, "#include <mutex>"), "pure")
        path = "map/global/tile.h"
        self.assert_finds(path, header(path, '#include "base/mutex.h"'),
                          "pure")

    def test_comments_and_strings_are_not_code(self):
        self.assert_clean("map/local/a.cc",
                          "// std::chrono::system_clock::now() is banned\n"
                          "/*\n#include <thread>\n*/\n"
                          'const char kText[] = "// not a comment";\n')

    def test_a_ban_behind_a_string_is_found(self):
        self.assert_finds("map/local/a.cc",
                          'f(\'"\', "//"); std::chrono::steady_clock::now();\n',
                          "take a Time instead")

    def test_includes_start_at_the_root(self):
        self.assert_finds("map/local/a.cc", '#include "grid.h"\n',
                          'write "map/local/grid.h"')
        self.assert_finds("map/local/a.cc", '#include "../geodesy/frame.h"\n',
                          'write "map/geodesy/frame.h"')

    def test_a_header_guard_names_its_path(self):
        self.assert_finds("map/local/cell.h",
                          "#ifndef CELL_H\n#define CELL_H\n#endif\n",
                          "FATHOM_MAP_LOCAL_CELL_H_")

    def test_a_file_has_at_most_600_lines(self):
        self.assert_clean("map/local/a.cc", "\n" * 600)
        self.assert_finds("map/local/a.cc", "\n" * 601, "split the file")

    def test_an_empty_tree_is_a_mistake(self):
        with tempfile.TemporaryDirectory() as root:
            result = subprocess.run([sys.executable, SCRIPT, root],
                                    capture_output=True, text=True,
                                    check=False)
            self.assertEqual(result.returncode, 2, result.stdout)


if __name__ == "__main__":
    unittest.main()
