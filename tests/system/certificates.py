"""Certificates that end: warned of, renewed while the programs run, and those before them void."""

import os
import shutil
import ssl
import socket
import subprocess
import time
import unittest
from unittest import mock

from arthron import SystemTest, call, call_json, free_port, wait_until

DAY_S = 86400


def openssl(*arguments):
    subprocess.run(["openssl", *arguments], check=True, capture_output=True, stdin=subprocess.DEVNULL, timeout=60)


def shown(port):
    """The certificate, DER, that a server shows to a new connection."""
    context = ssl.create_default_context()
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    with socket.create_connection(("127.0.0.1", port), timeout=10) as plain:
        with context.wrap_socket(plain) as secured:
            return secured.getpeercert(binary_form=True)


class Certificates(SystemTest):
    def make_short(self, folder, name, use, days, names=""):
        """key and certificate of the authority, good for some days, in place of those that are there."""
        key, certificate = os.path.join(folder, name + ".key"), os.path.join(folder, name + ".pem")
        request, extensions = self.path("request"), self.path("extensions")
        subject = "/CN=" + ("room-1" if use == "clientAuth" else "Arthron server")
        openssl("req", "-new", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-keyout", key,
                "-subj", subject, "-out", request)
        self.write("extensions", f"basicConstraints=critical,CA:FALSE\nkeyUsage=critical,digitalSignature\n"
                   f"extendedKeyUsage={use}\n{names}\n")
        openssl("x509", "-req", "-in", request, "-CA", os.path.join(self.keys, "authority.pem"), "-CAkey",
                os.path.join(self.keys, "authority.key"), "-set_serial", f"0x80{os.urandom(15).hex()}", "-days",
                str(days), "-extfile", extensions, "-out", certificate)
        return certificate

    def make_short_server(self, days):
        self.make_short(self.keys, "server", "serverAuth", days, "subjectAltName=DNS:localhost,IP:127.0.0.1")

    def make_short_station(self, days):
        """As an older program left it: the key alone in station.key."""
        self.enrol("room-1")
        path = self.make_short(self.path("keys-room-1"), "station", "clientAuth", days)
        serial = subprocess.run(["openssl", "x509", "-in", path, "-noout", "-serial"], check=True, capture_output=True,
                                text=True).stdout.strip().split("=")[1]
        with open(os.path.join(self.keys, "issued"), "a") as f:
            f.write(f"{serial} {int(time.time())} room-1\n")

    def listed(self):
        return call_json("arthron-server", "session", "--socket", self.socket, "list")

    def table(self):
        return call("arthron-server", "session", "--socket", self.socket, "list").stdout

    def days(self, until_utc_s):
        return (until_utc_s - time.time()) / DAY_S

    def take_the_authority_away(self):
        os.rename(os.path.join(self.keys, "authority.key"), os.path.join(self.keys, "aside"))

    def bring_the_authority_back(self):
        os.rename(os.path.join(self.keys, "aside"), os.path.join(self.keys, "authority.key"))

    def test_the_servers_certificate_is_renewed_by_hand_while_it_runs(self):
        self.make_short_server(20)
        self.take_the_authority_away()
        web = free_port()
        server = self.start_server(extra=f"records = records.db\n[web]\naddress = 127.0.0.1\nport = {web}\n")
        server.wait_for_log("the server's certificate cannot be renewed: ")
        server.wait_for_log("server.pem ends in ")
        self.bring_the_authority_back()
        self.enrol("room-1")
        self.start_mockup()
        station = self.start_station()
        wait_until("the station", lambda: self.session()["steps"] > 50)
        self.assertAlmostEqual(self.days(self.listed()["certificate_until_utc_s"]), 20, delta=0.1)
        self.assertRegex(self.table(), "the server: its certificate ends in (19|20) days: arthron-server keys renew")
        before = shown(self.port), shown(web)
        self.assertEqual(*before)
        told = call("arthron-server", "keys", "renew", self.keys, "127.0.0.1", "localhost", "hall.example").stdout
        self.assertIn("for 127.0.0.1 localhost hall.example", told)
        for port in self.port, web:
            wait_until("the new certificate", lambda: shown(port) != before[0])
        self.assertEqual(shown(self.port), shown(web))
        self.assertGreater(self.days(self.listed()["certificate_until_utc_s"]), 700)
        self.assertNotIn("certificate ends", self.table())
        self.wait_for_steps()
        station.end()
        self.assertEqual(station.log().count("welcomed by"), 1)

    def test_a_running_server_renews_its_certificate_and_no_station_notices(self):
        self.enrol_and_step()
        before = shown(self.port)
        self.make_short(self.path("aside"), "server", "serverAuth", 50, "subjectAltName=DNS:localhost,IP:127.0.0.1")
        for name in ("server.key", "server.pem"):
            os.replace(self.path(os.path.join("aside", name)), os.path.join(self.keys, name))
        wait_until("the renewal", lambda: self.days(self.listed()["certificate_until_utc_s"]) > 700
                   and shown(self.port) != before)
        self.wait_for_steps()
        self.station.end()
        self.assertEqual(self.station.log().count("welcomed by"), 1)

    def enrol_and_step(self):
        os.mkdir(self.path("aside"))
        self.server = self.start_server()
        self.enrol("room-1")
        self.start_mockup()
        self.station = self.start_station()
        self.wait_for_steps()

    def test_a_hall_goes_on_when_its_certificates_have_come_of_age(self):
        """Both clocks go ahead by 700 days: 30 are left of each certificate, and soon two years again."""
        self.enrol_and_step()
        self.station.end()
        self.server.end()
        moved = {"LD_PRELOAD": os.environ["ARTHRON_WRONG_CLOCK"], "WRONG_CLOCK_S": str(700 * DAY_S),
                 "ASAN_OPTIONS": os.environ.get("ASAN_OPTIONS", "") + ":verify_asan_link_order=0"}
        with mock.patch.dict(os.environ, moved):
            server = self.start("server-later", "arthron-server", "run", "--config", self.server_config())
            server.wait_for_log("the server's certificate was renewed")
            station = self.start_station(label="room-1-later")
            station.wait_for_log("the station's certificate was renewed")
        wait_until("both for two years more", lambda: self.days(self.listed()["certificate_until_utc_s"]) > 1400
                   and self.days(self.session()["certificate_until_utc_s"] or 0) > 1400)
        self.wait_for_steps()
        self.assertNotIn("certificate ends", self.table())

    def test_a_station_renews_its_certificate_while_it_runs(self):
        server = self.start_server()
        self.start_mockup()
        self.make_short_station(20)
        old = self.path("keys-old")
        shutil.copytree(self.path("keys-room-1"), old)
        station = self.start_station()
        station.wait_for_log("the station's certificate was renewed")
        wait_until("the new certificate at the server",
                   lambda: self.days(self.session()["certificate_until_utc_s"] or 0) > 700)
        server.wait_for_log("its older ones are revoked")
        self.wait_for_steps()
        self.assertEqual(os.stat(self.path("keys-room-1/station.key")).st_mode & 0o777, 0o600)
        station.end()
        thief = self.start_station(label="thief", keys=old)
        thief.wait_for_log("this certificate is revoked")

    def test_a_renewal_that_fails_is_warned_of_everywhere(self):
        server = self.start_server()
        self.start_mockup()
        self.make_short_station(20)
        self.take_the_authority_away()
        station = self.start_station()
        station.wait_for_log("the station's certificate ends in ")
        server.wait_for_log("station room-1: its certificate ends in ")
        self.assertAlmostEqual(self.days(self.session()["certificate_until_utc_s"]), 20, delta=0.1)
        self.assertRegex(self.table(), "room-1: its certificate ends in (19|20) days: enrol it again")
        station.end()
        found = self.check_station()
        self.assertFalse(found["certificate"]["good"])
        self.assertRegex(found["certificate"]["text"], "(19|20) days")
        self.assertTrue(found["server's certificate"]["good"])
        os.mkdir(self.path("other"))
        self.bring_the_authority_back()
        self.make_short(self.path("other"), "server", "serverAuth", 10, "subjectAltName=DNS:localhost,IP:127.0.0.1")
        self.take_the_authority_away()
        for name in ("server.key", "server.pem"):  # the key is another: a running server takes that too
            os.replace(self.path(os.path.join("other", name)), os.path.join(self.keys, name))
        server.wait_for_log("the server's certificate was renewed")
        found = self.check_station()
        self.assertFalse(found["server's certificate"]["good"])
        self.assertIn("keys renew", found["server's certificate"]["advice"])

    def check_station(self):
        done = call_json("arthron-station", "check", "--config", self.station_config(), "--seconds", "2", code=1)
        return {f["what"]: f for f in done["findings"]}


if __name__ == "__main__":
    unittest.main(verbosity=2)
