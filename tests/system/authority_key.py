#!/usr/bin/env python3
"""The authority's key, encrypted and in a folder of its own: OpenSSL's own program reads it, the server enrols with it,
and without its passphrase it says so."""

import os
import subprocess
import unittest

from arthron import SystemTest, call, program, text_of

CLEAR, SEALED = "BEGIN PRIVATE KEY", "BEGIN ENCRYPTED PRIVATE KEY"


def openssl(*arguments):
    return subprocess.run(["openssl", *arguments], capture_output=True, text=True)


class AuthorityKey(SystemTest):
    def setUp(self):
        super().setUp()
        self.key = os.path.join(self.keys, "authority.key")
        self.right = self.write("right", "correct horse battery staple\n")
        self.wrong = self.write("wrong", "correct horse battery stapler\n")

    def keys_command(self, word, *options, code=0):
        return call("arthron-server", "keys", word, self.keys, *options, code=code).stderr

    def opens(self, passphrase):
        return openssl("pkey", "-in", self.key, "-passin", f"file:{passphrase}", "-noout").returncode == 0

    def run_to_its_end(self, extra="", **environment):
        return subprocess.run([program("arthron-server"), "run", "--config", self.server_config("", extra)],
                              capture_output=True, text=True, timeout=60, env={**os.environ, **environment})

    def test_it_is_encrypted_changed_and_decrypted(self):
        self.assertIn(CLEAR, text_of(self.key))
        self.keys_command("encrypt", "--new-passphrase", self.right)
        self.assertIn(SEALED, text_of(self.key))
        self.assertIn("scrypt", openssl("asn1parse", "-in", self.key).stdout)
        self.assertTrue(self.opens(self.right))
        self.assertFalse(self.opens(self.wrong))
        sealed = text_of(self.key)
        said = self.keys_command("encrypt", "--passphrase", self.wrong, "--new-passphrase", self.wrong, code=1)
        self.assertIn(f"the passphrase in {self.wrong} does not open it", said)
        self.assertIn("no file with its passphrase is named", self.keys_command("renew", code=1))
        short = self.write("short", "horse\n")
        self.assertIn("at least 8", self.keys_command("encrypt", "--passphrase", self.right, "--new-passphrase", short,
                                                      code=1))
        self.assertEqual(text_of(self.key), sealed)
        self.keys_command("renew", "--passphrase", self.right)
        other = self.write("other", "another passphrase")
        self.keys_command("encrypt", "--passphrase", self.right, "--new-passphrase", other)
        self.assertTrue(self.opens(other))
        self.assertFalse(self.opens(self.right))
        self.keys_command("decrypt", "--passphrase", other)
        self.assertIn(CLEAR, text_of(self.key))
        self.assertEqual(os.stat(self.key).st_mode & 0o777, 0o600)

    def test_a_server_enrols_with_it_from_a_folder_of_its_own(self):
        apart = self.path("authority")
        os.mkdir(apart, 0o700)
        self.keys_command("encrypt", "--new-passphrase", self.right)
        os.rename(self.key, os.path.join(apart, "authority.key"))
        server = self.start_server("", "authority = authority\nauthority_passphrase = right")
        self.assertNotIn("authority.key", server.log())
        self.enrol("room-1")
        code = call("arthron-server", "keys", "enrol", self.keys, "room-2").stdout.strip()
        place, keys = f"127.0.0.1:{self.port}", self.path("keys-room-2")
        for unfit in (self.path("nowhere/keys"), self.right):  # its code stays good
            said = call("arthron-station", "enrol", place, code, "--name", "room-2", "--keys", unfit, code=1).stderr
            self.assertIn(unfit, said)
        call("arthron-station", "enrol", place, code, "--name", "room-2", "--keys", keys)
        os.rename(self.right, self.right + "-away")  # who has no good code does not get the key opened
        said = call("arthron-station", "enrol", place, code, "--name", "room-2", "--keys", keys, code=3).stderr
        self.assertIn("this code is unknown, used or expired", said)
        os.rename(self.right + "-away", self.right)
        server.end()
        self.assertIn("none renews its certificate", self.start_server().log())

    def test_without_its_passphrase_the_server_says_so_and_ends(self):
        self.keys_command("encrypt", "--new-passphrase", self.right)
        done = self.run_to_its_end()
        self.assertEqual(done.returncode, 1)
        self.assertIn("authority.key: it is encrypted, and no file with its passphrase is named", done.stderr)
        done = self.run_to_its_end("authority_passphrase = wrong")
        self.assertEqual(done.returncode, 1)
        self.assertIn("does not open it", done.stderr)
        done = self.run_to_its_end("authority_passphrase = nowhere")
        self.assertEqual(done.returncode, 1)
        self.assertIn("No such file", done.stderr)

    def test_systemd_may_hand_over_the_passphrase_and_a_key_in_the_clear_is_warned_of(self):
        self.assertIn("authority.key is not encrypted", self.start_server().log())
        self.processes.pop().end()
        credentials = self.path("credentials")
        os.mkdir(credentials)
        os.rename(self.right, os.path.join(credentials, "authority-passphrase"))
        self.keys_command("encrypt", "--new-passphrase", os.path.join(credentials, "authority-passphrase"))
        os.environ["CREDENTIALS_DIRECTORY"] = credentials
        self.addCleanup(os.environ.pop, "CREDENTIALS_DIRECTORY")
        server = self.start_server()
        self.assertNotIn("authority.key", server.log())
        self.enrol("room-1")


if __name__ == "__main__":
    unittest.main()
