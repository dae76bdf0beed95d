"""A station and its enrolment, with one call failing, beside a server where none fails."""

import os

from programs import Scenario, call

ATTEMPTS = 3


class OfHall(Scenario):
    program = "arthron-station"

    def __init__(self, shared, hall):
        super().__init__(shared)
        self.hall = hall


class StationEnrol(OfHall):
    name = "station enrol"
    runs = 0

    def prepare(self, folder):
        self.runs += 1
        if self.runs % ATTEMPTS == 0:  # more in a minute are refused
            self.hall.server.end()
            self.hall.server = self.hall.start_server()

    def command(self, folder):
        code = call("arthron-server", "keys", "enrol", self.hall.keys, "room-3").stdout.strip()
        return ["enrol", f"127.0.0.1:{self.hall.port}", code, "--name", "room-3", "--keys", folder + "/keys"]

    def check(self, folder, outcome):
        files = sorted(os.listdir(folder + "/keys")) if os.path.isdir(folder + "/keys") else []
        if outcome.status == 0 and "station.pem" not in files:
            return f"no certificate though it ended with 0: {files}"
        return ""


class StationRun(OfHall):
    """Trains for half a second."""
    name = "station run"

    def command(self, folder):
        return ["run", "--config", self.hall.station_config("room-2"), "--seconds", "0.5", "--json"]


SCENARIOS = (StationEnrol, StationRun)
