"""`fathom watch`, which rides on the client library's watches: each kind, and
what a cut does to it."""

import json
import os
import pty
import subprocess
import threading
import unittest

from link_proxy import LinkProxy
from live_server import (DEADLINE_S, FATHOM, LiveTest, START_S, chart_tile,
                         fix_report, import_chart, ping, report_contacts,
                         send_pings, start_activity, wait_until)


class Command:
    """A `fathom watch` whose lines are read as they come."""

    def __init__(self, test, address, *arguments):
        self.process = subprocess.Popen(
            [FATHOM, "--server", address, *arguments],
            stdout=subprocess.PIPE, text=True)
        test.addCleanup(self.end)
        self.lines = []
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.append(line)

    def end(self):
        self.process.kill()
        self.process.wait(timeout=DEADLINE_S)
        self.process.stdout.close()

    def events(self):
        return [json.loads(line) for line in list(self.lines)]

    def progress(self):
        """Revision of the last progress."""
        return max([int(e["stamp"]["map_revision"]) for e in self.events()
                    if "progress" in e], default=0)


class WatchCommand(LiveTest):

    def test_contacts_go_on_after_a_cut_and_after_a_restart(self):
        with self.new_mission() as server:
            proxy = LinkProxy(server.address)
            self.addCleanup(proxy.close)
            report_contacts(server, [fix_report(i, contact=f"ship{i}")
                                     for i in range(1, 21)])
            watch = Command(self, proxy.address, "--json", "watch", "contacts")
            wait_until(lambda: watch.progress() == 20, "the state")
            proxy.cut()
            report_contacts(server, [
                fix_report(20 + i, second=10, contact=f"ship{i}")
                for i in range(1, 11)])
            wait_until(lambda: watch.progress() == 30, "the changes")
            self.assertGreaterEqual(proxy.accepted, 2)
            told = [(e["estimate"]["contact_id"],
                     int(e["estimate"]["report_count"]))
                    for e in watch.events() if "estimate" in e]
            self.assertEqual(
                sorted(told),
                sorted([(f"ship{i}", 1) for i in range(1, 21)]
                       + [(f"ship{i}", 2) for i in range(1, 11)]))
            self.assertFalse([e for e in watch.events() if "resync" in e])
            server.kill()
            with self.reopen() as again:
                proxy.to = ("127.0.0.1", int(again.address.split(":")[1]))
                wait_until(lambda: [e for e in watch.events()
                                    if "resync" in e], "a resynchronisation")
                report_contacts(again, [fix_report(99, contact="late")])
                wait_until(lambda: any(
                    e.get("estimate", {}).get("contact_id") == "late"
                    for e in watch.events()), "what came after the restart")

    def test_a_region_and_its_picture(self):
        with self.new_mission() as server:
            import_chart(server)
            start_activity(server)
            area = ["--activity", "bay", "--resolution-m", "10"]
            watch = Command(self, server.address, "watch", "region", *area)
            wait_until(lambda: any("all told" in line for line in watch.lines),
                       "the state")
            send_pings(server, [ping(1, [(105, 105, 5.0, 0.3)])])
            wait_until(lambda: any("shoalest 5.00 m" in line
                                   for line in watch.lines), "the shoal")
            # In a terminal: a picture with the shoal and its scale.
            master, slave = pty.openpty()
            self.addCleanup(os.close, master)
            shown = subprocess.Popen(
                [FATHOM, "--server", server.address, "watch", "region", *area],
                stdout=slave, stderr=slave)
            os.close(slave)
            text = ""
            while "(shoalest)" not in text:
                text += os.read(master, 65536).decode()
            shown.kill()
            shown.wait(timeout=DEADLINE_S)
            self.assertIn("# 5.0 m (shoalest)   . 30.0 m", text)
            picture = text.split("\x1b[2J")[1]
            # A cell of the map touches 2 x 2 cells of the answer at most.
            shoals = sum(line.count("#") for line in picture.splitlines()[:24])
            self.assertIn(shoals, range(1, 5))

    def test_a_trajectory_alerts(self):
        with self.new_mission() as server:
            import_chart(server, chart_tile(std_m=1.0))
            start_activity(server)
            plan = self.folder / "plan.csv"
            lon = -71.4
            plan.write_text("latitude_deg,longitude_deg,depth_m,time\n"
                            f"41.502296,{lon + 0.0006},10,"
                            "2026-01-01T00:00:00Z\n"
                            f"41.502296,{lon + 0.0054},10,"
                            "2026-01-01T00:05:00Z\n")
            self.assertEqual(START_S, 1_767_225_600)
            watch = Command(self, server.address, "--json", "watch",
                            "trajectory", str(plan), "--radius-m", "5",
                            "--unknown-is-free")
            wait_until(lambda: watch.events(), "the verdict")
            self.assertFalse(watch.events()[0]["alert"])
            send_pings(server, [ping(1, [(255, 305, 3.0, 0.05)])])
            wait_until(lambda: any(e["alert"] for e in watch.events()),
                       "the alert")
            lines = Command(self, server.address, "watch", "trajectory",
                            str(plan), "--radius-m", "5", "--unknown-is-free",
                            "--events", "1")
            self.assertEqual(lines.process.wait(timeout=DEADLINE_S), 0)
            wait_until(lambda: lines.lines, "the line")
            self.assertIn("ALERT, OCCUPIED; conflict on leg 0",
                          lines.lines[0])


if __name__ == "__main__":
    unittest.main()
