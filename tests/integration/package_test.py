"""The installed client library as other people use it: into a prefix of its
own, found by find_package(fathom), an example built outside the tree and run
against a live server."""

import os
import pathlib
import re
import shutil
import subprocess
import unittest

from live_server import ROOT, LiveTest, import_chart, point

BUILD = pathlib.Path(os.environ["FATHOM_BUILD"])
EXAMPLES = ROOT / "client" / "examples"


def cached(name):
    """A variable of the build that is tested."""
    cache = (BUILD / "CMakeCache.txt").read_text(encoding="utf-8")
    return re.search(rf"^{name}:\w+=(.*)$", cache, re.MULTILINE).group(1)


class Package(LiveTest):

    def run_tool(self, *command):
        done = subprocess.run(command, capture_output=True, text=True,
                              check=False, timeout=600)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return done.stdout

    def install(self):
        prefix = self.folder / "prefix"
        self.run_tool("cmake", "--install", BUILD, "--component", "client",
                      "--prefix", prefix)
        return prefix

    def test_an_example_outside_the_tree_asks_a_live_server(self):
        prefix = self.install()
        source = self.folder / "source"
        shutil.copytree(EXAMPLES, source)
        build = self.folder / "build"
        sanitize = cached("FATHOM_SANITIZE")
        flags = f"-fsanitize={sanitize}" if sanitize else ""
        self.run_tool(
            "cmake", "-S", source, "-B", build, "-G", "Ninja",
            f"-DCMAKE_PREFIX_PATH={prefix}", f"-DCMAKE_CXX_FLAGS={flags}",
            f"-DCMAKE_CXX_COMPILER={cached('CMAKE_CXX_COMPILER')}",
            "-DCMAKE_CXX_COMPILER_LAUNCHER="
            + (shutil.which("ccache") or ""))
        self.run_tool("cmake", "--build", build, "--target",
                      "example_first_query")
        # Nothing of it comes from the tree.
        commands = (build / "build.ninja").read_text(encoding="utf-8")
        self.assertNotIn(str(ROOT) + "/", commands)
        place = point(100, 100)
        with self.new_mission() as server:
            import_chart(server)  # 30 m +- 4 m.
            printed = self.run_tool(
                build / "first_query", server.address,
                str(place.latitude_deg), str(place.longitude_deg), "20")
        # Phi((20 - 30) / 4) = Phi(-2.5) = 0.0062.
        self.assertEqual(printed.strip(), "FREE: P(obstacle) = 0.0062; "
                         "seabed 30.0 m +- 4.0 m")

    def test_no_installed_file_names_the_tree_it_was_built_in(self):
        prefix = self.install()
        files = [p for p in prefix.rglob("*")
                 if p.suffix in (".cmake", ".h", ".proto")]
        self.assertGreater(len(files), 20)
        for path in files:
            text = path.read_text(encoding="utf-8")
            self.assertNotIn(str(ROOT), text, path)


if __name__ == "__main__":
    unittest.main()
