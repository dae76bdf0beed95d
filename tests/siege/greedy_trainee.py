"""One trainee with one code takes all that a browser may ask for, at the instructor's own address. The instructor opens
the wall, and the cuts of another trainee land, nearly as if nobody did. What is written down stays little."""

import ast
import csv
import http.client
import os
import sqlite3
import statistics
import sys
import threading
import time
import unittest

from arthron import call, wait_until
from bites import Bites
from hall import Hall
from page import ASSIGN, STATION, WALL, Browser, piece
from siege import FULL, Siege, end

SECONDS = 60 if FULL else 4  # of the attack, once it has used up what it may
PATIENCE_S = 120
PAGES, WATCHES, LOOPS, DOWNLOADS = 64, 16, 8, 32
PAGES_MAY = 6                # at once, of one trainee
SIGN_INS_MAY = 30 + (PATIENCE_S + SECONDS) // 10  # 30 are free, and then they wait
ENTRIES_MAY = 60             # of the audit log
HELD_BACK = ("stranger 429", "forged 429", "who 429", "download 503")
OPEN_S = 2                   # what an instructor waits for the wall at most
STATIONS = "[station room-1]\ncase = healthy\ntrainee = ada"

# ---- the attacker ----------------------------------------------------------------------------------


class Attack:
    """All at once, until it was held back and the time after that is over. Counts what was let in."""

    def __init__(self, web_port, authority, code, session, seconds):
        self.browser = Browser(int(web_port), authority)
        self.code, self.session, self.seconds = code, session, float(seconds)
        self.until = time.monotonic() + PATIENCE_S
        self.browser.request("POST", "/sign-in", {"code": code})
        self.counts, self.open, self.lock = {}, 0, threading.Lock()
        self.all_held_back = False

    def count(self, name):
        with self.lock:
            self.counts[name] = self.counts.get(name, 0) + 1

    def opened(self, more):
        with self.lock:
            self.open += more
            self.counts["pages at once"] = max(self.counts.get("pages at once", 0), self.open)

    def goes_on(self):
        return time.monotonic() < self.until

    def view(self, watches):
        """A page that is open as long as it may, and comes again. It draws what it gets."""
        while self.goes_on():
            try:
                page = self.browser.page()
                page.watch(STATION if watches else WALL, station="room-1", rate_hz=120)
                page.socket.settimeout(2)
                page.read()
            except OSError:
                time.sleep(0.5)
                continue
            self.opened(1)
            try:
                while self.goes_on():
                    page.read()
            except OSError:
                pass
            self.opened(-1)

    def request(self, method, path, body, name, cookie=None):
        """Again and again; until all that is held back was, what was leaves the others the processor."""
        connection = http.client.HTTPSConnection("localhost", self.browser.port, context=self.browser.tls, timeout=20)
        headers = {"Origin": f"https://localhost:{self.browser.port}", "Cookie": cookie or self.browser.cookie}
        while self.goes_on():
            try:
                connection.request(method, "/api/v1" + path, body, headers)
                answer = connection.getresponse()
                answer.read()
                self.count(f"{name} {answer.status}")
                if answer.status in (429, 503) and not self.all_held_back:
                    time.sleep(0.2)
            except (OSError, http.client.HTTPException):
                connection.close()
                time.sleep(0.1)

    def download(self):
        """Takes a file as slowly as it may."""
        while self.goes_on():
            try:
                connection = http.client.HTTPSConnection("localhost", self.browser.port, context=self.browser.tls,
                                                         timeout=20)
                connection.request("GET", f"/api/v1/sessions/{self.session}/trace", None,
                                   {"Cookie": self.browser.cookie})
                answer = connection.getresponse()
                self.count(f"download {answer.status}")
                while self.goes_on() and answer.read(1024):
                    time.sleep(1)
                connection.close()
                time.sleep(0.2)
            except OSError:
                time.sleep(0.5)

    def run(self):
        sign_in = f'{{"code": "{self.code}"}}'
        works = [(self.view, (i < WATCHES,)) for i in range(PAGES)]
        works += [(self.request, ("GET", f"/sessions/{self.session}/report", None, "report"))] * LOOPS
        works += [(self.request, ("POST", "/sign-in", sign_in, "sign-in"))] * LOOPS
        works += [(self.request, ("GET", "/me", None, "stranger", "a=b")), (self.request, ("GET", "/me", None, "who")),
                  (self.request, ("GET", "/me", None, "forged", "arthron=" + "0" * 64))]
        works += [(self.download, ())] * DOWNLOADS
        os.nice(10)  # as if it were at another machine: it takes no processor that the server wants
        for work, arguments in works:
            threading.Thread(target=work, args=arguments, daemon=True).start()
        while self.goes_on() and not all(self.counts.get(name) for name in HELD_BACK):
            time.sleep(0.05)
        self.all_held_back = True
        self.until = time.monotonic() + self.seconds
        print("begun", flush=True)
        time.sleep(self.seconds)
        print(self.counts, flush=True)


# ---- the hall --------------------------------------------------------------------------------------


class GreedyTrainee(Hall, Siege, Bites):
    def setUp(self):
        super(Bites, self).setUp()  # its server has no pages
        self.start_mockup()
        self.server = self.serve(STATIONS)
        self.enrol("room-1")
        self.authority = os.path.join(self.keys, "authority.pem")
        self.boss = Browser(self.web_port, self.authority)
        self.boss.first(self.server.log())

    def record_one_of_ada(self):
        """A session of hers, which has ended; the station goes on with eve."""
        self.start_station()
        self.wait_for_cuts(1)
        self.session_command("stop", "room-1")
        closed = wait_until("its results", lambda: [s for s in self.boss.request("GET", "/sessions")["sessions"]
                                                    if s["state"] == "closed" and s["trace_xxh3"]])
        page = self.boss.page()
        self.assertTrue(page.command(ASSIGN, more=piece(12, "eve"))["ok"])
        page.close()
        self.session_command("start", "room-1")
        self.wait_for_steps(50)
        return closed[0]["id"]

    def audit_rows(self):
        with sqlite3.connect(self.db, timeout=20) as db:
            count = db.execute("SELECT count(*) FROM audit").fetchone()[0]
        db.close()
        return count

    def time_wall(self):
        """From the instructor's click until all stations are there."""
        begun = time.monotonic()
        page = self.boss.page()
        page.watch(WALL)
        page.read_until(lambda: page.places and page.moments)
        took_s = time.monotonic() - begun
        page.close()
        return took_s

    def watch_for(self, seconds):
        """How long the wall took, each time, and the steps of the session meanwhile, in which it was cut."""
        first, cuts, end_s, walls = self.session()["steps"], self.resection()["cuts"], time.monotonic() + seconds, []
        while time.monotonic() < end_s or (self.resection()["cuts"] == cuts and time.monotonic() < end_s + PATIENCE_S):
            walls.append(self.time_wall())
            time.sleep(0.5)
        return {"walls": walls, "steps": (first, self.session()["steps"])}

    def landings(self, trace):
        """(step, s from when a cut was asked for until it landed) of each."""
        table = call("arthron-trace", "export", trace, "--csv", "-", "--columns", "step,t_seconds,job,landed_job",
                     "--case", os.path.join(self.cases, "healthy")).stdout
        asked, landed = {}, []
        for row in csv.DictReader(table.splitlines()):
            if row["job"] not in ("", "0"):
                asked[row["job"]] = float(row["t_seconds"])
            if row["landed_job"] in asked:
                landed.append((int(row["step"]), float(row["t_seconds"]) - asked[row["landed_job"]]))
        return landed

    def test_an_instructor_and_the_others_hardly_notice(self):
        for name in ("ada", "eve"):
            if name not in [t["name"] for t in self.boss.request("GET", "/trainees")["trainees"]]:
                self.boss.request("POST", "/trainees", {"name": name})
        session = self.record_one_of_ada()
        code = self.boss.request("POST", "/trainees/ada/code", {})["code"]
        alone = self.watch_for(SECONDS / 2)
        rows = self.audit_rows()
        attacker = self.attack(self.web_port, self.authority, code, session, SECONDS)
        self.assertIn("begun", attacker.stdout.readline())
        under = self.watch_for(SECONDS)
        self.assertEqual(attacker.wait(timeout=60), 0)
        let_in = ast.literal_eval(end(attacker).strip())
        grown = self.audit_rows() - rows
        trace = self.session()["trace"]
        self.session_command("stop", "room-1")
        wait_until("its end", lambda: call("arthron-trace", "verify", trace, code=None).returncode == 0)
        landings = self.landings(trace)
        times = {name: [s for step, s in landings if part["steps"][0] <= step <= part["steps"][1]]
                 for name, part in (("alone", alone), ("under attack", under))}
        self.figure("let in", let_in)
        for name, part in (("alone", alone), ("under attack", under)):
            self.figure(f"the wall {name}, median", statistics.median(part["walls"]), "s")
            self.figure("... at most", max(part["walls"]), "s")
            self.assertTrue(times[name], "no cut landed " + name)
            self.figure(f"{len(times[name])} cuts {name}, median", statistics.median(times[name]), "s")
        self.figure("entries of the audit log", grown)
        self.assertLessEqual(let_in.get("pages at once", 0), PAGES_MAY)
        self.assertGreater(let_in.get("pages at once", 0), 0)
        self.assertLessEqual(grown, ENTRIES_MAY)
        self.assertLessEqual(let_in.get("sign-in 200", 0), SIGN_INS_MAY)
        self.assertEqual({name for name in let_in if " 5" in name} - {"report 503", "sign-in 503", "download 503"}, set())
        self.assertEqual([name for name in HELD_BACK if not let_in.get(name)], [])
        if FULL:
            self.assertLess(max(under["walls"]), OPEN_S)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--attack"]:
        Attack(*sys.argv[2:]).run()
    else:
        unittest.main(verbosity=2)
