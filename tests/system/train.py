"""docker/train, which starts a station in its container: what it does with codes that are of no use."""

import os
import shutil
import subprocess
import unittest

from arthron import SOURCE, SystemTest, Process, call, program, wait_until


class Train(SystemTest):
    def setUp(self):
        super().setUp()
        self.start_mockup()
        for folder in ("state", "enrolment", "config"):
            os.mkdir(self.path(folder))
        shutil.copy(self.station_config(), self.path("config/station.ini"))
        with open(os.path.join(SOURCE, "docker", "train")) as f:
            script = f.read()
        for inside, outside in (("/var/lib/arthron", "state"), ("/enrolment", "enrolment"), ("/etc/arthron", "config")):
            self.assertIn(inside, script)
            script = script.replace(inside, self.path(outside))
        self.script = self.write("train", script)

    def train(self, **environment):
        environment = {"ARTHRON_STATION": "room-1", "ARTHRON_SERVER": f"127.0.0.1:{self.port}", **environment,
                       "PATH": os.path.dirname(program("arthron-station")) + ":" + os.environ["PATH"]}
        process = Process(self.folder, "train", "env", *(f"{k}={v}" for k, v in environment.items()), "bash",
                          self.script, statuses=(0, 143))
        self.processes.append(process)
        return process

    def code(self):
        return call("arthron-server", "keys", "enrol", self.keys, "room-1").stdout.strip()

    def put_code(self, code):
        self.write("code.new", code + "\n")
        os.rename(self.path("code.new"), self.path("enrolment/code"))

    def used_code(self):
        code = self.code()
        call("arthron-station", "enrol", f"127.0.0.1:{self.port}", code, "--name", "room-1", "--keys",
             self.path("elsewhere"))
        return code

    def trains(self):
        wait_until("the station's certificate", lambda: os.path.exists(self.path("state/keys/station.pem")))
        self.wait_for_steps()

    def test_a_code_that_is_refused_is_said_once_and_a_new_one_waited_for(self):
        self.start_server()
        train = self.train(ARTHRON_CODE=self.used_code())
        train.wait_for_log("room-1 needs a new code and waits for it in")
        with self.assertRaises(subprocess.TimeoutExpired):
            train.process.wait(3)
        self.assertEqual(train.log().count("needs a new code"), 1)
        self.assertEqual(train.log().count(" error station"), 1)
        self.put_code(self.code())
        self.trains()
        self.assertEqual(os.path.getsize(self.path("enrolment/code")), 0)

    def test_an_old_code_in_the_file_is_tried_once(self):
        self.start_server()
        self.put_code(self.used_code())
        train = self.train()
        train.wait_for_log("needs a new code")
        self.put_code(self.code())
        self.trains()

    def test_a_server_that_is_not_there_yet_is_waited_for(self):
        self.start_server().end()
        train = self.train(ARTHRON_CODE=self.code())
        train.wait_for_log("error station")
        with self.assertRaises(subprocess.TimeoutExpired):
            train.process.wait(3)
        self.assertEqual(train.log().count("error station"), 1)
        self.start_server()
        self.trains()

    def test_it_ends_at_once_when_it_is_told_to(self):
        train = self.train()
        with self.assertRaises(subprocess.TimeoutExpired):
            train.process.wait(0.5)
        train.process.terminate()
        self.assertEqual(train.process.wait(5), 143)


if __name__ == "__main__":
    unittest.main(verbosity=2)
