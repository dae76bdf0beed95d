#!/usr/bin/env python3
"""A recipe adds a plica and a loose body, and a station describes a second probe, a grasper and a curette: one is cut,
the others touch, and pages, figures, report and exports have all of them as they are described."""

import csv
import io
import json
import os
import struct
import unittest

from arthron import call, call_json, free_port, wait_until
from bites import BITES, Bites
from page import RECORDED, STATION, Browser

BENT = (0, 3, 0, 2.5)  # a point beside the tip of probe-2, and its radius

RECIPE = """
[knee]
title = A knee with a medial plica
[mesh]
resolution_mm = 3
[tissue plica]
kind = synovium
label = Medial plica
colour = #e05a5a
side = medial
cuttable = yes
body = femur
path = -32 24 6, -27 34 -6, -12 36 -16
flat = 0 1 0
width_mm = 6
thickness_mm = 2
[tissue loose_body]
label = Loose body
body = tibia
path = 2 20 -16, 8 20 -16
width_mm = 5
thickness_mm = 4
"""
DESCRIBED = """
[instrument probe-2]
kind = tip
colour = #33aa55
[instrument grasper]
kind = jaw
cuts = no
colour = 102030
[instrument curette]
kind = blade
length_mm = 5
width_mm = 4
thickness_mm = 1
"""
SYNOVIUM, MEDIAL, OTHER = 5, 1, 0  # of CaseGroup
GRASPER = 10


def rgba(colour, opacity=1):
    return [round(channel / 255, 4) for channel in bytes.fromhex(colour)] + [opacity]


def opening(page, channel):
    return struct.unpack("<f", page.moments[-1]["instruments"].get(channel, {}).get(11, bytes(4)))[0]


class Tissues(Bites):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        folder = os.path.join(cls.shared.name, "plica")
        os.mkdir(folder)
        for name, text in (("recipe.ini", RECIPE), ("bites.ini", BITES.replace("meniscus_medial", "plica"))):
            with open(os.path.join(folder, name), "w") as f:
                f.write(text)
        cls.case = os.path.join(folder, "case")
        call("arthron-case", "generate", folder, "--out", cls.case)
        cls.motion = os.path.join(folder, "motion.csv")
        call("arthron-case", "motion", os.path.join(folder, "bites.ini"), "--case", cls.case, "--out", cls.motion)

    def server_config(self, stations="", extra=""):
        self.web_port = free_port()
        web = (f"records = records.db\n[web]\nport = {self.web_port}\n[case plica]\ndir = {self.case}\n"
               f"[instrument probe-2]\npoint.1 = {' '.join(map(str, BENT))}\n")
        return super().server_config("[station room-1]\ncase = plica", extra + web)

    def station_config(self, name="room-1", datagrams="yes", keys=None):
        path = super().station_config(name, datagrams, keys)
        with open(path) as f:
            text = f.read().replace("punch.opening", "grasper.opening").replace("tool.punch = punch", """
tool.probe-2 = punch
tool.grasper = punch
tool.curette = punch""")
        return self.write(f"{name}.ini", DESCRIBED + text)

    def assert_told(self, session):
        groups = {group["name"]: group for group in session["groups"]}
        self.assertEqual(groups["plica"], {"name": "plica", "kind": SYNOVIUM, "label": "Medial plica", "colour": 0xe05a5a,
                                           "own_colour": True, "side": MEDIAL, "cuttable": True, "has_zones": False})
        self.assertEqual((groups["loose_body"]["label"], groups["loose_body"]["kind"]), ("Loose body", OTHER))
        self.assertEqual(groups["meniscus_medial"]["label"], "Medial meniscus")
        self.assertTrue(groups["meniscus_medial"]["has_zones"])
        self.assertEqual([session["instruments"][channel] for channel in (9, 10, 11)], ["probe-2", "grasper", "curette"])

    def test_an_integrator_s_tissues_and_instruments_are_everywhere(self):
        browser = Browser(self.web_port, self.path("keys/authority.pem"))
        browser.first(self.server.log())
        station = self.start_station()
        wait_until("a cut", lambda: self.resection("plica")["cuts"] >= 1, 60)
        page = browser.page()
        page.watch(STATION, station="room-1")
        page.read_until(lambda: page.sessions)
        self.assert_told(page.sessions[-1])
        page.read_until(lambda: page.moments and opening(page, GRASPER) > 0.5)
        page.read_until(lambda: opening(page, GRASPER) < 0.1)
        self.session_command("stop", "room-1")
        session, metrics = self.session(), self.metrics()
        station.end()
        self.assertGreater(self.resection("plica")["removed_mm3"], 0)
        self.assertIn(("removed", "plica", 1), metrics)
        with open(session["trace"], "rb") as f:
            self.assertIn(struct.pack("<4d", *BENT), f.read(1 << 16))  # the body of probe-2
        self.assertFalse([key for key in metrics if key[0] in ("rim", "zone_removed") and key[1].startswith("plica")])
        self.assertGreater(metrics["present", "grasper", 1][0], 0)
        page.close()
        page = browser.page()
        page.watch(RECORDED, session=session["id"])
        page.read_until(lambda: page.sessions)
        self.assert_told(page.sessions[-1])
        page.close()
        described = browser.request("GET", "/cases/plica")["case"]["groups"]
        self.assertIn({"name": "plica", "body": "femur", "cuttable": True, "tissue": "synovium", "label": "Medial plica",
                       "colour": "#e05a5a", "own_colour": True, "side": "medial", "zones": False}, described)
        self.server.end()
        self.look_at_report(session["trace"])
        self.look_at_table(session["trace"])
        self.look_at_scene(session["trace"])
        self.look_at_others(session["trace"])

    # ---- what is made of the trace

    def export(self, trace, kind, name):
        path = self.path(name)
        call("arthron-trace", "export", trace, kind, path)
        with open(path, "rb") as f:
            return f.read()

    def look_at_report(self, trace):
        path = self.path("report.html")
        call("arthron-trace", "report", trace, "--out", path)
        with open(path) as f:
            report = f.read()
        for words in ("Medial plica", "Medial plica: volume", "<h3>grasper</h3>", "<h3>curette</h3>"):
            self.assertIn(words, report)
        self.assertNotIn("remaining rim", report)  # only the plica was cut, which has none
        self.assertEqual(call_json("arthron-trace", "replay", trace)["verdict"], "identical")

    def look_at_table(self, trace):
        table = call("arthron-trace", "export", trace, "--csv", "-").stdout
        rows = list(csv.DictReader(io.StringIO(table)))
        self.assertEqual({row["job_blade"] for row in rows} - {""}, {"curette"})  # the grasper closes, and cuts nothing
        for name in ("probe-2", "grasper", "curette"):
            self.assertTrue(any(float(row[f"{name}_nearest_mm"] or 99) < 1 for row in rows), name)
        self.assertTrue({"grasper_opening", "curette_qw", "probe-2_warped_tx_mm"} <= set(rows[0]))

    def look_at_scene(self, trace):
        data = self.export(trace, "--gltf", "a.glb")
        size = struct.unpack_from("<I", data, 12)[0]
        scene = json.loads(data[20:20 + size])
        colours = {material["name"]: [round(value, 4) for value in material["pbrMetallicRoughness"]["baseColorFactor"]]
                   for material in scene["materials"]}
        for name, wanted in (("plica", rgba("e05a5a")), ("meniscus_medial", rgba("a8c4d6")), ("skin", rgba("dea88c", 0.15)),
                             ("probe-2", rgba("33aa55")), ("grasper", rgba("102030")), ("curette", rgba("737880"))):
            self.assertEqual(colours[name], wanted, name)
        shaft = next(mesh for mesh in scene["meshes"] if mesh["name"] == "probe-2")["primitives"][0]
        self.assertAlmostEqual(scene["accessors"][shaft["attributes"]["POSITION"]]["max"][0], 0.0025, 6)
        nodes = {node["name"] for node in scene["nodes"]}
        self.assertTrue({"grasper", "mockup_grasper", "curette", "mockup_plica"} <= nodes)

    def look_at_others(self, trace):
        for kind, name in (("--mcap", "a.mcap"), ("--exr", "a.exr")):
            data = self.export(trace, kind, name)
            for words in (b"probe-2", b"grasper", b"curette", b"plica"):
                self.assertIn(words, data, name)


if __name__ == "__main__":
    unittest.main()
