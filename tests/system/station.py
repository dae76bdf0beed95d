"""What a station says to its technician: of the server, of its config, of its devices."""

import unittest

from arthron import House


class Station(House):
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
        station.wait_for_log("[device tracker] hold_ms = 900 has no effect beyond 100")
        self.assertIn("the server's [warp] hold_ms = 100", station.log())
        self.assertNotIn("[device encoders] hold_ms", station.log())


if __name__ == "__main__":
    unittest.main(verbosity=2)
