"""A running server notices the check of a case."""

import json
import os
import shutil
import unittest

from arthron import SystemTest, call, wait_until


class Grades(SystemTest):
    def setUp(self):
        super().setUp()
        shutil.copytree(self.cases, self.path("cases"))
        self.cases = self.path("cases")

    def refused(self, case):
        return "unfit" in call("arthron-server", "session", "--socket", self.socket, "case", "room-1", case,
                               code=None).stderr

    def test_a_case_that_is_checked_while_the_server_runs_is_graded_at_once(self):
        server = self.start_server()
        self.assertEqual(self.session()["case_grade"], "not checked")
        folder = os.path.join(self.cases, "arthrosis")
        call("arthron-case", "check", folder, "--quick")
        with open(os.path.join(folder, "check.json")) as f:
            check = json.load(f)
        self.assertEqual(self.session()["case_grade"], check["grade"])
        server.wait_for_log(f"case arthrosis is {check['grade']} by a quick check")

        self.write_check(folder, {**check, "grade": "unfit",
                                  "findings": [{"level": "fault", "where": "tibia", "text": "folds"}]})
        self.assertTrue(self.refused("arthrosis"))
        self.assertEqual(self.session()["case_grade"], "unfit")
        server.wait_for_log("case arthrosis is unfit, so no session opens on it: tibia: folds")

        os.remove(os.path.join(folder, "check.json"))
        wait_until("the log", lambda: server.log().count("case arthrosis is not checked") == 2)
        self.assertFalse(self.refused("arthrosis"))
        self.assertEqual(self.session()["case_grade"], "not checked")

    def write_check(self, folder, check):
        path = os.path.join(folder, "check.json")
        with open(path + ".new", "w") as f:
            json.dump(check, f)
        os.replace(path + ".new", path)


if __name__ == "__main__":
    unittest.main(verbosity=2)
