"""A Docker engine: the one that runs, or one of our own that leaves nothing behind but its cache."""

import glob
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time

SOURCE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
BASE = "debian:bookworm-slim"
AUTHORITIES = "/usr/local/share/ca-certificates"


class NoEngine(Exception):
    """Why there can be no engine here."""


class Failed(Exception):
    """A command that must not fail did."""


def say(text):
    print(f"docker: {text}", file=sys.stderr, flush=True)


def run(*command, check=True, timeout=120, **options):
    """Runs a command and returns it with its output as text."""
    done = subprocess.run(command, capture_output=True, text=True, timeout=timeout, **options)
    if check and done.returncode:
        raise Failed(f"{' '.join(command)}: exit {done.returncode}\n{done.stdout[-2000:]}{done.stderr[-4000:]}")
    return done


def docker(*arguments, **options):
    return run("docker", *arguments, **options)


def answers():
    return shutil.which("docker") and docker("info", check=False).returncode == 0


def install():
    if os.geteuid() != 0:
        raise NoEngine("no Docker engine answers, and starting one needs root")
    if run(f"{SOURCE}/docker/packages/install", "docker", check=False, timeout=600).returncode:
        raise NoEngine("no Docker engine answers, and the packages of docker/packages/docker.txt cannot be installed")


def rival():
    """The id of a dockerd in our network namespace: a second one would take over its bridge."""
    for comm in glob.glob("/proc/[0-9]*/comm"):
        process = os.path.dirname(comm)
        try:
            with open(comm) as f:
                is_dockerd = f.read().strip() == "dockerd"
            if is_dockerd and os.readlink(f"{process}/ns/net") == os.readlink("/proc/self/ns/net"):
                return os.path.basename(process)
        except OSError:
            continue
    return None


class Network:
    """What dockerd changes in this network namespace, to be put back."""

    FORWARDING = "/proc/sys/net/ipv4/ip_forward"

    def __init__(self):
        with open(self.FORWARDING) as f:
            self.forwarding = f.read()
        self.had_bridge = os.path.exists("/sys/class/net/docker0")
        self.forwards = ":FORWARD DROP" not in run("iptables-save").stdout

    def restore(self):
        if self.had_bridge:
            return
        run("ip", "link", "delete", "docker0", check=False)
        rules = [rule for rule in run("iptables-save").stdout.splitlines() if "docker" not in rule.lower()]
        run("iptables-restore", input="\n".join(rules) + "\n")
        if self.forwards:
            run("iptables", "-P", "FORWARD", "ACCEPT")
        with open(self.FORWARDING, "w") as f:
            f.write(self.forwarding)


class Engine:
    """`own` tells whether we started it. Its images stay in `cache` for the next run."""

    def __init__(self, cache):
        if not answers():
            install()
        self.own = not answers()
        if self.own:
            self.start(cache)
        self.version = docker("version", "--format", "{{.Server.Version}}").stdout.strip()

    def start(self, cache):
        if rival():
            raise NoEngine(f"a dockerd that does not answer runs in this network namespace, process {rival()}")
        self.network = Network()
        self.folder = tempfile.mkdtemp(prefix="arthron-docker-")
        address = f"unix://{self.folder}/socket"
        self.log = os.path.join(self.folder, "log")
        os.makedirs(cache, exist_ok=True)
        with open(self.log, "wb") as log:
            self.process = subprocess.Popen(
                ["dockerd", "--data-root", cache, "--exec-root", f"{self.folder}/exec", "--pidfile",
                 f"{self.folder}/pid", "--host", address],
                stdout=log, stderr=log, stdin=subprocess.DEVNULL, start_new_session=True)
        os.environ["DOCKER_HOST"] = address
        self.wait()

    def wait(self):
        for _ in range(300):
            if self.process.poll() is not None:
                break
            if answers():
                self.clear()
                return
            time.sleep(0.1)
        with open(self.log, errors="replace") as f:
            last = f.read().strip().splitlines()[-1:]
        self.stop()
        raise NoEngine(f"dockerd does not start: {' '.join(last)}")

    def clear(self):
        """What a run that was killed has left."""
        left = docker("ps", "--all", "--quiet").stdout.split()
        if left:
            docker("rm", "--force", "--volumes", *left)
        for kind in ("network", "volume"):
            docker(kind, "prune", "--force")

    def stop(self):
        if not self.own:
            return
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
        try:
            self.process.wait(timeout=30)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.network.restore()
        shutil.rmtree(self.folder, ignore_errors=True)


# ---- images

def has_image(name):
    return docker("image", "inspect", name, check=False).returncode == 0


def image_megabytes(name):
    return round(json.loads(docker("image", "inspect", name).stdout)[0]["Size"] / 1e6, 1)


def make_base(folder):
    """Debian's slim image from its packages, with this machine's sources, proxies and the authorities
    that its administrator trusts besides Debian's: npm, too, may have to go through such a proxy."""
    sources = [path for path in ("/etc/apt/sources.list", "/etc/apt/sources.list.d/debian.sources")
               if os.path.exists(path) and "bookworm" in open(path).read()]
    proxies = [line for line in run("apt-config", "dump").stdout.splitlines()
               if line.startswith(("Acquire::http::Proxy", "Acquire::https::Proxy"))]
    options = [f"--aptopt={line}" for line in proxies]
    options += [f"--dpkgopt=path-exclude=/usr/share/{name}/*" for name in ("doc", "locale", "man")]
    if os.path.isdir(AUTHORITIES):
        options += ["--include=ca-certificates", f"--customize-hook=copy-in {AUTHORITIES} {os.path.dirname(AUTHORITIES)}",
                    '--customize-hook=chroot "$1" update-ca-certificates']
    archive = os.path.join(folder, "base.tar")
    run("mmdebstrap", "--variant=apt", "--include=usr-is-merged",
        "--hook-dir=/usr/share/mmdebstrap/hooks/merged-usr", "--dpkgopt=force-unsafe-io", *options, "bookworm",
        archive, *sources, timeout=900)
    docker("import", "--change", 'CMD ["bash"]', "--change",
           "ENV NODE_EXTRA_CA_CERTS=/etc/ssl/certs/ca-certificates.crt", archive, BASE)
    os.remove(archive)


def provide_base():
    """Where the base image came from."""
    if has_image(BASE):
        return "there"
    if docker("pull", BASE, check=False, timeout=300).returncode == 0:
        return "pulled"
    if os.geteuid() != 0 or not shutil.which("mmdebstrap"):
        raise NoEngine(f"{BASE} cannot be pulled, and making it needs root and mmdebstrap")
    with tempfile.TemporaryDirectory(prefix="arthron-docker-") as folder:
        make_base(folder)
    return "made"
