"""Contacts through a live server: recorded radar against GPS truth, reports
that come late, outliers, kills between them.

Needs python3-grpcio alone.
"""

import json
import math
import os
import pathlib
import random
import statistics
import unittest

import grpc

from live_server import (DEADLINE_S, START_S, LiveTest, ask, at, fix_report,
                         ingest, mission, obstacle, point, report_contacts, types)

# The radar's frame (contacts/autoferry/README.md).
PIREN = (63.4389029083, 10.39908278)
M_PER_LAT = 111_480.0  # Good to 0.1 % within a kilometre of it.
M_PER_LON = 49_910.0
RADAR = 2
RANGE_STD_M, BEARING_STD_DEG = 4.9, 5.2
OF_TARGET_M = 40


def position(north_m, east_m):
    return types.GeodeticPoint(latitude_deg=PIREN[0] + north_m / M_PER_LAT,
                               longitude_deg=PIREN[1] + east_m / M_PER_LON)


def radar_reports(folder, scenario):
    """The detections of one recording that lie at a target, in order: pairs
    of (report without number, the target's place then)."""
    def read(what):
        path = folder / f"scenario{scenario}_{what}.json"
        return json.loads(path.read_text())
    pairs = []
    for scan, truths in zip(read("detections"), read("groundTruth")):
        measured = scan["measurement"]
        if scan["sensorID"] != RADAR or len(measured) != 2:
            continue
        if isinstance(measured[0], (int, float)):
            measured = [[measured[0]], [measured[1]]]
        own = scan["ownshipPosition"]
        for truth in truths:
            there = truth["position"][:2]
            away = [(math.hypot(n + own[0] - there[0], e + own[1] - there[1]),
                     n, e) for n, e in zip(*measured)]
            off_m, n, e = min(away)
            if off_m > OF_TARGET_M:
                continue
            report = ingest.ContactReport(
                source_id="radar", epoch=1,
                contact_id=f"s{scenario}.{truth['targetID']}",
                contact_class=types.CONTACT_CLASS_SMALL_CRAFT)
            report.time.FromMicroseconds(round(scan["time"] * 1e6))
            seen = report.range_bearing
            seen.pose.position.CopyFrom(position(*own))
            seen.range_m = math.hypot(n, e)
            seen.bearing_deg = math.degrees(math.atan2(e, n))
            seen.range_std_m = RANGE_STD_M
            seen.bearing_std_deg = BEARING_STD_DEG
            pairs.append((report, there))
    return pairs


def stream(server, reports, first=1):
    """Numbers and sends reports on one stream; returns the rejections."""
    for number, report in enumerate(reports, first):
        report.sequence = number
    rejections = []
    for ack in server.ingest.StreamContacts(
            iter([ingest.StreamContactsRequest(report=r) for r in reports]),
            timeout=DEADLINE_S):
        rejections += ack.rejections
    return rejections


def history(server, source, contact):
    return [estimate for part in server.obstacle.GetContactHistory(
        obstacle.GetContactHistoryRequest(source_id=source,
                                          contact_id=contact),
        timeout=DEADLINE_S) for estimate in part.estimates]


class RecordedRadar(LiveTest):
    """Five recordings of two boats each, against their GPS."""

    def test_tracks_are_kept_through_a_kill(self):
        folder = pathlib.Path(os.environ["FATHOM_SHARED_DATA_DIR"])
        folder = folder / "contacts" / "autoferry"
        if not folder.is_dir():
            self.skipTest(f"no recordings in {folder}")
        pairs = [pair for scenario in (2, 3, 4, 5, 13)
                 for pair in radar_reports(folder, scenario)]
        pairs.sort(key=lambda pair: pair[0].time.ToMicroseconds())
        reports = [report for report, _ in pairs]
        half = len(reports) // 2
        with self.new_mission() as server:
            rejections = stream(server, reports[:half])
            server.kill()
        with self.reopen() as server:
            rejections += stream(server, reports[half:], first=half + 1)
            status = server.status()
            places = {}
            for report, there in pairs:
                places.setdefault(report.contact_id, {})[
                    report.time.ToMicroseconds()] = there
            rmse_m = []
            for contact, truths in places.items():
                squares = []
                for estimate in history(server, "radar", contact):
                    there = truths[estimate.time.ToMicroseconds()]
                    north_m = (estimate.position.latitude_deg
                               - PIREN[0]) * M_PER_LAT
                    east_m = (estimate.position.longitude_deg
                              - PIREN[1]) * M_PER_LON
                    squares.append((north_m - there[0]) ** 2
                                   + (east_m - there[1]) ** 2)
                rmse_m.append(math.sqrt(statistics.fmean(squares)))
                # Fused, all but what the gate refused.
                self.assertGreaterEqual(len(squares), 0.95 * len(truths))
        self.assertEqual(len(rmse_m), 10)
        self.assertEqual(status.contacts.live, 10)
        self.assertLess(len(rejections), 0.02 * len(reports))
        for rejection in rejections:
            self.assertEqual(rejection.reason, types.REJECT_REASON_GATED)
        print(f"{len(reports)} radar reports, 10 tracks, {len(rejections)} "
              f"gated: median rmse {statistics.median(rmse_m):.1f} m as "
              "recorded, biases and all (plain filter 8.0 m)")
        self.assertLess(statistics.median(rmse_m), 11)


class LateReports(LiveTest):
    def test_the_order_of_arrival_does_not_matter(self):
        draw = random.Random(4)
        reports = []
        for i in range(80):
            report = fix_report(1, 1000 + 5 * i, 0, second=i, vn=5.0, ve=0.0)
            if i % 10 != 0:
                report.range_bearing.pose.position.CopyFrom(
                    fix_report(1).fix.position)
                report.range_bearing.range_m = 1000 + 5 * i + draw.gauss(0, 5)
                report.range_bearing.bearing_deg = draw.gauss(0, 1)
                report.range_bearing.range_std_m = 5
                report.range_bearing.bearing_std_deg = 1
            if i in (7, 33, 46, 59, 72):
                report.range_bearing.bearing_deg += 60  # An outlier.
            reports.append(report)
        late = sorted(range(80), key=lambda i: i + draw.uniform(0, 40))
        with self.new_mission(name="a.fathom") as server:
            gated = stream(server, reports)
            ordered = history(server, "c4i", "ship")
        with self.new_mission(name="b.fathom") as server:
            stream(server, [reports[i] for i in late[:40]])
            server.kill()
        with self.reopen("b.fathom") as server:
            stream(server, [reports[i] for i in late[40:]], first=41)
            self.assertEqual(history(server, "c4i", "ship"), ordered)
            digest = server.status(digest=True).map_digest
            server.kill()
        with self.reopen("b.fathom") as server:
            self.assertEqual(server.status(digest=True).map_digest, digest)
            self.assertEqual(history(server, "c4i", "ship"), ordered)
        self.assertEqual(len(gated), 5)
        self.assertEqual(len(ordered), 75)

    def test_older_than_the_window_is_refused_with_the_reason(self):
        with self.new_mission() as server:
            for number, second in ((1, 100), (2, 40), (3, 39)):
                answer = report_contacts(server, [
                    fix_report(number, second=second, ve=0.0)])
                self.assertEqual(answer.reports_applied, int(second >= 40))
            self.assertEqual(answer.rejections[0].reason,
                             types.REJECT_REASON_TOO_LATE)
            self.assertIn("60 s", answer.rejections[0].description)
            self.assertEqual(server.status().contacts.live, 1)


class Outliers(LiveTest):
    def test_one_is_refused_and_the_second_that_agrees_begins_anew(self):
        with self.new_mission() as server:
            answer = report_contacts(server, [
                fix_report(1, second=0, ve=0.0),
                fix_report(2, 90_000, second=10, ve=0.0),
                fix_report(3, second=20, ve=0.0)])
            self.assertEqual([(r.sequence, r.reason)
                              for r in answer.rejections],
                             [(2, types.REJECT_REASON_GATED)])
            # Two that agree: the contact is there.
            answer = report_contacts(server, [
                fix_report(4, 90_000, second=30, ve=0.0),
                fix_report(5, 90_000, second=40, ve=0.0)])
            self.assertEqual(answer.reports_applied, 1)
            track = history(server, "c4i", "ship")
            self.assertEqual([e.time.seconds - START_S for e in track],
                             [0, 20, 30, 40])
            self.assertEqual(track[-1].report_count, 2)
            gated = {r.reason: r.count for r in
                     server.status().contacts.rejects}
            self.assertEqual(gated[types.REJECT_REASON_GATED], 2)


class LinkedNames(LiveTest):
    """One ship under two sources' names, linked by C4I."""

    def heard(self, sequence, second):
        report = fix_report(sequence, second=second, contact="S1",
                            source="sonar")
        report.range_bearing.pose.position.CopyFrom(point(0, 0))
        report.range_bearing.range_m = 1000
        report.range_bearing.bearing_deg = 0
        report.range_bearing.range_std_m = 5
        report.range_bearing.bearing_std_deg = 1
        return report

    def told(self, sequence, second, *names):
        report = fix_report(sequence, 1000, second=second, contact="T9",
                            vn=0.0, ve=0.0)
        report.same_as.SetInParent()
        for source, contact in names:
            report.same_as.names.add(source_id=source, contact_id=contact)
        return report

    def test_are_one_track_through_a_kill_until_it_is_undone(self):
        names = [("sonar", "S1")]
        with self.new_mission() as server:
            for report in (self.heard(1, 0), self.told(1, 10, *names),
                           self.heard(2, 20)):
                answer = report_contacts(server, [report])
                self.assertEqual(answer.reports_applied, 1)
            digest = server.status(digest=True).map_digest
            server.kill()
        with self.reopen() as server:
            status = server.status(digest=True)
            self.assertEqual(status.map_digest, digest)
            self.assertEqual(status.contacts.live, 1)
            [only] = server.obstacle.ListContacts(
                obstacle.ListContactsRequest(time=at(20)),
                timeout=DEADLINE_S).contacts
            self.assertEqual(only.contact_id, "T9")
            self.assertEqual(only.report_count, 2)
            [other] = only.also_known_as
            self.assertEqual((other.source_id, other.contact_id), names[0])
            [evidence] = ask(server, 1000, 0, depth_m=1.0,
                             second=20).answer.contacts
            self.assertEqual(evidence.contact_id, "T9")
            self.assertEqual(evidence.also_known_as[0].contact_id, "S1")
            # The history of both has what both told; the sonar's says where
            # its own track went on.
            self.assertEqual(
                [(e.time.seconds - START_S, e.report_count)
                 for e in history(server, "c4i", "T9")], [(10, 1), (20, 2)])
            track = history(server, "sonar", "S1")
            self.assertEqual([(e.time.seconds - START_S, e.status,
                               [n.contact_id for n in e.also_known_as])
                              for e in track],
                             [(0, types.CONTACT_STATUS_NEW, []),
                              (10, types.CONTACT_STATUS_DROPPED, ["T9"]),
                              (20, types.CONTACT_STATUS_ACTIVE, ["T9"])])
            report_contacts(server, [self.told(2, 30)])
            report_contacts(server, [self.heard(3, 40)])
            self.assertEqual(server.status().contacts.live, 2)

    def test_what_cannot_be_linked_says_so(self):
        with self.new_mission() as server:
            report = self.told(1, 0, ("sonar", "S1"))
            report.ClearField("fix")
            [rejection] = report_contacts(server, [report]).rejections
            self.assertEqual(rejection.reason, types.REJECT_REASON_BAD_LINK)
            self.assertIn("none of those named is live",
                          rejection.description)


class PastOfHours(LiveTest):
    """Where a ship was an hour ago, among thousands of reports since."""

    def test_is_smoothed_and_the_same_after_restarts(self):
        # North at 0.5 m/s, weaving east and west by 100 m in half an hour; heard
        # every 2 s from 3 km off for 80 minutes, gone from 20 to 25.
        draw = random.Random(8)

        def true_m(second):
            return 0.5 * second, 100 * math.sin(2 * math.pi * second / 1800)
        seconds = [s for s in range(0, 4801, 2) if not 1200 < s < 1500]
        reports = []
        for second in seconds:
            north_m, east_m = true_m(second)
            report = fix_report(1, second=second)
            seen = report.range_bearing
            seen.pose.position.CopyFrom(point(north_m, east_m - 3000))
            seen.range_m = 3000 + draw.gauss(0, 10)
            seen.bearing_deg = 90 + draw.gauss(0, 1)
            seen.range_std_m, seen.bearing_std_deg = 10, 1
            reports.append(report)
        asked = [s for s in range(100, 4800, 61) if not 1200 < s < 1500]

        def there(server, second):
            return list(server.obstacle.ListContacts(
                obstacle.ListContactsRequest(time=at(second)),
                timeout=DEADLINE_S).contacts)

        def check(server):
            answers = []
            within = 0
            for second in asked:
                [estimate] = there(server, second)
                north_m, east_m = true_m(second)
                place = point(north_m, east_m)
                off_m = (
                    (estimate.position.latitude_deg - place.latitude_deg)
                    * 111_060,
                    (estimate.position.longitude_deg - place.longitude_deg)
                    * 83_500)
                # The upper triangle, row by row.
                nn, ne, _, _, ee = estimate.covariance[:5]
                squared = (ee * off_m[0]**2 - 2 * ne * off_m[0] * off_m[1]
                           + nn * off_m[1]**2) / (nn * ee - ne * ne)
                within += squared < 9.21  # 99 % of two dimensions.
                # An hour ago and more as sure as the noise allows.
                self.assertLess(math.sqrt(max(nn, ee)), 40, second)
                answers.append(estimate)
            self.assertGreater(within, 0.93 * len(asked))
            hits = [ask(server, *true_m(second), depth_m=1.0, second=second)
                    .answer for second in asked[:20]]
            for hit in hits:
                self.assertEqual(hit.contacts[0].contact_id, "ship")
                self.assertGreater(hit.contacts[0].probability, 0.5)
            # Half a mile beside it there was nothing.
            for second in asked[:20]:
                north_m, east_m = true_m(second)
                self.assertEqual(
                    len(ask(server, north_m, east_m + 900, depth_m=1.0,
                            second=second).answer.contacts), 0)
            self.assertEqual(there(server, 1400), [])
            return answers, [hit.SerializeToString() for hit in hits]

        with self.new_mission() as server:
            split = seconds.index(1200) + 1
            self.assertEqual(stream(server, reports[:split]), [])
            server.mission.DropContact(
                mission.DropContactRequest(source_id="c4i", contact_id="ship",
                                           time=at(1201)), timeout=DEADLINE_S)
            self.assertEqual(stream(server, reports[split:], first=split + 1),
                             [])
            answers = check(server)
            digest = server.status(digest=True).map_digest
            server.kill()
        with self.reopen() as server:
            self.assertEqual(check(server), answers)
            self.assertEqual(server.terminate(), 0)
        with self.reopen() as server:
            self.assertEqual(check(server), answers)
            self.assertEqual(server.status(digest=True).map_digest, digest)


class PastByPlace(LiveTest):
    """Who passed through an area; how much of the past is kept."""

    def within(self, server, south_west, north_east, **fields):
        return [(e.contact_id, e.time.seconds - START_S)
                for part in server.obstacle.GetContactHistory(
                    obstacle.GetContactHistoryRequest(
                        south_west=south_west, north_east=north_east,
                        **fields), timeout=DEADLINE_S)
                for e in part.estimates]

    def test_an_area_and_a_time_find_all_who_were_there(self):
        # Two ships eastwards at 5 m/s, 1 km apart, for 300 s.
        reports = [fix_report(2 * i + n, 1000 * n, 5 * i, second=i,
                              contact=["south", "north"][n])
                   for i in range(1, 301) for n in (0, 1)]
        with self.new_mission() as server:
            self.assertEqual(stream(server, reports), [])

            def check():
                # East 100 to 200 m: seconds 20 to 40, borders within 1 m.
                middle = [("south", t) for t in range(20, 41)]
                self.assertEqual(
                    self.within(server, point(-10, 99), point(10, 201)),
                    middle)
                self.assertEqual(
                    self.within(server, point(-10, 99), point(1010, 201),
                                start_time=at(30), end_time=at(32)),
                    [("north", t) for t in (30, 31, 32)]
                    + [("south", t) for t in (30, 31, 32)])
                self.assertEqual(
                    self.within(server, point(-10, 99), point(1010, 201),
                                source_id="c4i", contact_id="south"), middle)
                self.assertEqual(
                    self.within(server, point(2000, 0), point(3000, 900)), [])
            check()
            server.kill()
        with self.reopen() as server:
            check()
            self.assertEqual(server.terminate(), 0)
        with self.reopen() as server:
            check()
            kept = server.status().storage.contact_history
            self.assertEqual(kept.estimates, 600)
            self.assertEqual(kept.forgotten_estimates, 0)
            self.assertFalse(kept.HasField("max_age_s"))
            call = server.obstacle.GetContactHistory
            request = obstacle.GetContactHistoryRequest
            self.assert_field("north_east", call,
                              request(south_west=point(0, 0)))
            self.assert_field("south_west", call,
                              request(north_east=point(0, 0)))
            self.assert_field("north_east", call,
                              request(south_west=point(0, 0),
                                      north_east=point(-1, 1)))
            self.assert_field("source_id", call,
                              request(south_west=point(0, 0),
                                      north_east=point(1, 1), contact_id="x"))

    def test_what_is_too_old_is_forgotten_and_counted(self):
        # 1000 s of one ship; the last 500 s and what shares their block stay.
        day_s = 86_400
        with self.new_mission("--history-max-age-days",
                              str(500 / day_s)) as server:
            self.assertEqual(stream(server, [
                fix_report(i, 0, 5 * i, second=i)
                for i in range(1, 1001)]), [])
            # The end makes a snapshot.
            self.assertEqual(server.terminate(), 0)
        with self.reopen() as server:
            kept = server.status().storage.contact_history
            self.assertGreaterEqual(kept.estimates, 500)
            self.assertLessEqual(kept.estimates, 500 + 256)
            self.assertEqual(kept.estimates + kept.forgotten_estimates, 1000)
            left = history(server, "c4i", "ship")
            self.assertEqual(len(left), kept.estimates)
            self.assertEqual(left[-1].time.seconds, START_S + 1000)


class TooManyIds(LiveTest):
    def test_ten_thousand_at_once(self):
        reports = [fix_report(i, 0, i % 5000, contact=f"c{i}")
                   for i in range(1, 10_001)]
        with self.new_mission() as server:
            error = self.assert_status(
                grpc.StatusCode.RESOURCE_EXHAUSTED,
                server.ingest.ReportContacts,
                ingest.ReportContactsRequest(reports=reports))
            self.assertIn("1000", error.details())
            self.assertEqual(server.status().contacts.live, 0)
            # On a stream: as many as there is room for, the rest by reason.
            rejections = stream(server, reports)
            self.assertEqual({r.reason for r in rejections},
                             {types.REJECT_REASON_CONTACTS_FULL})
            status = server.status().contacts
            self.assertEqual(status.live, status.max_contacts)
            self.assertEqual({r.reason: r.count for r in status.rejects},
                             {types.REJECT_REASON_CONTACTS_FULL:
                              10_000 - status.max_contacts})


if __name__ == "__main__":
    unittest.main()
