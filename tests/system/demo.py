"""./demo and ./check before they build: what they look at first, and what they say. Nothing is built or installed."""

import fcntl
import os
import shutil
import subprocess
import tempfile
import time
import unittest

SOURCE = os.environ["ARTHRON_SOURCE"]
RECORDING = ("t_seconds,tx_mm,ty_mm,tz_mm,qw,qx,qy,qz,valid\n"
             "0.0,100,0,0,1,0,0,0,1\n1.0,10,0,0,1,0,0,0,1\n2.0,12,0,0,1,0,0,0,1\n3.0,90,0,0,1,0,0,0,0\n")


def write(path, text, mode=0o644):
    with open(path, "w") as f:
        f.write(text)
    os.chmod(path, mode)
    return path


def read(path):
    with open(path) as f:
        return f.read()


class Tree(unittest.TestCase):
    """A copy of the demo and what it uses; the installer and CMake only say that they were called."""

    def setUp(self):
        self.base = tempfile.mkdtemp(prefix="arthron-demo-")
        self.addCleanup(shutil.rmtree, self.base)
        os.chmod(self.base, 0o755)
        self.tree = os.path.join(self.base, "arthron")
        os.makedirs(os.path.join(self.tree, "docker/packages"))
        for name in ("demo", "check"):
            shutil.copy(os.path.join(SOURCE, name), self.tree)
        shutil.copytree(os.path.join(SOURCE, "cases"), os.path.join(self.tree, "cases"))
        for name in ("docker/packages/fresh-build-folder", "station/mockup/place-recording",
                     "station/mockup/play-week"):
            os.makedirs(os.path.dirname(os.path.join(self.tree, name)), exist_ok=True)
            shutil.copy(os.path.join(SOURCE, name), os.path.join(self.tree, name))
        self.path = os.path.join(self.base, "bin")
        os.mkdir(self.path)
        write(os.path.join(self.tree, "docker/packages/install"), "#!/bin/sh\necho packages >>calls\n", 0o755)
        self.fake_cmake("exit 1")

    def fake_cmake(self, body):
        write(os.path.join(self.path, "cmake"), f"#!/bin/sh\necho cmake >>calls\n{body}\n", 0o755)

    def command(self, program, *arguments):
        return {"args": [f"./{program}", *arguments], "cwd": self.tree, "text": True, "stdin": subprocess.DEVNULL,
                "env": {**os.environ, "PATH": f"{self.path}:{os.environ['PATH']}"}}

    def run_script(self, program, *arguments):
        return subprocess.run(**self.command(program, *arguments), capture_output=True, timeout=60)

    def calls(self):
        path = os.path.join(self.tree, "calls")
        return read(path).split() if os.path.exists(path) else []

    @unittest.skipUnless(os.geteuid() == 0, "only root's demo runs as another user")
    def test_in_a_folder_of_root_the_programs_run_elsewhere(self):
        os.mkdir(os.path.join(self.tree, "run"))  # of a tree that was moved
        write(os.path.join(self.tree, "run/kept"), "")
        os.chmod(self.base, 0o700)
        told = self.run_script("demo").stderr
        run = os.path.join(self.tree, "run")
        self.addCleanup(shutil.rmtree, os.path.realpath(run))
        self.assertIn(f"cannot enter {self.tree}: run/ is in {os.path.realpath(run)}", told)
        self.assertTrue(os.path.exists(os.path.join(run, "kept")))
        as_nobody = ["setpriv", "--reuid=nobody", "--regid=nogroup", "--clear-groups", "test", "-x"]
        self.assertEqual(subprocess.run([*as_nobody, os.path.realpath(run)]).returncode, 0)
        self.assertEqual(subprocess.run([*as_nobody, self.tree]).returncode, 1)
        self.assertNotIn("run/ is in", self.run_script("demo").stderr)  # it stays there

    def test_a_second_demo_says_that_one_runs_and_which(self):
        self.fake_cmake("touch building; while [ -e building ]; do sleep 0.05; done; exit 1")
        building = os.path.join(self.tree, "building")
        first = subprocess.Popen(**self.command("demo"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            end = time.monotonic() + 60
            while not os.path.exists(building) and time.monotonic() < end:
                time.sleep(0.02)
            second = self.run_script("demo")
        finally:
            os.remove(building)
            first.wait(60)
        self.assertEqual(second.returncode, 2)
        self.assertIn("already running in this folder", second.stderr)
        self.assertIn(f"process {first.pid}", second.stderr)
        self.assertEqual(self.calls().count("cmake"), 1)
        self.fake_cmake("exit 1")
        self.assertIn("the build failed", self.run_script("demo").stderr)  # the first one's end frees the folder

    def test_a_demo_that_ends_while_it_generates_cases_leaves_no_process(self):
        self.fake_cmake("mkdir -p build/release/bin\n"
                        "printf '#!/bin/sh\\n: >generating\\nexec sleep 60\\n' >build/release/bin/arthron-case\n"
                        "chmod 755 build/release/bin/arthron-case")
        generating = os.path.join(self.tree, "run/generating")
        demo = subprocess.Popen(**self.command("demo"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.wait_until(lambda: os.path.exists(generating))
        demo.terminate()
        self.assertEqual(demo.wait(timeout=60), 130)
        with open(os.path.join(self.tree, "run/lock")) as lock:
            self.wait_until(lambda: self.can_lock(lock))

    def wait_until(self, holds):
        end = time.monotonic() + 30
        while not holds():
            self.assertLess(time.monotonic(), end)
            time.sleep(0.02)

    def can_lock(self, file):
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        except BlockingIOError:
            return False

    def test_a_build_folder_of_another_place_is_begun_anew(self):
        for program, preset in (("demo", "release"), ("check", "release"), ("check --asan", "asan")):
            cache = os.path.join(self.tree, "build", preset, "CMakeCache.txt")
            os.makedirs(os.path.dirname(cache), exist_ok=True)
            write(cache, "CMAKE_HOME_DIRECTORY:INTERNAL=/elsewhere\nCMAKE_CACHEFILE_DIR:INTERNAL=/elsewhere/build\n")
            done = self.run_script(*program.split())
            self.assertIn("was configured in /elsewhere", done.stderr, program)
            self.assertFalse(os.path.exists(cache), program)

    def test_cmake_configures_again_after_the_tree_was_moved(self):
        write(os.path.join(self.tree, "CMakeLists.txt"), "cmake_minimum_required(VERSION 3.20)\nproject(x NONE)\n")
        os.remove(os.path.join(self.path, "cmake"))
        moved = os.path.join(self.base, "moved")

        def configure(tree):
            subprocess.run(["docker/packages/fresh-build-folder", "build/release"], cwd=tree, check=True, capture_output=True)
            return subprocess.run(["cmake", "-G", "Ninja", "-S", ".", "-B", "build/release"], cwd=tree, capture_output=True).returncode

        self.assertEqual(configure(self.tree), 0)
        kept = write(os.path.join(self.tree, "build/release/kept"), "")
        self.assertEqual(configure(self.tree), 0)
        self.assertTrue(os.path.exists(kept))
        os.rename(self.tree, moved)
        self.assertEqual(configure(moved), 0)
        shutil.copytree(moved, self.tree)
        self.assertEqual(configure(self.tree), 0)

    def test_a_course_takes_no_other_option(self):
        done = self.run_script("demo", "--course", "--seconds", "5")
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("--course takes no other option", done.stderr)
        self.assertEqual(self.calls(), [])

    def test_a_table_that_is_no_recording_is_answered_with_a_sentence(self):
        rows = (("a,b\n1,2\n", "lacks the columns t_seconds, tx_mm"), ("", "lacks the columns"),
                (RECORDING.replace("12,0,0", "twelve,0,0"), "line 4: tx_mm is no number: twelve"),
                (RECORDING.splitlines()[0] + "\n", "no row"), ("\x00\x01", "recording"))
        for text, said in rows:
            path = write(os.path.join(self.base, "recording.csv"), text)
            done = self.run_script("demo", "--recorded", path)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn(said, done.stderr)
            self.assertNotIn("Traceback", done.stderr)
        self.assertNotIn("cmake", self.calls())

    def test_a_recording_is_placed_where_its_tool_dwells(self):
        path = write(os.path.join(self.base, "recording.csv"), RECORDING)
        out = os.path.join(self.base, "played.csv")
        done = subprocess.run([os.path.join(SOURCE, "station/mockup/place-recording"), "place", path, out, "1", "2", "3"],
                              capture_output=True, text=True, check=True)
        self.assertEqual([float(v) for v in done.stdout.split()], [1 - 11, 2, 3, 1, 0, 0, 0])
        self.assertEqual([line.split(",")[:2] for line in read(out).splitlines()],
                         [["t_seconds", "tx_mm"], ["0.500000", "10"], ["1.500000", "12"], ["2.500000", "90"]])


if __name__ == "__main__":
    unittest.main(verbosity=2)
