"""Clients that share no code with us: @grpc/grpc-js, buf curl by reflection,
and the README's first queries as they stand there."""

import json
import os
import pathlib
import re
import subprocess
import sys
import textwrap
import unittest

import node_tools
from live_server import (DEADLINE_S, FATHOM, ROOT, LiveTest, Server,
                         import_chart)
from node_tools import BUF, NODE

ETOPO = pathlib.Path("/usr/share/ferret-vis/data/etopo5.cdf")


setUpModule = node_tools.install


class GrpcJs(LiveTest):

    def run_script(self, server, name):
        return subprocess.run(
            ["node", NODE / name, server.address, ROOT / "proto"],
            capture_output=True, text=True, check=False,
            timeout=4 * DEADLINE_S)

    def test_the_main_job(self):
        with self.new_mission() as server:
            done = self.run_script(server, "main_job.mjs")
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            self.assertIn("all held", done.stdout)
            self.assertFalse(server.status().activities[0].open)

    def test_every_call(self):
        with self.new_mission() as server:
            done = self.run_script(server, "every_call.mjs")
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            self.assertIn("all held", done.stdout)
            self.assertTrue((self.folder / "copy.fathom").exists())

    def test_the_script_fails_where_the_answers_are_others(self):
        with self.new_mission() as server:
            import_chart(server)  # It expects a new mission.
            done = self.run_script(server, "main_job.mjs")
            self.assertNotEqual(done.returncode, 0)
            self.assertIn("AssertionError", done.stderr)


class BufCurl(LiveTest):

    def curl(self, server, method, request):
        return subprocess.run(
            [BUF, "curl", "--protocol", "grpc", "--http2-prior-knowledge",
             "-d", json.dumps(request),
             f"http://{server.address}/{method}"],
            capture_output=True, text=True, check=False, timeout=DEADLINE_S)

    def test_every_service_by_reflection(self):
        with self.new_mission() as server:
            done = self.curl(server, "fathom.v1.MissionService/"
                             "GetMissionStatus", {})
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(json.loads(done.stdout)["verticalDatum"], "MLLW")
            place = {"latitudeDeg": 41.5, "longitudeDeg": -71.4}
            done = self.curl(server, "fathom.v1.IngestService/ReportContacts",
                             {"reports": [{
                                 "sourceId": "buf", "epoch": 1, "sequence": 1,
                                 "contactId": "ship", "time":
                                 "2026-01-01T00:00:00Z",
                                 "contactClass": "CONTACT_CLASS_VESSEL",
                                 "fix": {"position": place}}]})
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(json.loads(done.stdout)["reportsApplied"], "1")
            # The ship alone makes an unknown place occupied.
            done = self.curl(server, "fathom.v1.ObstacleService/QueryObstacle",
                             {"position": place, "depthM": 1,
                              "confidence": 0.95,
                              "time": "2026-01-01T00:00:00Z"})
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(json.loads(done.stdout)["answer"]["state"],
                             "OBSTACLE_STATE_OCCUPIED")
            done = self.curl(server, "grpc.health.v1.Health/Check", {})
            self.assertEqual(json.loads(done.stdout)["status"], "SERVING")

    def test_a_refusal_is_decoded(self):
        with self.new_mission() as server:
            done = self.curl(server, "fathom.v1.ObstacleService/QueryObstacle",
                             {"position": {"latitudeDeg": 95},
                              "confidence": 0.95})
            self.assertNotEqual(done.returncode, 0)
            error = json.loads(done.stderr)
            self.assertEqual(error["code"], "invalid_argument")
            self.assertIn("position.latitude_deg", error["message"])
            kinds = [d["type"] for d in error["details"]]
            self.assertIn("google.rpc.BadRequest", kinds)


class Readme(LiveTest):
    """Runs the fenced blocks of README.md behind "A first query", only their
    address replaced."""

    def blocks(self, server):
        text = (ROOT / "README.md").read_text(encoding="utf-8")
        section = text.split("## A first query", 1)[1].split("\n## ", 1)[0]
        found = re.findall(r"```(sh|python)\n(.*?)```", section, re.DOTALL)
        return [(language, re.sub(r"127\.0\.0\.1:\d+", server.address, code))
                for language, code in found]

    @unittest.skipUnless(ETOPO.exists(), f"{ETOPO} is not installed")
    def test_the_first_queries(self):
        with Server(self.folder / "m.fathom", "--create", "--center",
                    "41.6,-71.4", "--side-nmi", "1267") as server:
            blocks = self.blocks(server)
            self.assertEqual([language for language, _ in blocks],
                             ["sh", "sh", "sh", "python"])
            start, command_line, curl, python = [code for _, code in blocks]
            # The first starts the server; ours runs already, with its flags.
            for flag in ("--create", "--center", "41.6,-71.4", "1267"):
                self.assertIn(flag, start)

            environment = dict(
                os.environ, FATHOM_SERVER=server.address,
                PATH=os.pathsep.join([str(pathlib.Path(FATHOM).parent),
                                      str(BUF.parent), os.environ["PATH"]]))

            def run(*command):
                done = subprocess.run(
                    command, capture_output=True, text=True, check=False,
                    env=environment, cwd=self.folder, timeout=4 * DEADLINE_S)
                self.assertEqual(done.returncode, 0,
                                 done.stdout + done.stderr)
                return done.stdout
            answer = run("bash", "-euc", command_line)
            self.assertRegex(answer, r"(FREE|OCCUPIED|UNCERTAIN) at 95 %")
            self.assertIn("prior", answer)
            stated = float(re.search(r"P\(obstacle\) = ([0-9.e-]+)",
                                     answer).group(1))

            document = json.loads(run("bash", "-euc", curl))
            self.assertAlmostEqual(document["answer"].get("probability", 0),
                                   stated, 5)
            self.assertEqual(document["answer"]["seabed"]["kind"],
                             "EVIDENCE_KIND_PRIOR")

            script = self.folder / "first_query.py"
            script.write_text(textwrap.dedent(f"""\
                import sys
                sys.path.insert(0, {str(ROOT / "tests" / "testing")!r})
                import fathom_stubs
                fathom_stubs.use({os.environ["FATHOM_STUBS"]!r})
                """) + python)
            printed = run(sys.executable, script)
            self.assertIn("EVIDENCE_KIND_PRIOR", printed)
            self.assertNotIn("<class", printed)


if __name__ == "__main__":
    unittest.main()
