"""Reads the golden missions by docs/storage_format.md alone: every page's
checksum, every blob to its last byte. If this and the page do not agree, one
of them is wrong."""

import ctypes
import datetime
import pathlib
import sqlite3
import struct
import unittest

GOLDEN = pathlib.Path(__file__).resolve().parents[1] / "golden"
PAGE = 8192
ZSTD = ctypes.CDLL("libzstd.so.1")
ZSTD.ZSTD_decompress.restype = ctypes.c_size_t
# 2026-01-01T00:00:00Z: tests/integration/live_server.py.
START_US = 1_767_225_600_000_000


def make_crc_table():
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = byte >> 1 ^ (0x82F63B78 if byte & 1 else 0)
        table.append(byte)
    return table


CRC_TABLE = make_crc_table()


def crc32c(content):
    crc = 0xFFFFFFFF
    for byte in content:
        crc = crc >> 8 ^ CRC_TABLE[(crc ^ byte) & 0xFF]
    return crc ^ 0xFFFFFFFF


class Reader:
    """Little-endian, from the front."""

    def __init__(self, content):
        self.content = content
        self.at = 0

    def take(self, size):
        if self.at + size > len(self.content):
            raise ValueError("ends too early")
        self.at += size
        return self.content[self.at - size:self.at]

    def get(self, layout):
        values = struct.unpack("<" + layout,
                               self.take(struct.calcsize("<" + layout)))
        return values[0] if len(values) == 1 else values

    def varint(self):
        value = shift = 0
        while True:
            byte = self.get("B")
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                return value
            shift += 7

    def string(self):
        return self.take(self.varint()).decode()

    def plane(self, size):
        mode = self.get("B")
        if mode == 0:
            return self.take(1) * size
        if mode == 1:
            return self.take(size)
        frame = self.take(self.varint())
        out = ctypes.create_string_buffer(size)
        got = ZSTD.ZSTD_decompress(out, size, frame, len(frame))
        if mode != 2 or got != size:
            raise ValueError(f"plane of mode {mode}")
        return out.raw

    def column(self, count, layout):
        """`count` elements, each as struct says."""
        if count == 0:
            return []
        width = struct.calcsize("<" + layout)
        planes = [self.plane(count) for _ in range(width)]
        values = [struct.unpack("<" + layout, bytes(p[i] for p in planes))
                  for i in range(count)]
        return [v[0] if len(v) == 1 else v for v in values]

    def rows(self, count, width):
        plane = self.plane(count * width)
        return [plane[i::count] for i in range(count)]

    def names(self):
        return [(self.string(), self.string()) for _ in range(self.varint())]

    def point(self):
        """242 bytes."""
        values = self.get("BB3q2d4d16d3ddQ")
        return {"status": values[1], "time_us": values[2],
                "latitude_deg": values[5], "north_m_s": values[9],
                "report_count": values[-1]}

    def report(self):
        """Record 2 of the journal, from its flags on."""
        flags, contact_class = self.get("BB")
        report = {"class": contact_class, "time_us": self.get("q")}
        if flags & 1:
            report["fix"] = self.get("6d")
        elif not flags & 32:
            report["polar"] = self.get("9d")
        for flag, name in ((2, "depth_m"), (4, "depth_std_m")):
            if flags & flag:
                report[name] = self.get("d")
        if flags & 16:
            report["names"] = self.names()
        return report

    def activity_start(self):
        start = {"id": self.string(), "vehicle": self.string(),
                 "start_us": self.get("q")}
        start["south_west_deg"] = self.get("2d")
        start["extent_m"] = self.get("2d")
        start["cell_size_m"] = self.get("d")
        start["estimator"] = self.get("B")
        self.get("4d")
        for _ in range(2):
            if self.get("B"):
                self.get("f")
        return start


def open_blob(blob, kind, versions):
    """Its payload's reader and its version."""
    head = struct.unpack("<BBHI", blob[:8])
    assert head[0] == ord(kind) and head[1] in versions and head[2] == 0, head
    assert crc32c(blob[:4] + struct.pack("<I", crc32c(blob[8:]))) == head[3]
    return Reader(blob[8:]), head[1]


class FormatPage(unittest.TestCase):

    def open(self, name):
        path = GOLDEN / name
        content = path.read_bytes()
        self.assertEqual(content[:16], b"SQLite format 3\0")
        self.assertEqual(content[20], 4)
        self.assertEqual(struct.unpack(">I", content[68:72])[0], 0x4674686D)
        self.assertEqual(struct.unpack(">I", content[60:64])[0], 9)
        for number in range(1, len(content) // PAGE + 1):
            page = content[(number - 1) * PAGE:number * PAGE]
            if any(page):
                self.assertEqual(
                    crc32c(struct.pack("<II", number, crc32c(page[:-4]))),
                    struct.unpack("<I", page[-4:])[0], f"page {number}")
        database = sqlite3.connect(f"file:{path}?mode=ro&immutable=1",
                                   uri=True)
        self.addCleanup(database.close)
        return database

    def assert_end(self, reader):
        self.assertEqual(reader.at, len(reader.content))

    def test_tiles(self):
        leaves = 0
        for key, blob in self.open("mission-v9.fathom").execute(
                "SELECT tile_key, content FROM tile"):
            tile, _ = open_blob(blob, "T", (2,))
            self.assertEqual(tile.get("Q"), key)
            count, flags = tile.varint(), tile.get("B")
            levels = tile.column(count, "B")
            tile.column(count, "f")
            tile.column(count, "H")
            tile.column(count, "I")
            for flag in (1, 2):
                if flags & flag:
                    tile.column(count, "B")
            if flags & 4:
                hazards = tile.varint()
                tile.column(hazards, "H")
                tile.column(hazards, "f")
            self.assert_end(tile)
            # At most six levels below its root: 4096 cells in all.
            self.assertEqual(sum(4**(6 - level) for level in levels), 4096)
            leaves += count
        self.assertGreater(leaves, 9)

    def test_activities_and_their_blocks(self):
        database = self.open("mission-v9-closed.fathom")
        activities = {}
        for number, name, blob in database.execute(
                "SELECT activity_number, activity_id, content FROM activity"):
            activity, _ = open_blob(blob, "A", (1,))
            start = activity.activity_start()
            self.assertEqual(start["id"], name)
            opened, accepted, measured = activity.get("BQQ")
            activity.get(f"{activity.get('B')}Q")
            self.assert_end(activity)
            activities[name] = (number, opened, accepted, measured)
        # tests/golden/make: 30 pings of one beam each, over nine cells.
        self.assertEqual(activities, {"first": (1, 0, 30, 9),
                                      "second": (2, 1, 30, 9)})
        touched = 0
        for key, blob in database.execute(
                "SELECT block_key, content FROM local_block"):
            self.assertEqual(key >> 32, 2)
            block, _ = open_blob(blob, "B", (3,))
            self.assertEqual(block.get("Q"), key)
            flags = block.get("B")
            block.get("fffB")
            block.get("I")
            cells = sum(bin(byte).count("1") for byte in block.take(32))
            evidence = block.column(cells * (2 if flags & 1 else 1), "fffII")
            # The last of the 32 bits: measured.
            touched += sum(e[4] >> 31 for e in evidence[:cells])
            if flags & 2:
                for layout in "ffB" + ("f" if flags & 16 else ""):
                    block.column(256, layout)
            if flags & 4:
                block.column(256, "ff")
            if flags & 8:
                block.column(block.varint(), "ffIHH")
            self.assert_end(block)
        self.assertEqual(touched, 9)

    def test_contacts_and_their_history(self):
        database = self.open("mission-v9-closed.fathom")
        names = {}
        for number, source, contact, blob in database.execute(
                "SELECT contact_number, source_id, contact_id, content FROM "
                "contact"):
            held, version = open_blob(blob, "C", (2, 3, 4))
            self.assertEqual((held.string(), held.string()), (source, contact))
            points = [Reader(row).point()
                      for row in held.rows(held.varint(), 242)]
            for _ in range(held.varint()):
                self.assertLessEqual(held.get("B"), 3)
                held.report()
            linked = version == 3
            # tests/golden/make: one contact has 300 estimates, 256 of them
            # newest and the rest too far apart to pass over any.
            self.assertEqual(version == 4, contact == "trawler")
            if version == 4:
                older = [Reader(row).point()
                         for row in held.rows(held.varint(), 242)]
                self.assertEqual([p["time_us"] for p in older],
                                 [START_US + 30_000_000 * i
                                  for i in range(1, 45)])
                linked = held.get("B") == 1
            if linked:
                held.get("q")
                held.names()
            self.assert_end(held)
            self.assertEqual([p["time_us"] for p in points],
                             sorted(p["time_us"] for p in points))
            names[number] = contact
        counted = {}
        for number, first, last, revision, count, blob in database.execute(
                "SELECT contact_number, first_time_us, last_time_us, "
                "last_revision, estimate_count, content FROM "
                "contact_history"):
            block, _ = open_blob(blob, "H", (1,))
            self.assertEqual(block.get("q"), number)
            rows = [Reader(row) for row in block.rows(block.varint(), 250)]
            revisions = [row.get("Q") for row in rows]
            times = [row.point()["time_us"] for row in rows]
            for _ in range(block.varint()):
                block.varint()
                block.names()
            self.assert_end(block)
            self.assertEqual((times[0], times[-1], max(revisions), len(rows)),
                             (first, last, revision, count))
            counted[names[number]] = counted.get(names[number], 0) + count
        # Ten reports each, and the drop of one.
        self.assertEqual(counted, {"ship": 10, "boat": 11, "trawler": 300})
        self.assertEqual(
            database.execute("SELECT estimate_count, forgotten_count FROM "
                             "contact_history_total").fetchall(), [(321, 0)])

    def geometry(self, blob, kind):
        """Longitudes and latitudes, all together."""
        head = struct.unpack("<2sBBiBI", blob[:13])
        self.assertEqual(head, (b"GP", 0, 1, 4326, 1, kind))
        count, at = (1, 13) if kind == 1 else (
            struct.unpack("<I", blob[13:17])[0], 17)
        return struct.unpack(f"<{2 * count}d", blob[at:])

    def test_features(self):
        database = self.open("mission-v9-closed.fathom")
        blocks = database.execute(
            "SELECT block_id, contact_number, source_id, contact_id, "
            "first_time_us, last_time_us, estimate_count, contact_history."
            "content FROM contact_history JOIN contact USING (contact_number) "
            "ORDER BY block_id").fetchall()

        def text(time_us):
            self.assertEqual(time_us % 1_000_000, 0)
            moment = datetime.datetime.fromtimestamp(time_us // 1_000_000,
                                                     datetime.timezone.utc)
            return moment.strftime("%Y-%m-%dT%H:%M:%S.000Z")
        self.assertEqual(
            database.execute(
                "SELECT fid, contact_number, source_id, contact_id, "
                "start_time, end_time, estimates FROM tracks ORDER BY fid"
            ).fetchall(),
            [(*b[:4], text(b[4]), text(b[5]), b[6]) for b in blocks])
        lines = [self.geometry(blob, 2) for [blob] in
                 database.execute("SELECT geom FROM tracks ORDER BY fid")]
        self.assertEqual([len(line) / 2 for line in lines],
                         [b[6] for b in blocks])
        # tests/golden/make: every estimate 10 m further north than the one
        # before, from 41.5 N, 71.4 W; a degree of latitude is 111.06 km there.
        for line in lines:
            self.assertAlmostEqual(line[0], -71.4, places=6)
            self.assertLess(abs((line[3] - line[1]) * 111_060 - 10), 0.1)
        points = database.execute(
            "SELECT fid, contact_number, source_id, contact_id, time, status, "
            "velocity_north_m_s, geom FROM track_points ORDER BY fid"
        ).fetchall()
        self.assertEqual([p[:5] for p in points],
                         [(*b[:4], text(b[5])) for b in blocks])
        for point, line, stored in zip(points, lines, blocks):
            self.assertEqual(self.geometry(point[7], 1), line[-2:])
            held, _ = open_blob(stored[7], "H", (1,))
            held.get("q")
            last = Reader(held.rows(held.varint(), 250)[-1])
            last.get("Q")
            last = last.point()
            self.assertEqual(point[5:7], (last["status"], last["north_m_s"]))
        self.assertEqual(
            database.execute("SELECT table_name, data_type, srs_id FROM "
                             "gpkg_contents ORDER BY table_name").fetchall(),
            [("contact", "attributes", None),
             ("track_points", "features", 4326), ("tracks", "features", 4326)])

    def journal_record(self, ids, rows, beams):
        """(kind, source or id, number, time) of the next."""
        kind, _ = rows.get("BQ")
        if kind == 1:
            source = ids[rows.varint()]
            epoch, sequence = rows.get("QQ")
            self.assertEqual((epoch, ids[rows.varint()]), (1, "second"))
            time_us = rows.get("q")
            rows.get("5d")
            for _ in range(rows.varint()):
                _, _, depth_m, std_m = beams.pop(0)
                # live_server.ping: the depth below the sonar's.
                self.assertEqual(std_m, 0.5)
                self.assertEqual(depth_m, 25.0)
            return kind, source, sequence, time_us
        if kind == 3:
            start = rows.activity_start()
            return kind, start["id"], 0, start["start_us"]
        source, contact = ids[rows.varint()], ids[rows.varint()]
        if kind == 4:
            return kind, f"{source}:{contact}", 0, rows.get("q")
        self.assertEqual(kind, 2)
        _, sequence = rows.get("QQ")
        return (kind, f"{source}:{contact}", sequence,
                rows.report()["time_us"])

    def test_journal(self):
        found = []
        for count, blob in self.open("mission-v9.fathom").execute(
                "SELECT record_count, content FROM journal ORDER BY "
                "segment_id"):
            segment, _ = open_blob(blob, "J", (1, 2))
            records = segment.varint()
            self.assertEqual(records, count)
            ids = [segment.string() for _ in range(segment.varint())]
            rows = Reader(bytes(segment.column(segment.varint(), "B")))
            beams = segment.column(segment.varint(), "ffff")
            self.assert_end(segment)
            found += [self.journal_record(ids, rows, beams)
                      for _ in range(records)]
            self.assert_end(rows)
            self.assertEqual(beams, [])
        self.assertEqual([r[:2] for r in found if r[0] == 3], [(3, "second")])
        self.assertEqual([r for r in found if r[0] == 4],
                         [(4, "c4i:boat", 0, START_US + 30_000_000)])
        self.assertEqual([r[1:] for r in found if r[0] == 2],
                         [(f"c4i:{['ship', 'boat'][i % 2]}", i,
                           START_US + 1_000_000 * i) for i in range(1, 21)])
        pings = [r for r in found if r[0] == 1]
        self.assertEqual([r[2:] for r in pings],
                         [(i, START_US + 1_000_000 * i)
                          for i in range(31, 61)])


if __name__ == "__main__":
    unittest.main()
