#!/usr/bin/env python3
"""Servers that share their records: what one writes, all have. NATS is a real server of it."""

import os
import shutil
import signal
import sqlite3
import unittest

from arthron import call, call_json, wait_until
from asking import PASSWORD
from several import Several

TABLES = ("trainee", "course", "enrolment", "station", "session", "part", "account", "token", "audit", "attempt")


class SharedRecords(Several):
    names = ("a", "b", "c")

    def records(self, name, *words, **more):
        return call("arthron-server", "records", "--file", self.file(name), *words, **more)

    def rows(self, name):
        database = sqlite3.connect(self.file(name), timeout=10)
        try:
            return {table: database.execute(f"SELECT * FROM {table} ORDER BY 1, 2").fetchall() for table in TABLES}
        finally:
            database.close()

    def trainees(self, name):
        return {row["name"] for row in call_json("arthron-server", "records", "--file", self.file(name), "list",
                                                 "trainees")}

    def wait_for_equal(self, *names):
        first, *others = names
        wait_until("equal records", lambda: all(self.rows(first) == self.rows(other) for other in others))

    def wait_for_trainee(self, server, trainee):
        wait_until(f"{trainee} at {server}", lambda: trainee in self.trainees(server))

    def test_who_signs_in_at_one_server_is_signed_in_at_all(self):
        grace = self.make_first_at(self.start_named("a"), "a")
        self.start_named("b")
        self.wait_for_equal("a", "b")
        self.at("b")
        self.assertEqual(self.get("/me", grace)["account"]["name"], "grace")
        self.ask("POST", "/trainees", {"name": "ada"}, grace, 201)
        self.at("a")
        wait_until("ada at a", lambda: self.get("/trainees", grace)["trainees"])
        self.ask("POST", "/accounts", {"name": "tom", "role": "technician", "password": PASSWORD}, grace, 201)
        self.records("a", "add", "course", "autumn")  # another program writes too
        self.wait_for_equal("a", "b")
        self.at("b")
        tom = self.sign_in(name="tom", password=PASSWORD)
        self.ask("POST", "/me/sign-out", {}, tom, 204)
        self.wait_for_equal("a", "b")
        self.at("a")
        self.ask("GET", "/me", who=tom, status=401)
        self.assertIn(("tom", "sign out"), [(r["actor"], r["action"]) for r in self.get("/audit", grace)["audit"]])
        for name in "ab":
            self.records(name, "verify")

    def make_first_at(self, server, name):
        self.at(name)
        return self.make_first(server)

    def test_what_was_written_without_nats_comes_later_and_the_first_of_two_counts(self):
        for name in "abc":
            self.start_named(name)
        self.records("a", "add", "trainee", "ada")
        self.wait_for_equal("a", "b", "c")
        self.nats.end(signal.SIGKILL)
        for name, full_name in (("a", "At a"), ("b", "At b")):
            self.records(name, "add", "trainee", "eve", "--full-name", full_name)
            self.records(name, "add", "trainee", "only-" + name)
        self.servers["c"].end(signal.SIGKILL)
        self.start_nats()
        for name in "ab":
            for other in "ab":
                self.wait_for_trainee(name, "only-" + other)
        self.start_named("c")
        self.wait_for_equal("a", "b", "c")
        people = {row["name"]: row["full_name"] for row in call_json(
            "arthron-server", "records", "--file", self.file("c"), "list", "trainees")}
        self.assertEqual(set(people), {"ada", "eve", "only-a", "only-b"})
        self.assertIn(people["eve"], ("At a", "At b"))
        dropped = [name for name in "ab" if "contradicts an earlier one" in self.servers[name].log()]
        self.assertEqual(len(dropped), 2)  # both tell it
        for name in "abc":
            self.records(name, "verify")

    def test_a_server_with_records_of_its_own_keeps_them_beside(self):
        self.records("b", "add", "trainee", "ben")
        self.start_named("a")
        self.records("a", "add", "trainee", "ada")
        self.start_named("b")
        self.wait_for_trainee("b", "ada")
        self.assertNotIn("ben", self.trainees("b"))
        self.assertIn("own are kept in", self.servers["b"].log())
        self.wait_for_equal("a", "b")

    def test_a_server_that_was_away_for_long_takes_a_copy(self):
        for name in "ab":
            self.start_named(name)
        self.records("a", "add", "trainee", "ada")
        self.wait_for_equal("a", "b")
        self.servers["b"].end()
        self.records("b", "add", "trainee", "written-while-away")
        self.records("a", "add", "trainee", "eve", "--full-name", "To be forgotten")
        self.records("a", "erase", "eve")  # NATS forgets what was before
        wait_until("a copy", lambda: self.servers["a"].log().count("a copy of the records is with NATS") == 2)
        self.records("a", "add", "trainee", "fay")
        self.start_named("b")
        self.wait_for_trainee("b", "fay")
        self.wait_for_trainee("a", "written-while-away")
        self.wait_for_equal("a", "b")
        for folder, _, files in os.walk(self.path("nats")):
            for file in files:
                with open(os.path.join(folder, file), "rb") as f:
                    self.assertFalse(b"To be forgotten" in f.read(), file)

    def test_where_nats_lost_all_the_first_server_gives_its_records(self):
        for name in "ab":
            self.start_named(name)
        self.records("a", "add", "trainee", "ada")
        self.wait_for_equal("a", "b")
        for name in "ab":
            self.servers[name].end()
        self.nats.end()
        shutil.rmtree(self.path("nats"))
        self.records("b", "add", "trainee", "newest")
        self.start_nats()
        self.start_named("b")
        self.servers["b"].wait_for_log("a copy of the records is with NATS")
        self.start_named("a")
        self.wait_for_trainee("a", "newest")
        self.assertIn("own are kept in", self.servers["a"].log())
        self.records("a", "add", "trainee", "eve")
        self.wait_for_trainee("b", "eve")
        self.wait_for_equal("a", "b")
        self.assertLessEqual({"ada", "newest", "eve"}, self.trainees("b"))

    def test_a_server_whose_backup_is_restored_joins_again(self):
        for name in "ab":
            self.start_named(name)
        self.records("a", "add", "trainee", "ada")
        self.wait_for_equal("a", "b")
        call("arthron-server", "backup", "--file", self.file("b"), "--out", self.path("backup.db"))
        self.records("b", "add", "trainee", "eve")
        self.wait_for_equal("a", "b")
        self.servers["b"].end()
        call("arthron-server", "restore", self.path("backup.db"), "--file", self.file("b"))
        self.assertNotIn("eve", self.trainees("b"))
        self.start_named("b")
        self.wait_for_trainee("b", "eve")
        self.records("b", "add", "trainee", "fay")
        self.wait_for_trainee("a", "fay")
        self.wait_for_equal("a", "b")
        self.records("b", "verify")

    def test_an_older_copy_of_the_file_is_found_out(self):
        for name in "ab":
            self.start_named(name)
        self.records("b", "add", "trainee", "ada")
        self.wait_for_equal("a", "b")
        self.servers["b"].end()
        shutil.copy(self.file("b"), self.path("older.db"))
        self.start_named("b")
        self.records("b", "add", "trainee", "eve")
        self.wait_for_equal("a", "b")
        self.servers["b"].end()
        shutil.copy(self.path("older.db"), self.file("b"))
        self.start_named("b")
        self.wait_for_trainee("b", "eve")
        self.assertIn("older copy", self.servers["b"].log())
        self.records("b", "add", "trainee", "fay")
        self.wait_for_trainee("a", "fay")
        self.wait_for_equal("a", "b")

    def test_a_server_waits_for_nats_at_its_first_start_alone(self):
        self.start_named("a")
        self.nats.end(signal.SIGKILL)
        self.servers["a"].end(signal.SIGKILL)
        self.start_named("a")
        b = self.launch("b")
        b.wait_for_log("the records are not shared for now")
        self.assertEqual(b.end(), 0)
        self.start_nats()
        self.start_named("b")
        self.records("a", "add", "trainee", "ada")
        self.wait_for_trainee("b", "ada")


if __name__ == "__main__":
    unittest.main()
