"""The published schema of scenario files says what the feeder does: the files
that ship pass, and what one refuses the other refuses too."""

import copy
import json
import os
import pathlib
import subprocess
import tempfile
import unittest

try:
    import jsonschema
    import yaml
except ImportError:
    jsonschema = None

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCENARIOS = ROOT / "sim_feeder" / "scenarios"
FEEDER = os.environ["FATHOM_FEEDER"]

GOOD = {
    "activity": {"id": "bay"},
    "area": {"south_west_lat_deg": 41.5, "south_west_lon_deg": -71.4,
             "north_extent_m": 300, "east_extent_m": 300},
    "truth": {"flat_depth_m": 25},
}


def walk(schema, path=()):
    """Every (path, schema) of a value; a list's items under its key."""
    for key, value in schema.get("properties", {}).items():
        yield (*path, key), value
        yield from walk(value, (*path, key))
        if "items" in value:
            yield from walk(value["items"], (*path, key, 0))


# What makes a list's item, and a bounded value, good but for the one.
ITEMS = {"shapes": {"kind": "ridge"}, "scripted": {"id": "a"},
         "legs": {"duration_s": 10}, "waypoints": {},
         "expect": {"figure": "/points", "at_least": 0}}
PARTNERS = {"loiter_radius_m": {"loiter_s": 60}, "loiter_s":
            {"loiter_radius_m": 30}, "chase_interval_s":
            {"chase_speed_m_s": 5}, "prior_depth_m": {"prior_std_m": 1},
            "prior_std_m": {"prior_depth_m": 20},
            "at_least": {"figure": "/points"},
            "at_most": {"figure": "/points"}}


def with_value(path, value):
    """GOOD with `value` at the path."""
    scenario = copy.deepcopy(GOOD)
    here = scenario
    for step, key in enumerate(path[:-1]):
        if key == 0:
            continue
        if step + 1 < len(path) and path[step + 1] == 0:
            items = here.setdefault(key, [copy.deepcopy(ITEMS[key])])
            here = items[0]
        else:
            here = here.setdefault(key, {})
    if path[0] == "area" and path[1] == "auto_side_m":
        here.clear()
    here.update(PARTNERS.get(path[-1], {}))
    here[path[-1]] = value
    return scenario


@unittest.skipUnless(jsonschema, "python3-jsonschema or -yaml is absent")
class ScenarioSchema(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.schema = json.loads((SCENARIOS / "schema.json").read_text())
        jsonschema.Draft202012Validator.check_schema(cls.schema)
        cls.validator = jsonschema.Draft202012Validator(cls.schema)

    def test_the_files_that_ship_pass(self):
        files = sorted(SCENARIOS.glob("*.yaml"))
        self.assertEqual(len(files), 7)
        for path in files:
            # As JSON has it: a time is a text.
            scenario = yaml.load(path.read_text(), yaml.BaseLoader)
            typed = yaml.safe_load(path.read_text())
            if "start_time" in typed:
                typed["start_time"] = scenario["start_time"]
            with self.subTest(path=path.name):
                self.validator.validate(typed)

    def feeder_takes(self, scenario):
        """Whether the feeder's check takes it, and its words."""
        with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
            # JSON is YAML.
            json.dump(scenario, file)
            file.flush()
            done = subprocess.run([FEEDER, "scenario", file.name],
                                  capture_output=True, text=True, timeout=60,
                                  check=False)
        return done.returncode == 0, done.stderr

    def agree(self, scenario, good):
        self.assertEqual(self.validator.is_valid(scenario), good, scenario)
        took, words = self.feeder_takes(scenario)
        self.assertEqual(took, good, (scenario, words))

    def test_bounds_and_keys_are_the_feeders(self):
        self.agree(GOOD, True)
        keys = 0
        for path, value in walk(self.schema):
            if value.get("type") not in ("number", "integer"):
                continue
            if path == ("truth", "shapes", 0, "height_m"):
                continue  # By kind: below.
            keys += 1
            with self.subTest(path=path):
                for bound, beyond in (("minimum", -1), ("maximum", 1)):
                    if bound not in value:
                        continue
                    least = value[bound]
                    step = 1 if value["type"] == "integer" else max(
                        1e-9, abs(least) * 1e-6)
                    self.agree(with_value(path, least + beyond * step), False)
                self.agree(with_value(path, "often"), False)
        self.assertGreater(keys, 50)

    def test_every_key_is_known_to_the_feeder(self):
        for path, value in walk(self.schema):
            if "default" not in value:
                continue
            with self.subTest(path=path):
                self.agree(with_value(path, value["default"]), True)
        for path in (("sead",), ("activity", "idd"), ("vehicle", "speed"),
                     ("vehicle", "waypoints", 0, "north"),
                     ("contacts", "scripted", 0, "legs", 0, "speed"),
                     ("truth", "shapes", 0, "size")):
            with self.subTest(path=path):
                self.agree(with_value(path, 1), False)

    def test_what_belongs_together(self):
        for path, value in (
                (("activity", "estimator"), "best"),
                (("truth", "shapes", 0, "height_m"), 0),
                (("expect", 0, "figure"), "rmse_m")):
            with self.subTest(path=path):
                self.agree(with_value(path, value), False)
        slope = with_value(("truth", "shapes", 0, "height_m"), -5)
        slope["truth"]["shapes"][0]["kind"] = "slope"
        self.agree(slope, True)
        for bad in ({"pings": 5, "duration_s": 5}, {"area": {}},
                    {"activity": {}},
                    {"vehicle": {"waypoints": [{}], "track_spacing_m": 5}},
                    {"vehicle": {"waypoints": [{"loiter_s": 5}]}},
                    {"truth": {"raster": "a.tif", "flat_depth_m": 5}},
                    {"expect": [{"figure": "/points"}]},
                    {"contacts": {"scripted": [{"north_m": 5}]}}):
            with self.subTest(bad=bad):
                self.agree({**GOOD, **bad}, False)


if __name__ == "__main__":
    unittest.main()
