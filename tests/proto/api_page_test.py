#!/usr/bin/python3
"""docs/api.md says what the contract says, all of it, and the check that it
does can fail."""

import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")


def check(*arguments):
    return subprocess.run(
        [sys.executable, ROOT / "proto" / "api_page.py", "--check",
         *arguments], capture_output=True, text=True, check=False)


class ApiPage(unittest.TestCase):

    def test_it_is_up_to_date(self):
        done = check()
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_a_changed_comment_is_seen(self):
        with tempfile.TemporaryDirectory() as folder:
            copy = pathlib.Path(folder) / "proto"
            shutil.copytree(ROOT / "proto", copy)
            path = copy / "fathom" / "v1" / "types.proto"
            text = path.read_text(encoding="utf-8")
            self.assertIn("north positive", text)
            path.write_text(text.replace("north positive", "south positive"),
                            encoding="utf-8")
            done = check("--proto-root", copy)
        self.assertEqual(done.returncode, 1)
        self.assertIn("run proto/api_page.py", done.stdout)

    def test_every_name_of_the_contract_is_on_it(self):
        """Read here by pattern, without protoc."""
        names = set()
        for path in (ROOT / "proto" / "fathom" / "v1").glob("*.proto"):
            text = re.sub(r"//.*", "", path.read_text(encoding="utf-8"))
            names.update(re.findall(r"\brpc (\w+)", text))
            names.update(re.findall(r"^(?:message|enum) (\w+)", text, re.M))
            names.update(f"`{name}`" for name in re.findall(
                r"^ +[\w. ]*?(\w+) = \d+;", text, re.M))
        self.assertGreater(len(names), 300)
        self.assertEqual([name for name in sorted(names) if name not in PAGE],
                         [])

    def test_every_link_leads_somewhere(self):
        anchors = {title.lower()
                   for title in re.findall(r"^#+ (\w+)$", PAGE, re.M)}
        links = re.findall(r"\]\(#([^)]+)\)", PAGE)
        self.assertGreater(len(links), 100)
        self.assertEqual([link for link in links if link not in anchors], [])


if __name__ == "__main__":
    unittest.main()
