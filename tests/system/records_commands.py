"""What people type about records, without a server: lists, exports, erasure. The shape of an xAPI statement is
held against the specification's own rules (xAPI 1.0.3, part two), written here a second time."""

import csv
import datetime
import fcntl
import json
import os
import pty
import re
import select
import sqlite3
import stat
import subprocess
import tempfile
import unittest
import urllib.parse

from arthron import call, program

IDS = ["%032x" % (0x0123456789ABCDEF0123456789ABCDEF + i) for i in range(4)]
ARGON = "$argon2id$v=19$m=65536,t=3,p=4$c29tZXNhbHQ$RdescudvJCsgt3ub+b4dWRWJTmaaJObG"

UUID = re.compile("^[0-9a-f]{8}-[0-9a-f]{4}-4[0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}$")
DURATION = re.compile(r"^PT\d+(\.\d{1,2})?S$")
LANGUAGE = re.compile("^[a-z]{2}(-[A-Z]{2})?$")


def seed(path):
    """Sessions as a server would have left them: closed, interrupted, going on, and of nobody."""
    with sqlite3.connect(path) as db:
        db.execute("INSERT INTO station (id, name) VALUES (1, 'room-1')")
        db.execute("INSERT INTO knee_case (id, name, hash) VALUES (1, 'tear radial/ä', '00000000000000ff')")
        rows = [(IDS[0], 1, 2_500_000_000, "closed"), (IDS[1], 1, 4_000_000_000, "interrupted"),
                (IDS[2], 1, None, "open"), (IDS[3], None, 5_000_000_000, "closed")]
        for i, (uuid, trainee, end, state) in enumerate(rows):
            db.execute("INSERT INTO session (uuid, station_id, trainee_id, case_id, start_utc_ns, end_utc_ns, state,"
                       " steps, missing, trace, trace_xxh3) VALUES (?, 1, ?, 1, ?, ?, ?, 10, 0, ?, ?)",
                       (uuid, trainee, 10**18, end and 10**18 + end, state, f"/srv/traces/{i}.trace",
                        end and "00000000feedface"))
        db.execute("INSERT INTO result VALUES (1, 'over', 'meniscus_medial', 1, 'mm3', 4.5, '{\"below_floor\":true}'),"
                   " (1, 'rim', 'meniscus_medial', 1, 'mm', NULL, NULL), (2, 'time', '', 1, 's', 1.25, NULL)")
    db.close()


class Commands(unittest.TestCase):
    def setUp(self):
        self.keep = tempfile.TemporaryDirectory(prefix="arthron-test-")
        self.folder = self.keep.name
        self.db = self.path("records.db")
        self.run_records("add", "trainee", "ada", "--full-name", 'Ada "Countess", Lovelace')
        self.run_records("add", "course", "autumn, 2026")
        self.run_records("enrol", "ada", "autumn, 2026")
        seed(self.db)

    def tearDown(self):
        self.keep.cleanup()

    def path(self, name):
        return os.path.join(self.folder, name)

    def run_records(self, *words, code=0):
        return call("arthron-server", "records", "--file", self.db, *words, code=code)

    def json(self, *words):
        return json.loads(self.run_records(*words, "--json").stdout)

    # ---- lists

    def test_what_was_added_is_listed_and_shown(self):
        self.assertEqual([t["name"] for t in self.json("list", "trainees")], ["ada"])
        shown = self.json("show", "trainee", "ada")
        self.assertEqual(shown["trainee"][0]["full_name"], 'Ada "Countess", Lovelace')
        self.assertEqual([s["id"] for s in shown["sessions"]], IDS[:3])
        self.assertEqual(self.json("show", "course", "autumn, 2026")["trainees"][0]["trainee"], "ada")
        self.assertEqual([r["metric"] for r in self.json("show", "session", IDS[0])["results"]], ["over", "rim"])
        self.assertEqual(self.json("show", "station", "room-1")["station"][0]["sessions"], 4)
        self.assertEqual(self.json("list", "cases")[0]["sessions"], 4)
        table = self.run_records("list", "sessions").stdout.splitlines()
        self.assertEqual(len(table), 5)
        self.assertRegex(table[0], "start_utc +end_utc +state")
        self.assertIn("2001-09-09T01:46:40Z", table[1])
        self.assertNotIn("feedface", table[1])
        self.assertRegex(self.run_records("list", "audit").stdout.splitlines()[1], r"^\d{4}-\d\d-\d\dT")

    def pipe(self, text, *words):
        """What the command answers to a file on its stdin: its exit code, and all that it said."""
        done = subprocess.run([program("arthron-server"), "records", "--file", self.db, *words], input=text, text=True,
                              capture_output=True)
        return done.returncode, done.stdout + done.stderr

    def type(self, lines, *words):
        """The same on a terminal, at which somebody types."""
        here, there = pty.openpty()
        with subprocess.Popen([program("arthron-server"), "records", "--file", self.db, *words], stdin=there,
                              stdout=there, stderr=there) as process:
            said = ""
            for line in lines:
                said += self.read_until(here, ": ")
                os.write(here, (line + "\n").encode())
            process.wait(timeout=60)
            os.set_blocking(here, False)
            said += os.read(here, 65536).decode()
        os.close(there)
        os.close(here)
        return process.returncode, said

    @staticmethod
    def read_until(here, end):
        said = ""
        while not said.endswith(end):
            if not select.select([here], [], [], 30)[0]:
                raise AssertionError(f"waited in vain for '{end}' after: {said}")
            said += os.read(here, 4096).decode()
        return said

    def passwords(self):
        with sqlite3.connect(self.db) as db:
            rows = db.execute("SELECT name, password FROM account").fetchall()
        db.close()
        return dict(rows)

    def test_a_password_is_kept_as_argon2_makes_it(self):
        role = ("--role", "instructor", "--password", "-")
        self.assertEqual(self.pipe("correct horse battery\n", "add", "account", "eve", *role),
                         (0, "arthron-server records: added account eve\n"))
        first = self.passwords()["eve"]
        self.assertRegex(first, r"^\$argon2id\$v=19\$m=65536,t=3,p=1\$")
        self.assertEqual(self.pipe("correct horse battery", "password", "eve", "--password", "-"),
                         (0, "arthron-server records: eve has a new password\n"))
        self.assertNotEqual(self.passwords()["eve"], first)  # another salt
        for bad in ("swordfish\n", "x" * 3000, ""):
            code, said = self.pipe(bad, "add", "account", "mallory", *role)
            self.assertEqual(code, 1)
            self.assertNotIn(bad.strip() or "?", said)
        self.assertEqual(self.pipe("", "password", "eve")[0], 1)
        self.assertIn("no account 'nobody'", self.pipe(ARGON, "password", "nobody", "--password", "-")[1])
        with open(self.db, "rb") as file:
            self.assertNotIn(b"correct horse", file.read())
        self.assertEqual(list(self.passwords()), ["eve"])

    def test_a_password_is_typed_twice_and_not_shown(self):
        secret = "correct horse battery"
        code, said = self.type([secret, secret], "add", "account", "eve", "--role", "instructor")
        self.assertEqual(code, 0)
        self.assertNotIn("horse", said)
        self.assertIn("$argon2id$", self.passwords()["eve"])
        code, said = self.type([secret, "another one, longer"], "password", "eve")
        self.assertEqual(code, 1)
        self.assertIn("the two differ", said)
        code, said = self.type(["short", "short"], "password", "eve")
        self.assertIn("at least 10 characters", said)

    def test_the_last_instructor_stays(self):
        self.pipe(ARGON, "add", "account", "eve", "--role", "instructor", "--password", "-")
        self.pipe(ARGON, "add", "account", "tom", "--role", "technician", "--password", "-")
        self.assertIn("last instructor", self.run_records("remove", "account", "eve", code=1).stderr)
        self.run_records("remove", "account", "tom")
        self.run_records("remove", "account", "tom", code=1)
        self.run_records("remove", "trainee", "ada", code=2)
        self.assertEqual(list(self.passwords()), ["eve"])

    def test_accounts_take_what_argon2_encoded(self):
        code, said = self.pipe(ARGON + "\n", "add", "account", "eve", "--role", "instructor", "--password", "-")
        self.assertEqual((code, said), (0, "arthron-server records: added account eve\n"))
        said = self.run_records("add", "account", "tom", "--role", "technician").stderr
        self.assertIn("added account tom, which cannot sign in", said)
        accounts = self.json("list", "accounts")
        self.assertEqual([(a["name"], a["role"], a["can_log_in"]) for a in accounts],
                         [("eve", "instructor", 1), ("tom", "technician", 0)])
        self.assertNotIn("argon2", json.dumps(accounts))
        with sqlite3.connect(self.db) as db:
            self.assertEqual(db.execute("SELECT password FROM account").fetchall(), [(ARGON,), (None,)])
        db.close()
        audit = self.json("list", "audit")
        self.assertEqual([a["subject"] for a in audit], ["trainee 1", "course 1", "trainee 1", "account 1", "account 2"])

    def test_what_cannot_be_done_says_why(self):
        self.assertIn("list pupils is unknown; the choices are trainees", self.run_records("list", "pupils", code=2).stderr)
        for words, says in ((("show", "trainee", "nobody"), "no trainee 'nobody'"),
                            (("enrol", "ada", "spring"), "no course 'spring'"),
                            (("erase", "nobody"), "no trainee 'nobody'"),
                            (("add", "trainee", "ada"), "already"),
                            (("add", "course", ""), "empty"),
                            (("export", "--xapi", self.path("x"), "--site", "ftp://a"), "--site"),
                            (("export", "--csv", self.path("no/such")), "No such file")):
            done = self.run_records(*words, code=1)
            self.assertIn(says, done.stderr)
            self.assertEqual(done.stdout, "")
        for words in (("list",), ("list", "songs"), ("show", "results", "x"), ("add", "song", "x"), ("export",),
                      ("add", "account", "x"), ("add", "account", "x", "--role", "queen"), ("erase",), ("--bad",)):
            self.assertIn("Try: arthron-server records --help", self.run_records(*words, code=2).stderr)
        no_file = call("arthron-server", "records", "list", code=2).stderr.splitlines()[0]
        self.assertIn("--file ", no_file)
        self.assertIn("is missing", no_file)
        if not os.path.exists("/run/arthron/server.sock"):  # that of the package
            usual = call("arthron-server", "session", "list", code=1).stderr
            self.assertIn("/run/arthron/server.sock: there is no such socket", usual)
        for words in (("records", "--file", self.db), ("session",)):
            self.assertIn("the command is missing", call("arthron-server", *words, code=2).stderr)
        missing = call("arthron-server", "records", "--file", self.path("none.db"), "list", "sessions", code=1)
        self.assertIn("none.db: this file does not exist", missing.stderr)
        self.assertFalse(os.path.exists(self.path("none.db")))

    def test_what_was_done_is_said_beside_the_data(self):
        for words, says in ((("add", "trainee", "bea"), "added trainee bea"),
                            (("add", "course", "spring"), "added course spring"),
                            (("enrol", "bea", "spring"), "bea is in course spring"),
                            (("export", "--csv", self.path("out"), "--xapi", self.path("x.json")),
                             f"wrote {self.path('out')} and {self.path('x.json')}")):
            done = self.run_records(*words)
            self.assertEqual(done.stdout, "")
            self.assertEqual(done.stderr.splitlines()[-1], f"arthron-server records: {says}")
        done = call("arthron-server", "backup", "--file", self.db, "--out", self.path("b.db"))
        self.assertEqual((done.stdout, done.stderr), ("", f"arthron-server backup: wrote {self.path('b.db')}\n"))

    # ---- encrypted backups

    def test_an_encrypted_backup_comes_back_by_its_passphrase_alone(self):
        right, wrong, backup = self.path("right"), self.path("wrong"), self.path("b.sealed")
        for path, text in ((right, "correct horse battery\n"), (wrong, "correct horse batterie\n")):
            with open(path, "w") as f:
                f.write(text)
        call("arthron-server", "backup", "--file", self.db, "--out", backup, "--passphrase", right)
        self.assertEqual(stat.S_IMODE(os.stat(backup).st_mode), 0o600)
        with open(backup, "rb") as f:
            whole = f.read()
        for text in (b"SQLite", b"Lovelace", b"autumn"):
            self.assertNotIn(text, whole)

        def restore(name=backup, passphrase=right, code=0):
            options = ("--passphrase", passphrase) if passphrase else ()
            return call("arthron-server", "restore", name, "--file", self.db, *options, code=code)

        self.run_records("add", "course", "after the backup")
        self.assertIn("the passphrase is wrong", restore(passphrase=wrong, code=1).stderr)
        self.assertIn("is encrypted; name the file of its passphrase", restore(passphrase=None, code=1).stderr)
        with open(self.path("cut"), "wb") as f:
            f.write(whole[:-100])
        self.assertIn("was changed, or is cut off", restore(self.path("cut"), code=1).stderr)
        self.assertEqual(len(self.json("list", "courses")), 2)
        restore()
        self.assertEqual([row["name"] for row in self.json("list", "courses")], ["autumn, 2026"])
        call("arthron-server", "backup", "--file", self.db, "--out", self.path("plain.db"))
        self.assertIn("is not encrypted; leave out --passphrase", restore(self.path("plain.db"), code=1).stderr)
        self.assertEqual([name for name in os.listdir(self.folder) if "draft" in name or "part" in name], [])
        with open(self.db + ".backup-lock") as lock:  # as another one holds it, whose draft stays
            fcntl.flock(lock, fcntl.LOCK_EX)
            with open(self.db + ".backup-draft", "w") as f:
                f.write("of another")
            self.assertIn("another encrypted backup or restore is under way", restore(code=1).stderr)
            busy = call("arthron-server", "backup", "--file", self.db, "--out", self.path("c"), "--passphrase", right, code=1)
            self.assertIn("another encrypted backup or restore is under way", busy.stderr)
            with open(self.db + ".backup-draft") as f:
                self.assertEqual(f.read(), "of another")
        restore()

    # ---- the audit log

    def test_verify_finds_what_was_changed_in_the_audit_log(self):
        said = self.run_records("verify").stdout
        last = re.search(r"the audit log is whole: 3 entries; the last one is (3:[0-9a-f]{64})\n", said)[1]
        self.run_records("add", "course", "spring")
        self.run_records("verify", "--entry", last)
        self.assertEqual(json.loads(self.run_records("verify", "--json").stdout)["entries"], 4)
        keys = self.path("keys")
        call("arthron-server", "keys", "init", keys)
        none = call("arthron-server", "records", "--file", self.db, "verify", "--keys", keys, code=1)
        self.assertIn("no server has signed the audit log", none.stderr)
        other = call("arthron-server", "records", "--file", self.db, "verify", "--entry", "3:" + 64 * "0", code=1)
        self.assertIn("entry 3 of the audit log is missing, or was changed", other.stderr)
        wrong = call("arthron-server", "records", "--file", self.db, "verify", "--entry", "x", code=1)
        self.assertIn("--entry x is not NUMBER:HASH", wrong.stderr)
        with sqlite3.connect(self.db) as db:
            db.execute("DROP TRIGGER audit_is_not_changed")
            db.execute("UPDATE audit SET actor = 'eve' WHERE id = 2")
        db.close()
        changed = call("arthron-server", "records", "--file", self.db, "verify", code=1)
        self.assertIn("entry 2 of the audit log, or one before it, was changed", changed.stderr)

    # ---- exports

    def test_csv_is_read_back_as_it_was(self):
        self.run_records("export", "--csv", self.path("out"))
        for name in os.listdir(self.path("out")):
            path = os.path.join(self.path("out"), name)
            self.assertEqual(stat.S_IMODE(os.stat(path).st_mode), 0o600)
            with open(path, newline="", encoding="utf-8") as f:
                rows = list(csv.DictReader(f, strict=True))
            expected = self.json("list", name.removesuffix(".csv"))
            self.assertEqual(len(rows), len(expected))
            for row, wanted in zip(rows, expected):
                self.assertEqual(list(row), list(wanted))
                for column, value in wanted.items():
                    text = "" if value is None else value if isinstance(value, str) else None
                    if text is None:
                        self.assertEqual(float(row[column]), float(value))
                    else:
                        self.assertEqual(row[column], text)
        self.assertEqual(len(os.listdir(self.path("out"))), 19)

    def is_iri(self, text):
        parts = urllib.parse.urlsplit(text)
        self.assertTrue(parts.scheme in ("http", "https") and parts.netloc, text)
        self.assertNotRegex(text, r'[\s<>"{}|\\^`]')

    def is_map(self, value):
        for language, text in value.items():
            self.assertRegex(language, LANGUAGE)
            self.assertIsInstance(text, str)

    def only(self, value, required, optional=()):
        self.assertLessEqual(set(required), set(value))
        self.assertLessEqual(set(value), set(required) | set(optional))

    def is_statement(self, s):
        self.only(s, ("actor", "verb", "object"), ("id", "result", "context", "timestamp", "version", "stored",
                                                   "authority", "attachments"))
        self.assertRegex(s["id"], UUID)
        self.assertEqual(s["version"], "1.0.3")
        datetime.datetime.fromisoformat(s["timestamp"].replace("Z", "+00:00"))
        self.only(s["actor"], ("objectType", "account"), ("name",))  # exactly one identifier
        self.assertEqual(s["actor"]["objectType"], "Agent")
        self.only(s["actor"]["account"], ("homePage", "name"))
        self.is_iri(s["actor"]["account"]["homePage"])
        self.only(s["verb"], ("id",), ("display",))
        self.is_iri(s["verb"]["id"])
        self.is_map(s["verb"]["display"])
        self.only(s["object"], ("id",), ("objectType", "definition"))
        self.is_iri(s["object"]["id"])
        self.only(s["object"]["definition"], (), ("name", "description", "type", "moreInfo", "extensions"))
        self.is_map(s["object"]["definition"]["name"])
        self.is_iri(s["object"]["definition"]["type"])
        self.only(s["result"], (), ("score", "success", "completion", "response", "duration", "extensions"))
        self.assertIsInstance(s["result"]["completion"], bool)
        self.assertRegex(s["result"]["duration"], DURATION)
        self.only(s["context"], (), ("registration", "instructor", "team", "contextActivities", "revision",
                                     "platform", "language", "statement", "extensions"))
        self.assertRegex(s["context"]["registration"], UUID)
        for extensions in (s["result"]["extensions"], s["context"]["extensions"]):
            for key in extensions:
                self.is_iri(key)

    def statements(self, *more):
        done = self.run_records("export", "--xapi", self.path("x.json"), *more)
        with open(self.path("x.json"), encoding="utf-8") as f:
            return json.load(f), done.stderr

    def test_xapi_statements_are_shaped_as_specified_and_cite_the_trace(self):
        site = "https://training.example.org/arthron"
        statements, told = self.statements("--site", site)
        self.assertIn("2 sessions are left out", told)
        self.assertEqual(len(statements), 2)
        for s in statements:
            self.is_statement(s)
        first, second = statements
        self.assertEqual(first["actor"]["account"], {"homePage": site, "name": "ada"})
        self.assertEqual(first["verb"]["id"], "http://adlnet.gov/expapi/verbs/completed")
        self.assertEqual(second["verb"]["id"], "http://adlnet.gov/expapi/verbs/attempted")
        self.assertEqual(first["object"]["id"], site + "/cases/tear%20radial%2F%C3%A4/00000000000000ff")
        self.assertEqual((first["result"]["completion"], first["result"]["duration"]), (True, "PT2.50S"))
        self.assertEqual(first["timestamp"], "2001-09-09T01:46:42.500Z")
        results = first["result"]["extensions"][site + "/xapi/results"]
        self.assertEqual([(r["metric"], r["value"], r["details"]) for r in results],
                         [("over", 4.5, {"below_floor": True}), ("rim", None, None)])
        trace = first["context"]["extensions"][site + "/xapi/trace"]
        self.assertEqual((trace["xxh3"], trace["file"], trace["session"]), ("00000000feedface", "0.trace", IDS[0]))
        self.assertEqual(stat.S_IMODE(os.stat(self.path("x.json")).st_mode), 0o600)
        again, _ = self.statements("--site", site)
        self.assertEqual(again, statements)
        for s in self.statements()[0]:
            self.is_statement(s)

    # ---- erasure

    def test_an_erased_trainee_is_nowhere_but_in_the_traces_that_are_named(self):
        erased = self.json("erase", "ada")
        self.assertEqual(erased["traces"], ["/srv/traces/0.trace", "/srv/traces/1.trace", "/srv/traces/2.trace"])
        self.run_records("export", "--csv", self.path("out"))
        statements, _ = self.statements()
        self.assertEqual({s["actor"]["account"]["name"] for s in statements}, {erased["pseudonym"]})
        self.assertEqual(len(self.json("list", "results")), 3)
        for folder, _, files in os.walk(self.folder):
            for name in files:
                with open(os.path.join(folder, name), "rb") as f:
                    text = f.read()
                for word in (b"Lovelace", b"Countess", b'"ada"', b",ada,"):
                    self.assertNotIn(word, text, name)
        text = self.run_records("erase", erased["pseudonym"]).stdout
        self.assertIn("these traces still hold the name:\n/srv/traces/0.trace\n", text)


if __name__ == "__main__":
    unittest.main(verbosity=2)
