"""Completion for bash: what it offers is what --help lists, for every verb."""

import pathlib
import re
import subprocess
import tempfile
import unittest

from live_server import FATHOM


def help_of(*verb):
    return subprocess.run([FATHOM, *verb, "--help"], capture_output=True,
                          text=True, check=True).stdout


def subcommands(text):
    """The verbs that a help text lists."""
    part = re.search(r"^Subcommands:\n((?:  .*\n)+)", text, re.MULTILINE)
    return re.findall(r"^  ([a-z]+)", part.group(1), re.MULTILINE) \
        if part else []


def flags(text):
    """The flags that a help text lists."""
    return set(re.findall(r"^  (?:-\w,)?(--[a-z0-9-]+)", text, re.MULTILINE))


class Completion(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.script = subprocess.run([FATHOM, "completion"],
                                    capture_output=True, text=True,
                                    check=True).stdout

    def complete(self, *words):
        """What bash offers for the last of `words`."""
        quoted = " ".join(f"'{word}'" for word in ("fathom",) + words)
        done = subprocess.run(
            ["bash", "--norc", "-uc", self.script + f"""
COMP_WORDS=({quoted})
COMP_CWORD={len(words)}
_fathom
printf '%s\\n' "${{COMPREPLY[@]-}}"
"""], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        return set(done.stdout.split())

    def test_every_verb_and_flag_that_help_lists_is_offered(self):
        top = help_of()
        verbs = subcommands(top)
        self.assertIn("query", verbs)
        self.assertEqual(self.complete(""), set(verbs))
        everywhere = flags(top) - {"--version"}
        self.assertIn("--server", everywhere)
        ways = [(verb,) for verb in verbs]
        for verb in verbs:
            below = subcommands(help_of(verb))
            if below:
                self.assertEqual(self.complete(verb, ""), set(below), verb)
                ways += [(verb, sub) for sub in below]
        self.assertGreater(len(ways), 15)
        for way in ways:
            listed = flags(help_of(*way))
            offered = self.complete(*way, "--")
            self.assertGreaterEqual(offered, listed | everywhere, way)

    def test_a_prefix_narrows(self):
        self.assertEqual(self.complete("ne"), {"nearest"})
        self.assertEqual(self.complete("query", "--conf"), {"--confidence"})

    def test_values_of_a_few_words_are_offered(self):
        self.assertEqual(
            self.complete("activity", "start", "--estimator", ""),
            {"adaptive", "kalman", "nervegna"})
        self.assertEqual(self.complete("export", "--format", "b"), {"bag"})

    def test_other_values_are_left_to_bash(self):
        self.assertEqual(self.complete("query", "--points-file", ""), set())
        # Not the verbs: a server's name is expected.
        self.assertEqual(self.complete("--server", ""), set())
        self.assertEqual(self.complete("query", "--server", ""), set())
        # Behind one that takes no value, another flag may follow.
        self.assertIn("--server", self.complete("query", "--json", "--s"))
        # A flag of another verb is none of this one's.
        self.assertNotIn("--estimator", self.complete("query", "--"))

    def test_it_is_registered_and_bash_understands_it(self):
        self.assertIn("complete -o default -F _fathom fathom", self.script)
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "fathom"
            path.write_text(self.script, encoding="utf-8")
            done = subprocess.run(["bash", "--norc", "-n", path], check=False)
            self.assertEqual(done.returncode, 0)


if __name__ == "__main__":
    unittest.main()
