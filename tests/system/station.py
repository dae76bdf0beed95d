"""What a station says to its technician: of the server, of its config, of its devices."""

import fcntl
import json
import os
import signal
import socket
import subprocess
import threading
import time
import unittest

from arthron import SystemTest, call, free_port, program, wait_until

DAY_S = 86400


class Station(SystemTest):
    def setUp(self):
        super().setUp()
        self.start_mockup()

    def changed(self, *changes):
        with open(self.station_config()) as f:
            text = f.read()
        for old, new in changes:
            self.assertIn(old, text)
            text = text.replace(old, new, 1)
        return self.write("changed.ini", text)

    def test_a_hold_beyond_the_servers_is_warned_of(self):
        self.start_server()
        self.enrol("room-1")
        config = self.changed(("[device tracker]\n", "[device tracker]\nhold_ms = 900\n"))
        station = self.start("station", "arthron-station", "run", "--config", config)
        station.wait_for_log("[device tracker] hold_ms = 900: the server calls a value lost after 100 ms")
        self.assertNotIn("[device encoders] hold_ms", station.log())


    def test_a_live_line_that_nobody_reads_holds_up_no_pose(self):
        self.start_server()
        self.enrol("room-1")
        reader, writer = os.pipe()
        fcntl.fcntl(writer, fcntl.F_SETPIPE_SZ, 4096)
        os.write(writer, b"." * 4096)  # no room for a single line
        station = subprocess.Popen([program("arthron-station"), "run", "--config", self.station_config(), "--live"],
                                   stdout=writer, stderr=subprocess.DEVNULL)
        os.close(writer)
        try:
            wait_until("a session", lambda: self.session()["connected"])
            self.wait_for_steps(600)  # of 200 a second: lines were due
        finally:
            station.terminate()
            ended = station.wait(timeout=60)
            os.close(reader)
        self.assertEqual(ended, 0)

    # ---- check

    def findings(self, config, clock_off_s=0):
        environment = dict(os.environ, LD_PRELOAD=os.environ["ARTHRON_WRONG_CLOCK"], WRONG_CLOCK_S=str(clock_off_s),
                           ASAN_OPTIONS=os.environ.get("ASAN_OPTIONS", "") + ":verify_asan_link_order=0")
        done = subprocess.run([program("arthron-station"), "check", "--config", config, "--seconds", "3", "--json"],
                              env=environment, capture_output=True, text=True, timeout=60)
        self.assertIn(done.returncode, (0, 1), done.stderr)
        return {f["what"]: f for f in json.loads(done.stdout)["findings"]}

    def expect(self, finding, words, advice):
        self.assertFalse(finding["good"], finding)
        self.assertIn(words, finding["text"])
        self.assertIn(advice, finding["advice"])

    def test_check_tells_a_revoked_certificate(self):
        self.start_server()
        self.enrol("room-1")
        call("arthron-server", "keys", "revoke", self.keys, "room-1")
        self.expect(self.findings(self.station_config())["server"], "revoked", "enrol the station again")

    def test_check_tells_a_clock_that_is_behind(self):
        self.start_server()
        self.enrol("room-1")
        found = self.findings(self.station_config(), -366 * DAY_S)
        self.expect(found["certificate"], "begins at", "set this machine's clock")
        self.expect(found["server"], "the server's certificate begins at", "set this machine's clock")

    def test_check_tells_a_clock_that_is_ahead(self):
        self.start_server()
        self.enrol("room-1")
        found = self.findings(self.station_config(), 30 * 366 * DAY_S)
        self.expect(found["certificate"], "ended at", "set this machine's clock")
        self.expect(found["server"], "the server's certificate ended at", "set this machine's clock")

    def test_check_compares_the_time_of_day_with_the_servers(self):
        self.start_server()
        self.enrol("room-1")
        self.expect(self.findings(self.station_config(), 10 * DAY_S)["time of day"], "10.0 days behind", "set the clock")
        self.assertTrue(self.findings(self.station_config())["time of day"]["good"])

    def test_check_calls_a_station_without_calibration_not_ready(self):
        self.start_server()
        self.enrol("room-1")
        self.expect(self.findings(self.station_config())["calibration"], "names no calibration file", "calibration = FILE")

    # ---- the link

    def refusing(self, answer):
        """A port that answers a connection with these bytes and closes it."""
        listener = socket.create_server(("127.0.0.1", 0))
        self.addCleanup(listener.close)

        def serve():
            while True:
                try:
                    connection, _ = listener.accept()
                except OSError:
                    return
                with connection:
                    connection.recv(4096)
                    connection.sendall(answer)
        threading.Thread(target=serve, daemon=True).start()
        return listener.getsockname()[1]

    def log_of_a_link_to(self, host, port):
        config = self.changed((f"server = 127.0.0.1:{self.port}", f"server = {host}:{port}"))
        return call("arthron-station", "run", "--config", config, "--seconds", "2").stderr

    def test_a_link_that_fails_is_told_in_whole_sentences(self):
        self.start_server()
        self.enrol("room-1")
        nobody = free_port()
        for host, port, words in (("127.0.0.1", nobody, f"no connection to 127.0.0.1, port {nobody}: no server answers"),
                                  ("nowhere.invalid", 4810, "the host name has no address"),
                                  ("127.0.0.1", self.refusing(b"HTTP/1.1 400 Bad Request\r\n\r\n"),
                                   "does not speak TLS")):
            log = self.log_of_a_link_to(host, port)
            self.assertIn(words, log)
            for raw in ("conn fail", "Closed before conn", "SSL err", "Unable to connect"):
                self.assertNotIn(raw, log)

    def test_a_link_that_was_lost_is_told_in_whole_sentences(self):
        server = self.start_server()
        self.enrol("room-1")
        station = self.start("station", "arthron-station", "run", "--config", self.station_config())
        self.wait_for_steps()
        server.end(signal.SIGKILL)
        station.wait_for_log("the connection was lost. The station connects again when the server answers")
        station.wait_for_log("no server answers")
        self.assertNotIn("Closed before conn", station.log())

    # ---- prompts

    def test_log_lines_stand_apart_from_a_question(self):
        config = self.changed(("[station]\n", "[station]\ncalibration = calibration.ini\n"),
                              ("address = " + self.tracker, f"address = 127.0.0.1:{free_port()}"))
        points = self.write("points.ini", "[landmarks]\na = 0 0 0\nb = 9 0 0\nc = 0 9 0\n")
        with subprocess.Popen([program("arthron-station"), "calibrate", "landmarks", "--device", "tracker", "--channel",
                               "probe", "--points", points, "--config", config], stdin=subprocess.PIPE,
                              stderr=subprocess.PIPE, text=True) as process:
            time.sleep(1)
            process.stdin.close()
            log = process.stderr.read()
        question = "Hold the tip of the probe still on a, then press Enter: "
        self.assertIn("warning device: tracker", log)
        for line in log.splitlines():
            if "press Enter" in line:
                self.assertTrue(line.startswith(question.rstrip()), line)
                self.assertNotIn("device", line)


if __name__ == "__main__":
    unittest.main(verbosity=2)
