"""The command line against a server that asks for mutual TLS."""

import shutil
import subprocess
import unittest

from commands_test import OK, UNREACHABLE, run
from live_server import CREATE, FATHOM, ROOT, LiveTest, Server


@unittest.skipUnless(shutil.which("openssl"), "openssl is absent")
class MutualTls(LiveTest):

    def test_certificates_open_the_door_and_nothing_else_does(self):
        pem = self.folder / "pem"
        subprocess.run([ROOT / "deploy" / "make-certificates", pem],
                       check=True, capture_output=True)
        with Server(self.folder / "m.fathom", *CREATE,
                    "--tls-cert", str(pem / "server.pem"),
                    "--tls-key", str(pem / "server.key"),
                    "--tls-client-ca", str(pem / "ca.pem")) as server:
            ours = ["--tls-ca", pem / "ca.pem", "--tls-cert",
                    pem / "client.pem", "--tls-key", pem / "client.key"]
            done = run(FATHOM, *ours, "status", server=server)
            self.assertEqual(done.returncode, OK, done.stderr)
            # Plain text, an authority alone, a stranger's certificate.
            stranger = self.folder / "stranger"
            subprocess.run([ROOT / "deploy" / "make-certificates", stranger],
                           check=True, capture_output=True)
            for flags in ([], ours[:2],
                          [*ours[:2], "--tls-cert", stranger / "client.pem",
                           "--tls-key", stranger / "client.key"],
                          ["--tls-ca", stranger / "ca.pem", *ours[2:]]):
                done = run(FATHOM, "--timeout-s", 2, *flags, "status",
                           server=server)
                self.assertEqual(done.returncode, UNREACHABLE,
                                 (flags, done.stdout, done.stderr))


if __name__ == "__main__":
    unittest.main()
