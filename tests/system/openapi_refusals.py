"""For the test openapi: what operations of /api/v1 refuse, one by one and all alike. A test with it has called all of
them (openapi_calls.py)."""

import re
import sqlite3
import time
from concurrent.futures import ThreadPoolExecutor

from arthron import PATIENCE_S
from hall import PASSWORD
from openapi_calls import CHECKLIST, LEVELS, LOST

# What is good but for the names in the path.
VALID = {("PATCH", "/accounts/{name}"): {"name": "x"}, ("PATCH", "/trainees/{name}"): {"name": "x"},
         ("PATCH", "/courses/{name}"): {"name": "x"}, ("POST", "/courses/{name}/trainees"): {"trainee": "ada"},
         ("POST", "/stations/{name}/attempt"): {"task": "look"}, ("POST", "/exams/{id}/begin"): CHECKLIST,
         ("POST", "/exams/{id}/interventions"): {"reason": "a fall"},
         ("POST", "/attempts/{session}/{number}/ratings"): LEVELS,
         ("PUT", "/courses/{name}/curriculum"): {"version": 0, "state": "draft", "tasks": [{"task": "look"}]}}


class Refusals:
    def refuse_all(self):
        self.refusals()
        self.wrong_requests()
        self.limits()
        self.broken_records()

    # ---- what every operation refuses

    def refusals(self):
        for method, path, operation in self.described.operations():
            if operation["x-role"] != ["server"]:
                self.refuse(method, path, operation)
        for path, item in self.described.whole["paths"].items():
            other = next(method for method in ("PUT", "DELETE", "POST") if method.lower() not in item)
            self.refused_by_no_operation(other, path, 405, "wrong_method")
        self.refused_by_no_operation("GET", "/nothing", 404, "not_found")

    def refused_by_no_operation(self, method, path, status, code):
        answer = self.asker.send(method, re.sub("{.*?}", "x", path), {}, self.grace)
        self.assertEqual((answer.status, answer.code), (status, code), (method, path))

    def people_for(self, roles):
        """Who may, or nobody where anybody may; and who may not."""
        people = {"instructor": self.grace, "technician": self.tom, "trainee": self.ada}
        who = next((people[role] for role in people if role in roles), None)
        return who, [people[role] for role in people if who and role not in roles]

    def refuse(self, method, path, operation):
        who, others = self.people_for(operation["x-role"])
        body = None if method in ("GET", "DELETE") else {}
        if who:
            self.ask(method, path, body, None, 401, "not_signed_in", **self.names_for(path))
        for other in others:
            self.ask(method, path, body, other, 403, "not_allowed", **self.names_for(path))
        if "requestBody" in operation:
            self.ask(method, path, "no JSON", who, 400, "wrong_body", **self.names_for(path))
            self.ask(method, path, {"nothing": ""}, who, 400, "wrong_field", **self.names_for(path))
        if any(parameter["in"] == "query" for parameter in operation.get("parameters", [])):
            self.ask(method, path, body, who, 400, "wrong_query", "?nothing=1", **self.names_for(path))
        if "{" in path:
            query = "?case=healthy&upper=autumn&lower=winter" if "expert" in path else ""
            valid = VALID.get((method, path), body)
            self.ask(method, path, valid, who, 404, "not_found", query, **self.names_for(path, False))

    def names_for(self, path, there=True):
        kind = path.split("/")[1]
        own = {"accounts": "tom", "trainees": "ada", "courses": "autumn", "tasks": "look", "cases": "healthy",
               "stations": "room-1", "sessions": self.of_ada, "attempts": self.of_ada}.get(kind, "999")
        name = own if there else {"sessions": "f" * 32, "attempts": "f" * 32}.get(kind, "999")
        return {"name": name, "id": name, "session": name, "number": 1, "trainee": "ada"}

    def wrong_requests(self):
        """What the server refuses before it looks at the operation."""
        ask, grace, at = self.ask, self.grace, "/courses"
        ask("GET", "/me", None, grace, 421, "host", headers={"Host": "elsewhere.example.org"})
        ask("GET", "/me", None, grace, 400, "host", headers={"Host": "a" * 400})
        ask("GET", "/me", None, grace, 400, "address", "?" + "a" * 3000)
        ask("POST", at, {"name": "x"}, {**self.ada, "Origin": "https://elsewhere.example.org"}, 403, "origin")
        ask("POST", at, iter([b"{}"]), {**grace, "Transfer-Encoding": "chunked"}, 411, "length")
        ask("POST", at, " " * 70000, grace, 413, "too_large")
        ask("POST", at, "[" * 9, grace, 413, "too_large")

    def limits(self):
        ask, wrong = self.ask, {"name": "nobody", "password": "wrong"}
        self.until_too_many("POST", "/sign-in", wrong)
        self.until_too_many("POST", "/first", {"secret": self.secret, "name": "x", "password": PASSWORD})
        ulf = self.account("ulf-2", "technician")
        self.until_too_many("PATCH", "/me", {"password": "wrong", "new_password": PASSWORD}, ulf)
        told = (ask("GET", "/tasks/{name}/expert", None, self.iris, query="?case=healthy", name=f"lost-{i}").status
                for i in range(LOST))
        self.assertIn(429, told)

        with ThreadPoolExecutor(4) as pool:
            told = list(pool.map(self.until_too_fast, self.asker.others(4)))
        self.assertIn(429, told)

    def until_too_fast(self, asker):
        """The last status that one of those gets who ask at the same time."""
        ends = time.monotonic() + PATIENCE_S
        while True:
            answer = asker.send("GET", "/healthz")
            self.assertEqual(self.described.take("GET", "/healthz", answer), "")
            if answer.status == 429 or time.monotonic() > ends:
                return answer.status

    def until_too_many(self, method, path, body, who=None):
        for _ in range(100):
            answer = self.ask(method, path, body, who)
            if answer.status == 429:
                break
        self.assertEqual(answer.code, "too_many")

    def broken_records(self):
        """Somebody else holds the records, and takes a table away."""
        self.ask("POST", "/courses", {"name": "late"}, self.grace, 201)
        with sqlite3.connect(self.path("records.db"), timeout=20, isolation_level=None) as db:
            db.execute("BEGIN IMMEDIATE")
            self.ask("POST", "/courses", {"name": "later"}, self.grace, 503, "busy")
            db.execute("ROLLBACK")
            db.execute("ALTER TABLE course RENAME TO gone")
            self.ask("GET", "/courses", None, self.grace, 500, "failed")
            db.execute("ALTER TABLE gone RENAME TO course")
        db.close()
