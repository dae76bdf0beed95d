#!/usr/bin/env python3
"""Sign-on at a provider of OpenID Connect: who is meant comes in, and nobody else, whatever provider and browser do."""

import contextlib
import hmac
import http.client
import os
import re
import sqlite3
import ssl
import threading
import time
import unittest
import urllib.parse

from arthron import call, free_port, wait_until
from asking import Asking
from provider import CLIENT, SECRET, Provider, base64url

IN = "/#/signed-on"
AGAIN, REFUSED, UNKNOWN, AWAY, CANCELLED = (
    f"/#/sign-in?sign-on={word}" for word in ("again", "refused", "unknown", "away", "cancelled"))


def keyed_hash(key, what, text):
    """As server/api/secret.h has it."""
    return hmac.new(key, f"{what}\n{text}".encode(), "sha256").hexdigest()


class Browser:
    """Keeps the cookies of the console, and follows no redirect by itself."""

    def __init__(self, test):
        self.test, self.cookies = test, {}

    def open(self, path, status=303):
        """Where the console sends it."""
        connection = http.client.HTTPSConnection("127.0.0.1", self.test.web_port, context=self.test.trust, timeout=60)
        cookies = "; ".join(f"{name}={value}" for name, value in self.cookies.items())
        connection.request("GET", path, headers={"Cookie": cookies} if cookies else {})
        self.answer = connection.getresponse()
        self.answer.bytes = self.answer.read()
        connection.close()
        self.test.assertEqual(self.answer.status, status, self.answer.bytes[:300])
        for cookie in self.answer.headers.get_all("Set-Cookie") or []:
            name, value = cookie.split(";")[0].split("=", 1)
            self.cookies[name] = value
            if "Max-Age=0" in cookie:
                del self.cookies[name]
        return self.answer.headers["Location"]

    def leave(self):
        return self.open("/api/v1/sign-on/start")

    def visit_provider(self, url):
        """The path to which the provider sends it back."""
        place = urllib.parse.urlparse(url)
        connection = http.client.HTTPSConnection(place.netloc, context=self.test.provider_trust, timeout=60)
        connection.request("GET", f"{place.path}?{place.query}")
        back = connection.getresponse().headers["Location"]
        connection.close()
        origin = f"https://127.0.0.1:{self.test.web_port}"
        self.test.assertTrue(back.startswith(origin + "/api/v1/sign-on/back?"), back)
        return back[len(origin):]

    def sign_on(self):
        return self.open(self.visit_provider(self.leave()))


class SignOn(Asking):
    def setUp(self):
        super().setUp()
        self.provider_port = free_port()
        for name in ("provider", "stranger"):
            call("arthron-server", "keys", "init", self.path(name))
        self.provider_trust = ssl.create_default_context(cafile=self.path("provider/authority.pem"))
        self.open_provider()
        self.write("secret", SECRET + "\n")

    def open_provider(self, keys="provider"):
        self.provider = Provider(self.path(keys), self.provider_port)
        self.addCleanup(self.provider.end)

    def settings(self, **changes):
        keys = {"issuer": self.provider.issuer, "client_id": CLIENT, "client_secret": "secret",
                "name": "Sign on with St. Mary's", "claim": "preferred_username",
                "authority": "provider/authority.pem", **changes}
        lines = "".join(f"{key} = {value}\n" for key, value in keys.items() if value)
        return f"records = records.db\n[web]\naddress = 127.0.0.1\nport = {self.web_port}\n[sign_on]\n{lines}"

    def serve(self, **changes):
        self.server = self.start_server("", self.settings(**changes))
        self.grace = self.make_first(self.server)

    def browser(self):
        return Browser(self)

    def assert_nobody(self, browser):
        self.assertNotIn("arthron", browser.cookies)

    def refused(self, where, browser=None):
        browser = browser or self.browser()
        self.assertEqual(browser.sign_on(), where)
        self.assert_nobody(browser)

    def audit(self, action):
        with sqlite3.connect(self.path("records.db"), timeout=60) as db:
            rows = db.execute("SELECT actor, subject FROM audit WHERE action = ? ORDER BY id", (action,)).fetchall()
        db.close()
        return rows

    def sign_in_as_grace(self):
        answer = self.ask("POST", "/sign-in", {"name": "grace", "password": "correct horse battery"})
        return answer.headers["Set-Cookie"]

    # ---- who is meant comes in

    def test_a_person_signs_on_to_the_account_of_that_name(self):
        self.serve()
        tom = {"name": "tom", "role": "technician", "password": "correct horse battery"}
        self.ask("POST", "/accounts", tom, self.grace, 201)
        self.assertEqual(self.get("/sign-on", None), {"name": "Sign on with St. Mary's"})
        browser = self.browser()
        for name, role in (("grace", "instructor"), ("tom", "technician")):
            self.provider.person = {"preferred_username": name}
            self.assertEqual(browser.sign_on(), IN)
            self.assertRegex(browser.answer.headers.get_all("Set-Cookie")[0],
                             "^arthron=[0-9a-f]{64}; Path=/; HttpOnly; SameSite=Strict; Secure$")
            self.assertNotIn("arthron-sign-on", browser.cookies)
            me = self.get("/me", {"cookie": browser.cookies["arthron"]})
            self.assertEqual(me["account"], {"name": name, "role": role, "trainee": ""})
        self.assertEqual(self.provider.wrong, [])
        self.assertEqual(self.provider.asked, ["/realms/ward/.well-known/openid-configuration",
                                               "/realms/ward/token", "/realms/ward/token"])
        self.assertEqual(self.audit("sign on"), [("grace", "account 1"), ("tom", "account 2")])

    def test_the_cookie_of_a_sign_on_is_short_lived_and_for_its_path_alone(self):
        self.serve()
        browser = self.browser()
        self.assertTrue(browser.leave().startswith(self.provider.issuer + "/authorize?tenant=1&response_type=code&"))
        self.assertRegex(browser.answer.headers["Set-Cookie"], "^arthron-sign-on=[0-9a-f]{48}; Path=/api/v1/sign-on; "
                         "Max-Age=600; HttpOnly; SameSite=Lax; Secure$")

    def test_a_provider_that_takes_the_secret_in_the_body_gets_it_there(self):
        self.provider.takes_post = True
        self.serve()
        self.assertEqual(self.browser().sign_on(), IN)

    def test_a_client_without_a_secret_sends_none(self):
        self.provider.secret = None
        self.serve(client_secret=None)
        self.assertEqual(self.browser().sign_on(), IN)

    def test_the_claim_is_that_of_the_config_and_an_email_only_a_verified_one(self):
        self.serve(claim="email")
        self.provider.person = {"preferred_username": "grace", "email": "grace"}
        self.refused(REFUSED)
        self.provider.person["email_verified"] = True
        self.assertEqual(self.browser().sign_on(), IN)

    def test_another_server_with_the_same_key_takes_the_browser_back(self):
        self.serve()
        browser = self.browser()
        back = browser.visit_provider(browser.leave())
        self.server.end()
        self.server = self.start_server("", self.settings())
        self.assertEqual(browser.open(back), IN)

    # ---- nobody else

    def test_a_browser_that_did_not_begin_it_stays_outside(self):
        self.serve()
        begun, other = self.browser(), self.browser()
        back = begun.visit_provider(begun.leave())
        self.assertEqual(other.open(back), AGAIN)  # without a cookie
        other.leave()
        self.assertEqual(other.open(back), AGAIN)  # with that of another sign-on
        self.assert_nobody(other)
        self.assertEqual(self.provider.asked.count("/realms/ward/token"), 0)
        self.assertEqual(begun.open(re.sub("state=[^&]*", "state=" + "0" * 64, back)), AGAIN)
        self.assert_nobody(begun)
        self.assertEqual(self.provider.asked.count("/realms/ward/token"), 0)
        self.server.wait_for_log("the browser brings no cookie that fits")

    def test_a_sign_on_that_took_too_long_is_begun_again(self):
        self.serve()
        with open(self.path("keys/web.key"), "rb") as f:
            key = f.read()
        for age_s, where in ((590, REFUSED), (610, AGAIN), (-50, REFUSED), (-70, AGAIN)):
            with self.subTest(age_s):
                head = f"{time.time_ns() - age_s * 10**9:016x}" + os.urandom(16).hex()
                state = keyed_hash(key, "sign-on state", head)
                browser = self.browser()
                browser.cookies["arthron-sign-on"] = head
                self.assertEqual(browser.open(f"/api/v1/sign-on/back?state={state}&code=x"), where)

    def test_a_sign_on_serves_once(self):
        self.serve()
        browser = self.browser()
        back = browser.visit_provider(browser.leave())
        kept = browser.cookies["arthron-sign-on"]
        self.assertEqual(browser.open(back), IN)
        thief = self.browser()
        thief.cookies["arthron-sign-on"] = kept
        self.assertEqual(thief.open(back), AGAIN)
        self.assert_nobody(thief)
        self.assertEqual(self.provider.asked.count("/realms/ward/token"), 1)

    def test_an_id_token_that_is_not_for_this_sign_on_is_refused(self):
        self.serve()
        now = time.time()
        wrong = [{"nonce": "0" * 64}, {"nonce": None}, {"iss": "https://127.0.0.1:1"}, {"iss": None},
                 {"aud": "another"}, {"aud": ["another"]}, {"aud": None}, {"aud": []}, {"aud": [CLIENT, "another"]},
                 {"aud": [CLIENT, "another"], "azp": CLIENT}, {"azp": "another"},
                 {"exp": now - 120}, {"exp": None}, {"exp": "tomorrow"}, {"iat": now + 300}, {"iat": now - 3600},
                 {"iat": None}, {"preferred_username": None}, {"preferred_username": ["grace"]},
                 {"preferred_username": "g" * 64}, {"preferred_username": "a/b"}, {"preferred_username": ""}]
        for claims in wrong:
            with self.subTest(claims):
                self.provider.claims = claims
                self.refused(REFUSED)
        for claims in ({"aud": [CLIENT]}, {"azp": CLIENT}, {"exp": now - 30}, {"iat": now + 30}):
            with self.subTest(claims):
                self.provider.claims = claims
                self.assertEqual(self.browser().sign_on(), IN)
        self.assertIn("the ID token is of another sign-on (nonce)", self.server.log())
        self.assertEqual(self.audit("wrong sign-on")[0], ("server", "a code"))

    def test_what_is_no_id_token_is_told_from_one(self):
        self.serve()
        payload = base64url(b'{"iss":')
        for token in ("x", "a.b", "a.!.c", f"e30.{payload}.c", "e30.W10.c", "e30.e30.e30.e30", "a.b.c.d.e"):
            with self.subTest(token):
                self.provider.id_token = token
                self.refused(AWAY)

    def test_somebody_without_an_account_is_told_so(self):
        self.serve()
        self.provider.person = {"preferred_username": "zoë & co"}
        self.refused(UNKNOWN)
        self.assertEqual(self.audit("wrong sign-on"), [("server", "no account")])
        self.assertNotIn("zoë", self.server.log())

    def bring(self, **query):
        """Where the console sends a browser that comes back with this."""
        browser = self.browser()
        state = re.search("state=([0-9a-f]{64})", browser.leave())[1]
        return browser.open("/api/v1/sign-on/back?" + urllib.parse.urlencode({"state": state, **query}))

    def test_a_refusal_by_the_provider_is_not_repeated_to_the_page(self):
        self.serve()
        self.assertEqual(self.bring(error="access_denied"), CANCELLED)
        self.assertEqual(self.audit("wrong sign-on"), [])
        self.assertEqual(self.bring(error="login_required", error_description="<b>call 555"), REFUSED)
        self.server.wait_for_log("the provider gives no code: login_required")
        self.assertEqual(self.bring(error="<b>call 555"), REFUSED)
        self.assertEqual(self.bring(), REFUSED)
        self.server.wait_for_log("the provider gives no code: no reason")
        self.assertNotIn("555", self.server.log())

    def test_a_client_that_the_provider_does_not_know_is_nobodys_try(self):
        self.serve()
        self.provider.secret = "changed"
        self.refused(AWAY)
        self.server.wait_for_log("/token: status 401 invalid_client")
        self.assertEqual(self.audit("wrong sign-on"), [])

    def test_an_account_without_a_password_stays_outside(self):
        self.serve()
        with sqlite3.connect(self.path("records.db"), timeout=60) as db:
            self.assertEqual(db.execute("UPDATE account SET password = NULL WHERE name = 'grace'").rowcount, 1)
        db.close()
        self.refused(UNKNOWN)

    def test_who_tries_on_and_on_has_to_wait(self):
        self.serve()
        said = [self.bring(code="y") for _ in range(80)]
        self.assertEqual(said[:50], [REFUSED] * 50)
        self.assertIn("/#/sign-in?sign-on=too-many", said)

    def test_what_others_send_a_browser_to_uses_up_no_tries(self):
        self.serve()
        said = {self.browser().open("/api/v1/sign-on/back?state=x&code=y") for _ in range(80)}
        self.assertEqual(said, {AGAIN})
        self.assertEqual(self.browser().sign_on(), IN)

    # ---- a provider that does not work

    def test_a_provider_with_the_certificate_of_a_stranger_is_not_asked(self):
        self.provider.end()
        self.open_provider("stranger")
        self.serve()
        self.assertEqual(self.browser().leave(), AWAY)
        self.assertEqual(self.provider.asked, [])
        self.server.wait_for_log("SSL certificate problem")

    def test_a_provider_that_is_down_or_moved_keeps_no_password_out(self):
        self.serve()
        browser = self.browser()
        back = browser.visit_provider(browser.leave())
        self.provider.end()
        self.assertEqual(browser.open(back), AWAY)
        self.assert_nobody(browser)
        self.assertIn("arthron", self.sign_in_as_grace())

    def test_what_a_provider_says_of_itself_must_be_true_and_safe(self):
        self.serve()
        token = self.provider.issuer + "/token"
        for said in ({"issuer": self.provider.issuer + "/"}, {"issuer": None}, {"authorization_endpoint": "http://a/b"},
                     {"authorization_endpoint": "https://a/b\r\nSet-Cookie: arthron=1"}, {"token_endpoint": None},
                     {"token_endpoint": token.replace("https", "http")}, {"token_endpoint": "https://a/" + "b" * 600},
                     {"token_endpoint_auth_methods_supported": ["private_key_jwt"]}):
            with self.subTest(said):
                self.provider.said = said
                self.assertEqual(self.browser().leave(), AWAY)
        self.provider.said = {}
        for answer in (b"", b"[]", b'{"issuer":', b" " * 70000, b'{"a":"' + b"x" * 70000 + b'"}'):
            with self.subTest(answer[:10]):
                self.provider.answer_bytes = answer
                self.assertEqual(self.browser().leave(), AWAY)
        self.assertIn("the answer has more than 65536 bytes", self.server.log())
        self.provider.answer_bytes = None
        self.assertEqual(self.browser().sign_on(), IN)
        self.provider.answer_bytes = b"x" * 70000
        browser = self.browser()
        self.assertEqual(browser.open(browser.visit_provider(browser.leave())), AWAY)

    def test_a_slow_provider_holds_up_four_and_nobody_else(self):
        self.serve()
        self.provider.hang = True
        where = []
        threads = [threading.Thread(target=lambda: where.append(self.browser().leave())) for _ in range(4)]
        for thread in threads:
            thread.start()
        wait_until("all four are asked", lambda: len(self.provider.asked) == 4)
        self.assertEqual(self.browser().leave(), "/#/sign-in?sign-on=busy")
        self.sign_in_as_grace()
        for thread in threads:
            thread.join()
        self.assertEqual(where, [AWAY] * 4)
        self.server.wait_for_log("Operation timed out")

    def test_a_server_ends_while_a_provider_is_slow(self):
        self.serve()
        self.provider.hang = True

        def leave():
            with contextlib.suppress(OSError, http.client.HTTPException, AssertionError):  # its server ends
                self.browser().leave()
        thread = threading.Thread(target=leave)
        thread.start()
        wait_until("it is asked", lambda: self.provider.asked)
        self.server.end()
        thread.join()
        self.assertNotIn("sign-on from", self.server.log())

    # ---- the config

    def test_a_config_that_cannot_be_is_refused_at_the_start(self):
        rows = [({"issuer": self.provider.issuer.replace("https", "http")}, 2, "it must begin with https://"),
                ({"issuer": None}, 2, '[sign_on] needs the key "issuer"'),
                ({"client_id": None}, 2, '[sign_on] needs the key "client_id"'),
                ({"name": None}, 2, '[sign_on] needs the key "name"'),
                ({"claim": None}, 2, '[sign_on] needs the key "claim"'),
                ({"client_secret": "empty"}, 1, "the first line must have 1 to 254 bytes"),
                ({"client_secret": "long"}, 1, "the first line must have 1 to 254 bytes"),
                ({"issuer": "https://"}, 1, "[sign_on] issuer = https://: not an address"),
                ({"issuer": "https://me@sso.example.org"}, 1, "not an address like https://sso.example.org"),
                ({"client_secret": "nowhere"}, 1, "nowhere"), ({"authority": "nowhere"}, 1, "[sign_on] authority = ")]
        self.write("empty", "\nx\n")
        self.write("long", "x" * 255 + "\n")
        for changes, code, told in rows:
            with self.subTest(changes):
                config = self.server_config("", self.settings(**changes))
                self.assertIn(told, call("arthron-server", "run", "--config", config, code=code).stderr)

    def test_without_it_there_is_none(self):
        self.server = self.serve_web("")
        self.assertEqual(self.get("/sign-on", None), {"name": None})
        for path in ("start", "back"):
            self.ask("GET", "/sign-on/" + path, status=404)


if __name__ == "__main__":
    unittest.main()
