"""A global map of several MiB on a server that may keep one MiB of it ready to
be read: the answers are those of one that keeps it all, before and after a
restart, and the memory that the status tells stays within the budget."""

import math
import os
import subprocess
import unittest

from live_server import (DEADLINE_S, LiveTest, Server, at, import_chart,
                         mission, obstacle, point, start_activity, wait_until)

MIB = 1 << 20
SIDE = 400
STEP_DEG = 1.2e-4


def rough_tile(north_m, east_m):
    """13 m cells of which no neighbours are alike: nothing conglomerates."""
    return mission.DepthTile(
        north_west=point(north_m, east_m), latitude_step_deg=STEP_DEG,
        longitude_step_deg=STEP_DEG, rows=SIDE, columns=SIDE,
        depth_m=[30 + 7 * ((k * 31 + k // SIDE * 17) % 29) / 29
                 + math.sin(0.001 * k) for k in range(SIDE * SIDE)],
        std_m=[0.5])


def answers(server):
    """Points all over the chart, a nearest search, a region: their bytes, for
    unknown depths are NaN."""
    places = [point(north, east) for north in range(-9000, 9000, 450)
              for east in range(-7000, 7000, 450)]
    batch = server.obstacle.QueryObstacles(
        obstacle.QueryObstaclesRequest(
            latitude_deg=[place.latitude_deg for place in places],
            longitude_deg=[place.longitude_deg for place in places],
            depth_m=[25.0] * len(places), time=at(0), confidence=0.95,
            with_reasons=True),
        timeout=DEADLINE_S)
    nearest = server.obstacle.FindNearestObstacle(
        obstacle.FindNearestObstacleRequest(
            position=point(0, 0), depth_m=20, time=at(0), confidence=0.95,
            search_radius_m=3000,
            treat_unknown_as=obstacle.UNKNOWN_TREATMENT_FREE),
        timeout=DEADLINE_S)
    region = [message.tile for message in server.obstacle.GetRegion(
        obstacle.GetRegionRequest(south_west=point(-3000, -3000),
                                  north_east=point(3000, 3000),
                                  resolution_m=50),
        timeout=DEADLINE_S)]
    assert any(not math.isnan(depth) for depth in batch.mean_depth_m)
    assert any(not math.isnan(depth) for depth in region[0].depth_m)
    for answer in (batch, nearest):
        answer.ClearField("stamp")
    for tile in region:
        tile.ClearField("age_s")  # Counts to now.
    return [message.SerializeToString(deterministic=True)
            for message in (batch, nearest, *region)]


class Tiles(LiveTest):

    def settled(self, server):
        """The status once the idle writer has packed what readers unpacked."""
        wait_until(lambda: server.status().global_map.unpacked_bytes <= MIB,
                   "the budget to be kept")
        return server.status().global_map

    def test_answers_are_the_same_whatever_is_packed(self):
        with self.new_mission("--global-memory-mib", "1") as server:
            import_chart(server, rough_tile(5000, -5000), rough_tile(5000, 0),
                         rough_tile(0, -5000), rough_tile(0, 0))
            told = self.settled(server)
            self.assertEqual(told.tile_budget_bytes, MIB)
            self.assertGreater(told.packed_tiles, 50)
            self.assertGreater(told.unpacked_tiles, 10)
            self.assertGreater(told.packed_bytes, 0)
            # What would be there without a budget: 6 bytes a leaf.
            self.assertGreater(6 * told.leaves, 2.5 * MIB)
            self.assertLess(told.memory_bytes,
                            told.unpacked_bytes + told.packed_bytes + MIB / 2)
            self.assertLess(told.memory_bytes, 4 * told.leaves)
            first = answers(server)
            self.assertEqual(self.settled(server).tile_budget_bytes, MIB)
            self.assertEqual(answers(server), first)
            digest = server.status(digest=True).map_digest
            summary = subprocess.run(
                [os.environ["FATHOM_CLI"], "--server", server.address,
                 "status"], capture_output=True, text=True, check=True,
                timeout=DEADLINE_S).stdout
            self.assertIn("tiles packed in", summary)
            self.assertEqual(server.terminate(), 0, server.log())
        for mib in ("1", "64"):
            with Server(self.folder / "m.fathom", "--global-memory-mib",
                        mib) as again:
                start = again.status().global_map
                self.assertLessEqual(start.unpacked_bytes, int(mib) * MIB)
                self.assertEqual(start.packed_tiles > 0, mib == "1")
                self.assertEqual(again.status(digest=True).map_digest, digest)
                self.assertEqual(answers(again), first)
                if mib == "1":
                    self.settled(again)
                self.assertEqual(again.terminate(), 0, again.log())

    def test_a_survey_over_packed_tiles_is_there_after_a_restart(self):
        with self.new_mission("--global-memory-mib", "1") as server:
            import_chart(server, rough_tile(5000, -5000), rough_tile(5000, 0),
                         rough_tile(0, -5000))
            start_activity(server)
            server.mission.CompleteActivity(
                mission.CompleteActivityRequest(activity_id="bay"),
                timeout=DEADLINE_S)
            import_chart(server, rough_tile(0, 0))
            digest = server.status(digest=True).map_digest
            server.kill()
        with Server(self.folder / "m.fathom", "--global-memory-mib",
                    "1") as again:
            self.assertEqual(again.status(digest=True).map_digest, digest)

    def test_a_budget_out_of_range_is_refused(self):
        for mib in ("0", "1048577", "some"):
            with self.assertRaises(RuntimeError) as caught:
                self.new_mission("--global-memory-mib", mib)
            self.assertIn("--global-memory-mib", str(caught.exception))


if __name__ == "__main__":
    unittest.main()
