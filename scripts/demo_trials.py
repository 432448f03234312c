"""Runs pushes with both daemons and judges them: the body of scripts/demo (standard library only).

The hand of the simulated SPIDAR pushes the block of push.sdf again and again, at whatever phase the world
happens to be in. After each push the scene is put back (SIGHUP to world_server). Everything shown is read
from the shared segments by haptic_status.
"""

import argparse
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time

EXISTING = ("position", "impulse")  # the couplings that are built, in the order of the paper
NEWTON_SECONDS = 1e-12  # one unit of the impulse totals


def parse_arguments():
    parser = argparse.ArgumentParser(prog="scripts/demo", description="Both daemons, one push after another.")
    parser.add_argument("--coupling", choices=("position", "impulse", "local", "compare"), default="compare")
    parser.add_argument("--seconds", type=float, default=60, help="for all couplings together")
    parser.add_argument("--world-rate", type=float, default=20, metavar="HZ")
    parser.add_argument("--bin", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--config", required=True, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.seconds < 4:
        parser.error("--seconds: a coupling needs at least 4 to start and push")
    return arguments


class Pair:
    """Both daemons under one instance name, and a stream of status readings from them."""

    def __init__(self, arguments, coupling, logs):
        self.instance = f"demo-{os.getpid()}-{coupling}"
        self.logs = logs
        world = [f"{arguments.bin}/world_server", "--config", f"{arguments.config}/world_server.ini",
                 "--instance", self.instance, "--set", f"coupling.coupling={coupling}",
                 "--set", f"loop.rate_hz={arguments.world_rate:g}"]
        haptic = [f"{arguments.bin}/haptic_server", "--config", f"{arguments.config}/haptic_server.ini",
                  "--instance", self.instance]
        status = [f"{arguments.bin}/haptic_status", "--instance", self.instance, "--json",
                  "--interval", "0.05"]
        self.world = self._start(world, "world_server.log")
        self.haptic = self._start(haptic, "haptic_server.log")
        self._wait_until_up()
        self.status = subprocess.Popen(status, stdout=subprocess.PIPE, text=True)

    def _start(self, command, log):
        # A Ctrl-C is for this script, which then stops its children in order.
        with open(os.path.join(self.logs, log), "ab") as file:
            return subprocess.Popen(command, stderr=file, start_new_session=True)

    def _wait_until_up(self):
        for _ in range(100):
            self.check_alive()
            if all(os.path.exists(f"/dev/shm/rikiseki.{self.instance}.{role}") for role in ("haptic", "world")):
                return
            time.sleep(0.05)
        raise RuntimeError("the daemons did not start")

    def check_alive(self):
        for name, process in (("haptic_server", self.haptic), ("world_server", self.world)):
            if process.poll() is not None:
                with open(os.path.join(self.logs, name + ".log"), encoding="utf-8") as log:
                    raise RuntimeError(f"{name} ended with {process.returncode}: {log.read()[-2000:]}")

    def readings(self, until):
        while time.monotonic() < until:
            line = self.status.stdout.readline()
            if not line:
                self.check_alive()
                raise RuntimeError("haptic_status ended")
            reading = json.loads(line)
            if "haptic" in reading and "world" in reading and reading["haptic"] and reading["world"]:
                yield reading

    def reset_scene(self):
        self.world.send_signal(signal.SIGHUP)

    def stop(self):
        for process in (getattr(self, "status", None), self.haptic, self.world):
            if process is not None and process.poll() is None:
                process.terminate()
        for process in (getattr(self, "status", None), self.haptic, self.world):
            if process is not None:
                try:
                    process.wait(timeout=5)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()


def moving_body(reading):
    return next((body for body in reading["world"]["bodies"] if body["mass_kg"] > 0), None)


class Trials:
    """Watches the readings, tells when a push is over and where the block stopped."""

    def __init__(self, coupling):
        self.coupling = coupling
        self.stops = []  # m, displacement along x of each push
        self.start_x = None
        self.generation = None
        self.last = None

    def watch(self, reading):
        """Returns True when the block should be put back."""
        self.last = reading
        body = moving_body(reading)
        if body is None:
            return False
        if body["generation"] != self.generation:
            self.generation = body["generation"]
            self.start_x = body["position_m"][0]
            return False
        finger = reading["haptic"]["pointer"]
        at_home = finger["position_m"][0] < -0.045 and abs(finger["velocity_m_per_s"][0]) < 0.05
        at_rest = max(abs(v) for v in body["velocity_m_per_s"]) < 1e-3
        displacement = body["position_m"][0] - self.start_x
        if at_home and at_rest and displacement > 1e-3:
            self.stops.append(displacement)
            return True
        return False

    def live_line(self, remaining):
        reading = self.last
        body = moving_body(reading)
        force = reading["haptic"]["pointer"]["force_n"][0]
        return (f"{self.coupling:8s} {remaining:4.0f} s left  pushes {len(self.stops):3d}  "
                f"force {force:6.2f} N  block {1e3 * (body['position_m'][0] - self.start_x):6.1f} mm  "
                f"{reading['haptic']['reason_text'][:40]:40s}")


def run(arguments, coupling, seconds, logs, interrupted):
    """Runs one coupling. Returns its Trials; sets interrupted[0] on Ctrl-C."""
    pair = Pair(arguments, coupling, logs)
    trials = Trials(coupling)
    live = sys.stdout.isatty()
    shown = 0.0
    until = time.monotonic() + seconds
    try:
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
            if not any(reading["haptic"]["books"]["pending"]):
                break
    except KeyboardInterrupt:
        interrupted[0] = True
    finally:
        if live:
            print(" " * 110, end="\r")
        pair.stop()
    return trials


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
        haptic, world = trials.last["haptic"], trials.last["world"]
        books = haptic["books"]
        exact = books["balanced"] and not any(books["pending"])
        balanced = balanced and exact
        received = [a * NEWTON_SECONDS + p for a, p in zip(world["applied"], world["penalty_impulse_ns"])]
        deviation = statistics.stdev(stops) if len(stops) > 1 else 0.0
        print(f"{trials.coupling:9s} {len(stops):6d} {statistics.mean(stops):8.1f} {deviation:6.1f} "
              f"{max(stops) - min(stops):7.1f}   {newton_seconds(books['displayed']):10.6f} "
              f"{sum(r * r for r in received) ** 0.5:10.6f} {newton_seconds(books['discarded']):10.6f}"
              f"       {'displayed = applied + discarded, exactly' if exact else 'DO NOT BALANCE'}")
    print(f"\n{'loop':9s} {'rate Hz':>8s} {'p50 us':>8s} {'p99 us':>8s} {'p99.9 us':>9s} {'missed':>7s}   scheduling")
    for trials in all_trials:
        if trials.last is None:
            continue
        for name in ("haptic", "world"):
            loop = trials.last[name]["loop"]
            late = loop["lateness_us"]
            print(f"{name:9s} {loop['rate_hz']:8.1f} {late['p50']:8.0f} {late['p99']:8.0f} {late['p99_9']:9.0f} "
                  f"{loop['missed']:7d}   {loop['scheduling']} ({trials.coupling})")
    print("\nstop: where the block came to rest after one push, from its start, over the pushes; spread: largest -"
          " smallest.\nreceived: momentum that the world gave to the block for the finger. lateness: of the wake-up,"
          " against the schedule.")
    return balanced


def main():
    arguments = parse_arguments()
    if arguments.coupling == "local":
        print("scripts/demo: coupling local is not built yet; there are: " + ", ".join(EXISTING), file=sys.stderr)
        return 64
    couplings = EXISTING if arguments.coupling == "compare" else (arguments.coupling,)
    signal.signal(signal.SIGTERM, lambda *_: (_ for _ in ()).throw(KeyboardInterrupt()))
    all_trials, interrupted = [], [False]
    with tempfile.TemporaryDirectory(prefix="rikiseki-demo-") as logs:
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
