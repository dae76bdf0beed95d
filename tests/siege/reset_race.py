"""Passwords and codes change while others sign in with the old ones. What came in by an old one is out, and no clock
keeps it in."""

import threading
import time
import unittest

from hall import PASSWORD, Hall, some_address
from siege import FULL, Siege

SIGNERS = 20 if FULL else 6  # at a time
ACCOUNTS = 20 if FULL else 2
TOGETHER = 4 if FULL else 2  # accounts that change at a time, so that several sign in to each
CHANGES = 5 if FULL else 2   # of each account
TRAINEES, CODES = (10, 10) if FULL else (2, 3)
HOUR = 3600


class Person:
    """Somebody whose secret changes; `secrets` has all, the last one is good."""

    def __init__(self, name, secret):
        self.name, self.secrets, self.lock = name, [secret], threading.Lock()
        self.cookies = []  # (number of the secret, cookie)
        self.over = 0      # sign-ins that were under way while the secret changed

    def current(self):
        with self.lock:
            return len(self.secrets) - 1, self.secrets[-1]

    def answered(self, number, cookie):
        """cookie: None where it was refused."""
        with self.lock:
            if cookie:
                self.cookies.append((number, cookie))
            self.over += number < len(self.secrets) - 1


class ResetRace(Hall, Siege):
    def setUp(self):
        super().setUp()
        self.server = self.serve()
        self.grace = self.make_first(self.server)

    def in_parallel(self, people, body_of, work):
        """Signs in as these people, again and again, while `work` runs."""
        stop, faults = threading.Event(), []

        def sign_in(person):
            while not stop.is_set():
                number, secret = person.current()
                try:
                    answer = self.ask("POST", "/sign-in", body_of(person, secret), source=some_address())
                except OSError as fault:
                    faults.append(fault)
                    return
                if answer.status in (200, 401):
                    person.answered(number, answer.cookie if answer.status == 200 else None)
                elif answer.status not in (429, 503):
                    faults.append((answer.status, answer.bytes))
                if answer.status in (429, 503):
                    stop.wait(0.2)

        threads = [threading.Thread(target=sign_in, args=(people[i % len(people)],)) for i in range(SIGNERS)]
        for thread in threads:
            thread.start()
        try:
            work()
        finally:
            stop.set()
            for thread in threads:
                thread.join()
        self.assertEqual(faults, [])

    def check(self, people, what):
        """Every cookie of an old secret is out, every one of the last is in unless it was one of too many."""
        old = [cookie for p in people for number, cookie in p.cookies if number < len(p.secrets) - 1]
        for cookie in old:
            answer = self.ask("GET", "/me", cookie=cookie, source=some_address())
            self.assertEqual(answer.status, 401, "a cookie of an old secret is in")
        entries = sum(len(p.cookies) for p in people)
        self.figure(f"sign-ins with {what}", entries)
        self.figure("tries that were under way over a change", sum(p.over for p in people))
        self.figure(f"changes of {what}", sum(len(p.secrets) - 1 for p in people))
        self.assertGreater(len(old), 0)

    # ---- passwords

    def change_password(self, person, number):
        """Every other change is the owner's own, unless too many have signed in as they."""
        secret, old = f"another password {number}", person.current()[1]
        entry = self.sign_in(person.name, old, source=some_address()) if number % 2 == 0 else None
        if entry and entry.status == 200:
            self.done("PATCH", "/me", {"password": old, "new_password": secret}, entry.cookie)
        else:
            self.done("PATCH", f"/accounts/{person.name}", {"password": secret}, self.grace)
        return secret

    def test_a_new_password_ends_what_came_in_by_the_old_one(self):
        people = [Person(f"account-{i}", PASSWORD) for i in range(ACCOUNTS)]
        for person in people:
            self.done("POST", "/accounts", {"name": person.name, "role": "technician", "password": PASSWORD},
                      self.grace)

        def change_all(some):
            for number in range(1, CHANGES + 1):
                for person in some:
                    secret = self.change_password(person, number)
                    with person.lock:
                        person.secrets.append(secret)

        for first in range(0, ACCOUNTS, TOGETHER):
            some = people[first:first + TOGETHER]
            self.in_parallel(some, lambda person, secret: {"name": person.name, "password": secret},
                             lambda: change_all(some))
        self.check(people, "passwords")

    # ---- codes

    def test_a_new_code_ends_what_came_in_by_the_old_one(self):
        def new_code(name):
            return self.done("POST", f"/trainees/{name}/code", {}, self.grace).json["code"]

        people = []
        for i in range(TRAINEES):
            self.done("POST", "/trainees", {"name": f"trainee-{i}"}, self.grace)
            people.append(Person(f"trainee-{i}", new_code(f"trainee-{i}")))

        def change_all():
            for _ in range(CODES):
                for person in people:
                    time.sleep(0.02)
                    with person.lock:  # nobody has the new one before the old one is told to be old
                        person.secrets.append(new_code(person.name))

        self.in_parallel(people, lambda person, secret: {"code": secret}, change_all)
        self.check(people, "codes")

    # ---- time

    def serve_later(self, off_s):
        self.assertEqual(self.server.end(), 0)
        self.server = self.serve(off_s=off_s)

    @unittest.skipUnless(FULL, "takes many starts of the server")
    def test_no_use_keeps_a_cookie_for_more_than_a_week(self):
        self.done("POST", "/trainees", {"name": "ada"}, self.grace)
        code = self.done("POST", "/trainees/ada/code", {}, self.grace).json["code"]
        ada = self.done("POST", "/sign-in", {"code": code}).cookie
        for hours in range(11, 8 * 24, 11):  # each time before the twelve hours are over
            self.serve_later(hours * HOUR)
            self.assertEqual(self.ask("GET", "/me", cookie=self.grace).status, 200 if hours < 7 * 24 else 401, hours)
            self.assertEqual(self.ask("GET", "/me", cookie=ada).status, 200 if hours < 12 else 401, hours)
            self.assertEqual(self.ask("POST", "/sign-in", {"code": code}).status, 200 if hours < 12 else 401, hours)

    @unittest.skipUnless(FULL, "takes another start of the server")
    def test_a_cookie_that_nobody_uses_ends_after_twelve_hours(self):
        self.assertEqual(self.ask("GET", "/me", cookie=self.grace).status, 200)
        self.serve_later(13 * HOUR)
        self.assertEqual(self.ask("GET", "/me", cookie=self.grace).status, 401)


if __name__ == "__main__":
    unittest.main(verbosity=2)
