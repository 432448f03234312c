# SPDX-License-Identifier: MIT
"""A lab PC that is thrown away: the machine's own Debian under a writable layer in memory, the package installed in it by dpkg,
and a real systemd booted over it (systemd-nspawn).

Nothing reaches the machine itself. Where it lacks the rights or the programs for that, the test is skipped, and says why.
"""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

SKIPPED = 77  # the SKIP_RETURN_CODE of tests/service/CMakeLists.txt
PATIENCE_S = 90  # how long anything may take on a machine that is slow and loaded


def skip(why):
    print(f"SKIPPED: {why}")
    sys.exit(SKIPPED)


def enter_own_mounts():
    """Starts this program again where what it mounts is seen by nobody and goes with it."""
    if os.geteuid() != 0:
        skip("mounting and booting need root")
    for program in ("unshare", "systemd-nspawn", "nsenter", "dpkg", "cpack"):
        if shutil.which(program) is None:
            skip(f"{program} is not installed")
    if os.environ.get("RIKISEKI_OWN_MOUNTS") == "1":
        return
    probe = subprocess.run(["unshare", "--mount", "true"], capture_output=True, text=True)
    if probe.returncode != 0:
        skip(f"this machine gives no mount namespace: {probe.stderr.strip()}")
    os.environ["RIKISEKI_OWN_MOUNTS"] = "1"
    os.execvp("unshare", ["unshare", "--mount", "--propagation", "private", sys.executable] + sys.argv)


def build_package(build, folder, version=None):
    """The .deb of a build tree."""
    command = ["cpack", "--config", f"{build}/CPackConfig.cmake", "-B", str(folder)]
    if version:
        command += ["-R", version]
    made = subprocess.run(command, capture_output=True, text=True, cwd=build)
    assert made.returncode == 0, made.stdout + made.stderr
    (package,) = folder.glob(f"rikiseki_{version or '*'}_*.deb")
    return package


def wait_until(what, holds, seconds=PATIENCE_S):
    """Polls until holds() gives something true, and returns it. What it raises counts as not yet."""
    end = time.monotonic() + seconds
    last = None
    while time.monotonic() < end:
        try:
            last = holds()
            if last:
                return last
        except Exception as error:  # pylint: disable=broad-except
            last = error
        time.sleep(0.1)
    raise AssertionError(f"never within {seconds} s: {what}; last: {last!r}")


class LabPc:
    """The machine, not booted yet. Use as a context."""

    def __init__(self):
        self.place = pathlib.Path(tempfile.mkdtemp(prefix="rikiseki-service-"))
        self.root = self.place / "root"
        self.nspawn = None
        self.leader = None
        self.console = None

    def __enter__(self):
        try:
            self._mount()
        except subprocess.CalledProcessError as error:
            self._remove()
            skip(f"this machine mounts no overlay: {error.stderr.strip()}")
        return self

    def __exit__(self, kind, error, trace):
        if kind is not None and self.console is not None:
            print(self.console.read_text(errors="replace")[-8000:])
        if self.nspawn is not None:
            self.nspawn.kill()
            self.nspawn.wait()
        self._remove()

    def _mount(self):
        def mount(*words):
            subprocess.run(["mount", *words], check=True, capture_output=True, text=True)

        mount("-t", "tmpfs", "rikiseki-test", str(self.place))
        for name in ("upper", "work", "root"):
            (self.place / name).mkdir()
        layers = f"lowerdir=/,upperdir={self.place}/upper,workdir={self.place}/work"
        mount("-t", "overlay", "rikiseki-test", "-o", layers, str(self.root))
        mount("-t", "proc", "proc", str(self.root / "proc"))
        mount("--rbind", "/dev", str(self.root / "dev"))
        # What this machine's administrator enabled is not under test.
        for entry in (self.root / "etc/systemd/system").iterdir():
            if entry.is_dir() and not entry.is_symlink():
                shutil.rmtree(entry)
            else:
                entry.unlink()

    def _remove(self):
        subprocess.run(["umount", "-R", "-l", str(self.place)], capture_output=True, check=False)
        shutil.rmtree(self.place, ignore_errors=True)

    def path(self, absolute):
        """Where the host finds a file of the lab PC."""
        return self.root / str(absolute).lstrip("/")

    def before_boot(self, *command, check=True):
        """Runs a command in the file system of the machine that is not booted."""
        done = subprocess.run(["chroot", str(self.root), *command], capture_output=True, text=True,
                              stdin=subprocess.DEVNULL,
                              env={"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "DEBIAN_FRONTEND": "noninteractive"})
        assert not check or done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
        return done

    def install(self, package, *options, check=True):
        shutil.copy(package, self.root / "var/cache")
        return self.before_boot("dpkg", *options, "-i", f"/var/cache/{package.name}", check=check)

    def boot(self, capabilities=("CAP_SYS_NICE", "CAP_IPC_LOCK")):
        subprocess.run(["umount", "-R", "-l", str(self.root / "dev")], check=True)
        subprocess.run(["umount", "-l", str(self.root / "proc")], check=True)
        self.console = self.place / "console"
        with self.console.open("w") as console:
            self.nspawn = subprocess.Popen(
                ["systemd-nspawn", "-q", "-D", str(self.root), f"--machine={self.place.name}", "--register=no",
                 "--keep-unit", "--boot", "--console=pipe", "--private-network", "--resolv-conf=off", "--timezone=off",
                 f"--capability={','.join(capabilities)}", "systemd.unit=multi-user.target",
                 "systemd.mask=systemd-firstboot.service"],
                stdin=subprocess.DEVNULL, stdout=console, stderr=console, start_new_session=True)
        try:
            self.leader = wait_until("systemd starts", self._find_leader, 120)
            wait_until("systemd is up", lambda: self.state() in ("running", "degraded"))
        except AssertionError:
            skip(f"this machine boots no systemd: {self.console.read_text(errors='replace')[-2000:]}")

    def _find_leader(self):
        assert self.nspawn.poll() is None
        children = pathlib.Path(f"/proc/{self.nspawn.pid}/task/{self.nspawn.pid}/children").read_text().split()
        for child in children:
            if pathlib.Path(f"/proc/{child}/comm").read_text().strip() == "systemd":
                return child
        return None

    def run(self, *command, check=True):
        """Runs a command on the booted machine."""
        done = subprocess.run(["nsenter", "-t", self.leader, "-m", "-u", "-i", "-n", "-p", "-C", *command],
                              capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=PATIENCE_S)
        assert not check or done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
        return done

    def may(self, capability):
        """Whether anybody on the booted machine can have this capability."""
        number = {"CAP_IPC_LOCK": 14, "CAP_SYS_NICE": 23}[capability]
        lines = pathlib.Path(f"/proc/{self.leader}/status").read_text().splitlines()
        (bounding,) = [line.split()[1] for line in lines if line.startswith("CapBnd")]
        return int(bounding, 16) >> number & 1 == 1

    def state(self):
        return self.run("systemctl", "is-system-running", check=False).stdout.strip()

    def show(self, unit, what):
        return self.run("systemctl", "show", "-P", what, unit).stdout.strip()

    def journal(self, unit):
        return self.run("journalctl", "-u", unit, "-o", "cat", "--no-pager").stdout

    def power_off(self):
        self.run("systemctl", "poweroff", check=False)
        wait_until("the machine is off", lambda: self.nspawn.poll() is not None)
