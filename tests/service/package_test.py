# SPDX-License-Identifier: MIT
"""The Debian package by dpkg itself, on a file system that is thrown away: installs, enables nothing, keeps edited settings
over an upgrade, goes without a trace; and programs of others build against what it installs. Usage: package_test.py BUILD_FOLDER
"""

import pathlib
import shutil
import sys

import lab_pc

SETTINGS = "/etc/rikiseki/haptic_server.ini"
USER_PROGRAM = """
#include <protocol/attach.h>
#include <protocol/rikiseki.h>
int main() { return rikiseki::protocol::Attach({.instance = "nobody"}).view == nullptr ? 0 : 1; }
"""
USER_BUILD = """
cmake_minimum_required(VERSION 3.25)
project(user CXX)
find_package(Rikiseki 0.1 REQUIRED)
add_executable(user user.cpp)
target_link_libraries(user PRIVATE Rikiseki::protocol)
"""


def enabled_units(machine):
    links = machine.path("/etc/systemd/system").rglob("*")
    return [link.name for link in links if link.is_symlink() and "hap" in link.name]


def lint(machine, package):
    """lintian's errors and warnings are none, where lintian is."""
    if not shutil.which("lintian"):
        print("lintian is not installed: not asked")
        return
    said = machine.before_boot("lintian", "--allow-root", "--fail-on", "error,warning",
                               "--suppress-tags-from-file", "/var/cache/not-debian", f"/var/cache/{package.name}", check=False)
    assert said.returncode == 0, said.stdout + said.stderr
    print("lintian: no error, no warning")


def others_build(machine):
    folder = machine.path("/var/cache/user")
    folder.mkdir()
    (folder / "user.cpp").write_text(USER_PROGRAM)
    (folder / "CMakeLists.txt").write_text(USER_BUILD)
    machine.before_boot("cmake", "-S", "/var/cache/user", "-B", "/var/cache/user/build")
    machine.before_boot("cmake", "--build", "/var/cache/user/build")
    machine.before_boot("/var/cache/user/build/user")
    machine.before_boot("sh", "-c", "cd /var/cache/user && g++ -std=c++20 user.cpp "
                        "$(pkg-config --cflags --libs rikiseki) -o by-pkg-config && ./by-pkg-config")
    print("find_package(Rikiseki) and pkg-config: a user's program builds and runs")


def main():
    lab_pc.enter_own_mounts()
    build = pathlib.Path(sys.argv[1])
    with lab_pc.LabPc() as machine:
        first = lab_pc.build_package(build, machine.place)
        machine.install(first)
        assert not enabled_units(machine), "the package enables something by itself"
        for user in ("haptics-device", "haptics-world"):
            account = machine.before_boot("getent", "passwd", user).stdout
            assert "nologin" in account, account
            assert machine.before_boot("id", "-gn", user).stdout.strip() == "haptics"
        for program in ("haptic_server", "world_server", "haptic_status", "protocol_check"):
            assert machine.before_boot(program, "--version").stdout.startswith(f"{program} 0.")
            assert list(machine.path("/usr/share/man").glob(f"man?/{program}.?.gz"))
        for server in ("haptic_server", "world_server"):
            machine.before_boot(server, "--config", f"/etc/rikiseki/{server}.ini", "--check")
        (machine.path("/var/cache") / "not-debian").write_text(
            pathlib.Path(__file__).with_name("lintian-not-debian").read_text())
        lint(machine, first)
        others_build(machine)

        path = machine.path(SETTINGS)
        edited = path.read_text().replace("force_cap_n = 10", "force_cap_n = 4")
        path.write_text(edited)
        second = lab_pc.build_package(build, machine.place, "0.1.0.1")
        machine.install(second)
        assert path.read_text() == edited, "an upgrade overwrote edited settings"
        assert machine.before_boot("dpkg-query", "-W", "-f=${Version}", "rikiseki").stdout == "0.1.0.1"
        print("upgrade: edited settings are kept")

        machine.before_boot("dpkg", "-r", "rikiseki")
        assert path.read_text() == edited and not machine.path("/usr/bin/haptic_server").exists()
        machine.before_boot("dpkg", "-P", "rikiseki")
        left = [str(found) for place in ("/etc", "/usr/bin", "/usr/lib/systemd", "/usr/share/rikiseki", "/usr/include")
                for found in machine.path(place).rglob("*rikiseki*")]
        assert not left, left
        print("purge: nothing is left")


if __name__ == "__main__":
    main()
