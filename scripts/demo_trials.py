# SPDX-License-Identifier: MIT
"""Runs pushes with both daemons and judges them: the body of scripts/demo (standard library only).

The hand of the simulated SPIDAR pushes the block of push.sdf again and again, at whatever phase the world
happens to be in. After each push the scene is put back (SIGHUP to world_server). Everything shown is read
from the shared segments by haptic_status.
"""

import argparse
import contextlib
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time

COUPLINGS = ("position", "impulse", "local")  # in the order in which they cure the error
INSTANCE = f"demo-{os.getpid()}"  # of one pair after the other: a viewer stays with all of them
NEWTON_SECONDS = 1e-12  # one unit of the impulse totals


def parse_arguments():
    parser = argparse.ArgumentParser(prog="scripts/demo", description="Both daemons, one push after another.")
    parser.add_argument("--coupling", choices=(*COUPLINGS, "compare"), default="compare")
    parser.add_argument("--seconds", type=float, default=60, help="for all couplings together")
    parser.add_argument("--world-rate", type=float, default=20, metavar="HZ")
    parser.add_argument("--view", action="store_true", help="shows it in the browser, too; prints the address")
    parser.add_argument("--bin", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--config", required=True, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.seconds < 4:
        parser.error("--seconds: a coupling needs at least 4 to start and push")
    return arguments


class Pair:
    """Both daemons under one instance name, and a stream of status readings from them."""

    def __init__(self, arguments, coupling, logs, haptic_config=None):
        self.instance = INSTANCE
        self.logs = logs
        self.commands = {
            "world_server": [f"{arguments.bin}/world_server", "--config", f"{arguments.config}/world_server.ini",
                             "--instance", self.instance, "--set", f"coupling.coupling={coupling}",
                             "--set", f"loop.rate_hz={arguments.world_rate:g}"],
            "haptic_server": [f"{arguments.bin}/haptic_server", "--config",
                              haptic_config or f"{arguments.config}/haptic_server.ini", "--instance", self.instance],
            "haptic_status": [f"{arguments.bin}/haptic_status", "--instance", self.instance, "--json",
                              "--interval", "0.05"],
        }
        self.daemons = {}
        self.status = None

    def start(self):
        for name in ("world_server", "haptic_server"):
            self.daemons[name] = self._start(name)
        self._wait_until_up()
        self.status = self._start("haptic_status", stdout=subprocess.PIPE, text=True)

    def _start(self, name, **options):
        # A Ctrl-C is for this script, which then stops its children in order.
        with open(os.path.join(self.logs, name + ".log"), "ab") as file:
            return subprocess.Popen(self.commands[name], stderr=file, start_new_session=True, **options)

    def _wait_until_up(self):
        for _ in range(100):
            for name, process in self.daemons.items():
                if process.poll() is not None:
                    self._give_up(name)
            if all(os.path.exists(f"/dev/shm/rikiseki.{self.instance}.{role}") for role in ("haptic", "world")):
                return
            time.sleep(0.05)
        raise RuntimeError("the daemons did not start")

    def _give_up(self, name):
        with open(os.path.join(self.logs, name + ".log"), encoding="utf-8") as log:
            raise RuntimeError(f"{name} ended with {self.daemons[name].returncode}: {log.read()[-2000:]}")

    def restart_the_dead(self):
        """As systemd would: what a signal ended is started again. Returns the names."""
        restarted = []
        for name, process in self.daemons.items():
            if process.poll() is None:
                continue
            if process.returncode >= 0:
                self._give_up(name)
            time.sleep(0.5)
            self.daemons[name] = self._start(name)
            restarted.append(f"{name} was ended by signal {-process.returncode} and started again")
        return restarted

    def readings(self, until):
        while time.monotonic() < until:
            for news in self.restart_the_dead():
                print(f"{news:110s}", flush=True)
            line = self.status.stdout.readline()
            if not line:
                raise RuntimeError("haptic_status ended")
            reading = json.loads(line)
            if reading["books"] and all("newest" in reading[side] for side in ("haptic", "world")):
                yield reading

    def reset_scene(self):
        self.daemons["world_server"].send_signal(signal.SIGHUP)

    def stop(self):
        processes = [*reversed(self.daemons.values()), *([self.status] if self.status else [])]
        for process in processes:
            if process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.terminate()
        for process in processes:
            try:
                process.wait(timeout=5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        for role in ("haptic", "world"):  # of one that was killed and not started again
            path = f"/dev/shm/rikiseki.{self.instance}.{role}"
            if os.path.exists(path):
                os.remove(path)


def moving_body(reading):
    return next((body for body in reading["world"]["bodies"] if body["mass_kg"] > 0), None)


def pointer(reading):
    return reading["haptic"]["newest"]["pointers"][0]


class Trials:
    """Watches the readings, tells when a push is over and where the block stopped."""

    def __init__(self, coupling):
        self.coupling = coupling
        self.stops = []  # m, displacement along x of each push
        self.start_x = None
        self.generation = None
        self.resetting = False
        self.first = None
        self.last = None

    def watch(self, reading):
        """Returns True when the block should be put back."""
        if self.first is None:
            self.first = reading
        self.last = reading
        body = moving_body(reading)
        if body is None:
            return False
        generation = (reading["world"]["epoch"], body["generation"])
        if generation != self.generation:
            self.generation = generation
            self.start_x = body["position_m"][0]
            self.resetting = False
        if self.resetting:
            return False
        finger = pointer(reading)
        at_home = finger["position_m"][0] < -0.045 and abs(finger["velocity_m_per_s"][0]) < 0.05
        at_rest = max(abs(v) for v in body["velocity_m_per_s"]) < 1e-3
        displacement = body["position_m"][0] - self.start_x
        if at_home and at_rest and displacement > 1e-3:
            self.stops.append(displacement)
            self.resetting = True
            return True
        return False

    def rate(self, side):
        """Ticks per second over the whole run, or since the daemon was started again."""
        first, last = self.first[side], self.last[side]
        if first["epoch"] != last["epoch"]:
            return last["rate"]["measured_hz"] or 0.0
        elapsed = (self.last["time_ns"] - self.first["time_ns"]) * 1e-9
        return (last["tick"] - first["tick"]) / elapsed if elapsed > 0 else 0.0

    def live_line(self, remaining):
        reading = self.last
        body = moving_body(reading)
        force = pointer(reading)["force_n"][0]
        return (f"{self.coupling:8s} {remaining:4.0f} s left  pushes {len(self.stops):3d}  "
                f"force {force:6.2f} N  block {1e3 * (body['position_m'][0] - self.start_x):6.1f} mm  "
                f"{reading['haptic'].get('reason', ''):16s}")


def run(arguments, coupling, seconds, logs, interrupted):
    """Runs one coupling. Returns its Trials; sets interrupted[0] on Ctrl-C."""
    pair = Pair(arguments, coupling, logs)
    trials = Trials(coupling)
    live = sys.stdout.isatty()
    shown = 0.0
    until = time.monotonic() + seconds
    try:
        pair.start()
        for reading in pair.readings(until):
            if trials.watch(reading):
                pair.reset_scene()
            now = time.monotonic()
            if trials.start_x is not None and now - shown > (0.1 if live else 2.0):
                shown = now
                print(trials.live_line(until - now), end="\r" if live else "\n", flush=True)
        # The books are read when nothing is under way: wait for the last acknowledgement.
        for reading in pair.readings(time.monotonic() + 2.0):
            trials.last = reading
            if not any(reading["books"]["pending"]):
                break
    except KeyboardInterrupt:
        interrupted[0] = True
    finally:
        if live:
            print(" " * 110, end="\r")
        pair.stop()
    return trials


@contextlib.contextmanager
def viewer(arguments):
    """world_viewer beside the pairs, if it is wanted; its address printed."""
    if not arguments.view:
        yield
        return
    command = [f"{arguments.bin}/world_viewer", "--instance", INSTANCE, "--port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True)
    try:
        print(f"see it at {process.stdout.readline().strip()}", flush=True)
        yield
    finally:
        process.terminate()
        process.wait()


def newton_seconds(units):
    return sum((value * NEWTON_SECONDS) ** 2 for value in units) ** 0.5


def table(all_trials):
    """Prints what was measured. Returns whether the books balance everywhere."""
    print(f"\n{'coupling':9s} {'pushes':>6s} {'stop mm':>8s} {'SD':>6s} {'spread':>7s}   "
          f"{'displayed':>10s} {'received':>10s} {'discarded':>10s} N s   books")
    balanced = True
    for trials in all_trials:
        stops = [1e3 * stop for stop in trials.stops]
        if trials.last is None or not stops:
            print(f"{trials.coupling:9s} {len(stops):6d}   no push was completed")
            continue
        books, world = trials.last["books"], trials.last["world"]
        exact = books["balanced"] and not any(books["pending"])
        balanced = balanced and exact
        received = [a * NEWTON_SECONDS + p for a, p in zip(books["applied"], world["penalty_impulse_ns"])]
        declared = [d + lost for d, lost in zip(books["discarded"], books["peer_lost"])]
        deviation = statistics.stdev(stops) if len(stops) > 1 else 0.0
        print(f"{trials.coupling:9s} {len(stops):6d} {statistics.mean(stops):8.1f} {deviation:6.1f} "
              f"{max(stops) - min(stops):7.1f}   {newton_seconds(books['displayed']):10.6f} "
              f"{sum(r * r for r in received) ** 0.5:10.6f} {newton_seconds(declared):10.6f}"
              f"       {'displayed = applied + discarded, exactly' if exact else 'DO NOT BALANCE'}")
    print(f"\n{'loop':9s} {'rate Hz':>8s} {'p50 us':>8s} {'p99 us':>8s} {'p99.9 us':>9s} {'missed':>7s}   scheduling")
    for trials in all_trials:
        if trials.last is None:
            continue
        for name in ("haptic", "world"):
            side = trials.last[name]
            late, scheduling = side["lateness_us"], side["scheduling"]
            memory = ", memory locked" if scheduling["memory_locked"] else ""
            print(f"{name:9s} {trials.rate(name):8.1f} {late['p50']:8.0f} {late['p99']:8.0f} "
                  f"{late['p99_9']:9.0f} {side['missed']:7d}   {scheduling['policy']}{memory} ({trials.coupling})")
    print("\nstop: where the block came to rest after one push, from its start, over the pushes; spread: largest -"
          " smallest.\nreceived: momentum that the world gave to the block for the finger. discarded: declared not applied, or lost with a"
          " world that died.\nlateness: of the wake-up,"
          " against the schedule.")
    return balanced


def main():
    arguments = parse_arguments()
    couplings = COUPLINGS if arguments.coupling == "compare" else (arguments.coupling,)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # even where a shell has switched it off
    signal.signal(signal.SIGTERM, lambda *_: (_ for _ in ()).throw(KeyboardInterrupt()))
    all_trials, interrupted = [], [False]
    with tempfile.TemporaryDirectory(prefix="rikiseki-demo-") as logs, viewer(arguments):
        for coupling in couplings:
            try:
                all_trials.append(run(arguments, coupling, arguments.seconds / len(couplings), logs, interrupted))
            except RuntimeError as error:
                print(f"scripts/demo: {error}", file=sys.stderr)
                return 1
            if interrupted[0]:
                break
    balanced = table(all_trials)
    if interrupted[0]:
        print("stopped by hand")
        return 0
    return 0 if balanced and all(trials.stops for trials in all_trials) else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
