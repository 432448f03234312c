# SPDX-License-Identifier: MIT
"""Both daemons as services of a booted systemd, from the installed package: users, scheduling, coupling through shared memory,
crash, hang, reload, stop and restart in both orders. Usage: boot_test.py BUILD_FOLDER
"""

import json
import pathlib
import sys
import time

import lab_pc
from lab_pc import wait_until

HAPTIC, WORLD = "haptic-server.service", "world-server.service"

# The shipped times are for a lab PC; a machine that runs other things besides needs more.
PATIENT = "[Service]\nWatchdogSec=8s\nTimeoutStartSec=60s\nTimeoutStopSec=30s\nTimeoutAbortSec=30s\n"


class Services:
    """The two services on a booted lab PC."""

    def __init__(self, machine):
        self.machine = machine

    def status(self, user="researcher"):
        group = ["--init-groups"] if user == "researcher" else ["--clear-groups"]
        done = self.machine.run("setpriv", f"--reuid={user}", f"--regid={user}", *group,
                                "haptic_status", "--once", "--json")
        return json.loads(done.stdout)

    def pid(self, unit):
        return int(self.machine.show(unit, "MainPID"))

    def active(self, unit):
        return self.machine.show(unit, "ActiveState") == "active" and self.pid(unit) != 0

    def coupled(self):
        """The report, if each side sees the other live and neither books are wrong; else None."""
        report = self.status()
        haptic, world = report["haptic"], report["world"]
        lives = haptic["peer"]["state"] == "live" and world["peer"]["state"] == "live"
        same = haptic["peer"]["epoch"] == world["epoch"] and world["peer"]["epoch"] == haptic["epoch"]
        return report if lives and same and report["books"]["balanced"] else None

    def await_coupling(self, after):
        report = wait_until(f"coupled {after}", self.coupled)
        print(f"coupled {after}")
        return report

    def run_as(self, unit):
        """User and group ids of the service's process."""
        lines = self.machine.run("cat", f"/proc/{self.pid(unit)}/status").stdout.splitlines()
        ids = {line.split(":")[0]: line.split()[1:] for line in lines if line.startswith(("Uid", "Gid"))}
        return set(ids["Uid"]), set(ids["Gid"])

    def dies_and_returns(self, unit, signal, how):
        pid = self.pid(unit)
        restarts = int(self.machine.show(unit, "NRestarts"))
        self.machine.run("kill", f"-{signal}", str(pid))
        wait_until(f"{unit} is restarted after {how}",
                   lambda: int(self.machine.show(unit, "NRestarts")) > restarts and self.active(unit)
                   and self.pid(unit) != pid)
        self.await_coupling(f"after {how} of {unit}")

    def edit(self, file, before, after):
        path = self.machine.path(f"/etc/rikiseki/{file}")
        text = path.read_text()
        assert before in text
        path.write_text(text.replace(before, after))


def allow_fifo(machine, services):
    """SCHED_FIFO and locked memory by the unit's limits, else by the documented drop-in."""
    def scheduling():
        return services.status()["haptic"]["scheduling"]

    def obtained():
        return scheduling()["policy"] == "SCHED_FIFO 80" and scheduling()["memory_locked"]

    if obtained():
        print("SCHED_FIFO 80 and locked memory by the unit's limits")
        return
    assert "not real-time" in machine.journal(HAPTIC)
    real_time = machine.run("systemd-run", "--wait", "--collect", "--quiet", "chrt", "--fifo", "1", "true", check=False)
    if real_time.returncode != 0 or not machine.may("CAP_SYS_NICE") or not machine.may("CAP_IPC_LOCK"):
        print("limits and capabilities are refused here; the service says so, and goes on")
        return
    folder = machine.path(f"/etc/systemd/system/{HAPTIC}.d")
    source = machine.path("/usr/share/rikiseki/systemd/haptic-server-capabilities.conf")
    (folder / "capabilities.conf").write_text(source.read_text())
    machine.run("systemctl", "daemon-reload")
    machine.run("systemctl", "restart", HAPTIC)
    services.await_coupling("with the drop-in for capabilities")
    wait_until("SCHED_FIFO 80 and locked memory with the drop-in", obtained)
    print("the limits are refused here; SCHED_FIFO 80 and locked memory by the drop-in")


def reload_settings(machine, services):
    def stiffness():
        return services.status()["haptic"]["newest"]["stiffness_n_per_m"]

    haptic, world = services.pid(HAPTIC), services.pid(WORLD)
    services.edit("haptic_server.ini", "stiffness_n_per_m = 2000", "stiffness_n_per_m = 1500")
    machine.run("systemctl", "reload", HAPTIC)
    wait_until("the new stiffness is rendered", lambda: stiffness() == 1500)
    services.edit("haptic_server.ini", "stiffness_n_per_m = 1500", "stiffness_n_per_m = plenty")
    refused = machine.run("systemctl", "reload", HAPTIC, check=False)
    assert refused.returncode != 0, "a wrong file is accepted"
    wait_until("the refusal names file and key",
               lambda: "/etc/rikiseki/haptic_server.ini:" in machine.journal(HAPTIC)
               and "render.stiffness_n_per_m = plenty" in machine.journal(HAPTIC))
    services.edit("haptic_server.ini", "stiffness_n_per_m = plenty", "stiffness_n_per_m = 2000")
    assert stiffness() == 1500
    machine.run("systemctl", "reload", WORLD)
    services.edit("world_server.ini", "scenes/push.sdf", "scenes/nowhere.sdf")
    assert machine.run("systemctl", "reload", WORLD, check=False).returncode != 0
    services.edit("world_server.ini", "scenes/nowhere.sdf", "scenes/push.sdf")
    services.await_coupling("after reloads")
    assert (services.pid(HAPTIC), services.pid(WORLD)) == (haptic, world), "a reload has restarted something"
    print("reload: good files are taken, wrong ones refused by name")


def restart_in_both_orders(machine, services):
    for first, second in ((HAPTIC, WORLD), (WORLD, HAPTIC)):
        machine.run("systemctl", "stop", first)
        assert machine.show(first, "Result") == "success"
        time.sleep(1)
        assert services.active(second), f"{second} does not outlive {first}"
        machine.run("systemctl", "restart", second)
        machine.run("systemctl", "start", first)
        services.await_coupling(f"{second} before {first}")
    machine.run("systemctl", "stop", "haptics.target")
    for unit in (HAPTIC, WORLD):
        wait_until(f"{unit} is stopped with its target", lambda: machine.show(unit, "ActiveState") == "inactive")
        assert machine.show(unit, "Result") == "success"
    assert "rikiseki" not in machine.run("ls", "/dev/shm").stdout, "segments are left behind"
    machine.run("systemctl", "start", "haptics.target")
    services.await_coupling("after a stop of the target")


def without_a_device(machine, services):
    """A board that is not there is a state with a reason."""
    services.edit("haptic_server.ini", "\nkind = simulated", "\nkind = usb")
    services.edit("haptic_server.ini", "file = devices/simulated.ini", "file = devices/spidar4_simple.ini")
    machine.run("systemctl", "restart", HAPTIC)
    report = wait_until("the service is up without a device",
                        lambda: services.active(HAPTIC) and services.status()["haptic"]["reason"] == "device_fault"
                        and services.status())
    print(f"no device: {report['haptic']['sentence']} ({report['haptic']['device']})")
    services.edit("haptic_server.ini", "\nkind = usb", "\nkind = simulated")
    services.edit("haptic_server.ini", "file = devices/spidar4_simple.ini", "file = devices/simulated.ini")
    machine.run("systemctl", "restart", HAPTIC)
    services.await_coupling("with a device again")


def exposure(machine):
    """systemd's own judgement of the units, tenths of points."""
    drop_in = machine.path("/usr/share/rikiseki/systemd/haptic-server-capabilities.conf").read_text()
    folder = machine.path("/var/cache/exposure")
    folder.mkdir()
    # Under other names, so that the drop-ins of this machine do not count.
    for name, unit, more, limit in (("haptic.service", HAPTIC, "", 15), ("haptic-drop-in.service", HAPTIC, drop_in, 15),
                                    ("world.service", WORLD, "", 6)):
        (folder / name).write_text(machine.path(f"/usr/lib/systemd/system/{unit}").read_text() + more)
        done = machine.run("systemd-analyze", "security", "--offline=true", f"--threshold={limit}", "--no-pager",
                           f"/var/cache/exposure/{name}", check=False)
        assert done.returncode == 0, done.stdout
        print(done.stdout.strip().splitlines()[-1].encode("ascii", "ignore").decode())


def main():
    lab_pc.enter_own_mounts()
    build = pathlib.Path(sys.argv[1])
    with lab_pc.LabPc() as machine:
        package = lab_pc.build_package(build, machine.place)
        machine.install(package)
        machine.before_boot("useradd", "-M", "-U", "-G", "haptics", "researcher")
        for unit in (HAPTIC, WORLD):
            enabled = machine.before_boot("systemctl", "is-enabled", unit, check=False)
            assert enabled.stdout.strip() == "disabled", "the package enables something by itself"
            folder = machine.path(f"/etc/systemd/system/{unit}.d")
            folder.mkdir(parents=True)
            (folder / "patient.conf").write_text(PATIENT)
        machine.boot()
        services = Services(machine)
        machine.run("systemctl", "enable", "--now", "haptics.target")

        report = services.await_coupling("after the start")
        users = [services.run_as(unit) for unit in (HAPTIC, WORLD)]
        assert users[0][0] != users[1][0] and users[0][1] == users[1][1]
        assert all("0" not in ids for pair in users for ids in pair), "something runs as root"
        allow_fifo(machine, services)
        stranger = machine.run("setpriv", "--reuid=nobody", "--regid=nogroup", "--clear-groups",
                               "haptic_status", "--once", check=False)
        assert stranger.returncode != 0, "who is not in the group reads the segments"
        assert report["books"]["balanced"]

        for unit in (HAPTIC, WORLD):
            services.dies_and_returns(unit, "KILL", "SIGKILL")
        for unit in (HAPTIC, WORLD):
            services.dies_and_returns(unit, "STOP", "a hang")
            assert "atchdog" in machine.journal(unit)
        reload_settings(machine, services)
        restart_in_both_orders(machine, services)
        if machine.path("/etc/rikiseki/devices/spidar4_simple.ini").exists():
            without_a_device(machine, services)
        exposure(machine)
        failed = machine.run("systemctl", "--failed", "--no-legend", "--plain", "--no-pager").stdout
        assert not failed.strip(), failed
        machine.power_off()
    print("everything holds")


if __name__ == "__main__":
    main()
