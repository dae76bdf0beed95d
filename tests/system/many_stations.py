#!/usr/bin/env python3
"""A server of 200 stations, of which a few come: the list has all, in the order of the config, and their sessions run."""

import unittest

from arthron import Process, SystemTest, call, program, wait_until

COUNT = 200
COME = [f"room-{n}" for n in (1, 64, 65, 128, 200)]  # beside the edges of a list's parts


class ManyStations(SystemTest):
    def test_few_of_many_stations_come_and_each_has_its_session(self):
        names = [f"room-{n}" for n in range(1, COUNT + 1)]
        self.start_mockup()
        server = self.start_server("".join(f"[station {name}]\ncase = arthrosis\n" for name in names))
        for name in COME:
            self.enrol(name)
            self.start_station(name)
        for name in COME:
            self.wait_for_steps(name=name)
        listed = self.sessions()
        self.assertEqual([s["station"] for s in listed], names)
        self.assertEqual([s["station"] for s in listed if s["connected"]], COME)
        self.assertEqual(len({s["id"] for s in listed if s["connected"]}), len(COME))
        for s in listed:
            self.assertEqual(s["steps"] > 0, s["station"] in COME)
        self.session_command("stop", COME[-1])
        trace = self.session(COME[-1])["trace"]
        wait_until("its trace is signed", lambda: call("arthron-trace", "verify", trace, code=None).returncode == 0)
        self.assertNotIn("may be refused", server.log())

    def test_a_limit_that_is_too_low_is_told_at_the_start(self):
        sections = "".join(f"[station room-{n}]\ncase = healthy\n" for n in range(1, COUNT + 1))
        server = Process(self.folder, "server", "prlimit", "--nofile=600:600", program("arthron-server"), "run",
                         "--config", self.server_config(sections))
        self.processes.append(server)
        server.wait_for_log("ready")
        self.assertIn("the system gives 600 descriptors, and 200 stations may need 912", server.log())


if __name__ == "__main__":
    unittest.main()
