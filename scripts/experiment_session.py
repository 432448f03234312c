# SPDX-License-Identifier: MIT
"""One participant of the 30 cm task: the body of scripts/experiment (standard library only).

Push the cube once, so that it stops at the mark; with each of the three couplings in turn. The order is balanced over
every six participants and drawn from the seed; the screen calls the couplings A, B and C. Each trial goes to trials.csv
when it is over, and each method to people.csv, in the format of `haptic_lab fig9`, when its trials are done. Participants
are numbers: nothing here knows a name.
"""

import argparse
import csv
import itertools
import os
import random
import signal
import statistics
import subprocess
import sys
import tempfile
import time

from demo_trials import COUPLINGS, Pair, moving_body, pointer

MARK_M = 0.30  # from where the cube's centre starts, along x
PEOPLE = ("hand", "mass_kg", "coupling", "Tw_s", "trials", "scored", "subject", "got_stop_mean_m", "got_stop_sd_m",
          "got_stops_m", "got_status", "got_texts", "got_machine")
TRIALS = ("participant", "method", "coupling", "trial", "stop_m", "contacts", "peak_force_n", "seconds")


def parse_arguments():
    parser = argparse.ArgumentParser(prog="scripts/experiment", description="One participant of the 30 cm task.")
    parser.add_argument("--participant", type=int, required=True, metavar="N", help="1, 2, 3 ...: never a name")
    parser.add_argument("--device-config", metavar="F.ini", help="of haptic_server; without it, a simulated hand")
    parser.add_argument("--out", default="build/experiment", metavar="DIR")
    parser.add_argument("--trials", type=int, default=30, metavar="N", help="with each method")
    parser.add_argument("--scored", type=int, default=20, metavar="N", help="of them, the last")
    parser.add_argument("--world-rate", type=float, default=20, metavar="HZ")
    parser.add_argument("--seed", type=int, default=1, help="of the orders; the same for all participants")
    parser.add_argument("--bin", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--config", required=True, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.participant < 1:
        parser.error("--participant: a number from 1 is expected")
    if not 2 <= arguments.scored <= arguments.trials:
        parser.error("--scored: from 2 to the number of trials is expected")
    return arguments


def order_of(participant, seed):
    """The couplings in this participant's order: every six in a row have every order once."""
    group, place = divmod(participant - 1, 6)
    orders = list(itertools.permutations(COUPLINGS))
    random.Random(f"{seed} {group}").shuffle(orders)
    return orders[place]


class Trial:
    """Watches readings until the cube rests somewhere else and the finger is back behind the start line."""

    def __init__(self, body, now):
        self.start_x = body["position_m"][0]
        self.generation = body["generation"]
        self.started = now
        self.contacts = 0
        self.touching = False
        self.peak_force_n = 0.0

    def watch(self, reading):
        """Returns where the cube stopped [m from its start], or None while the trial goes on."""
        body, finger = moving_body(reading), pointer(reading)
        force = sum(f * f for f in finger["force_n"]) ** 0.5
        self.peak_force_n = max(self.peak_force_n, force)
        touching = force > 0.05
        self.contacts += touching and not self.touching
        self.touching = touching
        way = body["position_m"][0] - self.start_x
        home = finger["position_m"][0] < -0.045 and abs(finger["velocity_m_per_s"][0]) < 0.05
        rest = max(abs(v) for v in body["velocity_m_per_s"]) < 1e-3
        return way if home and rest and abs(way) > 1e-3 else None


def strip(stop_m, finger_m=None):
    """The task on one line of 61 characters: 1 cm each, from 5 cm before the cube's start to 55 cm behind it."""
    places = {35: "|"}
    if finger_m is not None:
        places[round(100 * finger_m) + 5] = ">"
    places[max(0, min(60, round(100 * stop_m) + 5))] = "#"
    return "".join(places.get(i, "-") for i in range(61))


def say_result(number, count, stop_m):
    beyond = stop_m - MARK_M
    side = "beyond" if beyond > 0 else "short of"
    where = "on the mark" if abs(beyond) < 0.01 else f"{100 * abs(beyond):.0f} cm {side} the mark"
    print(f"  {number:2d}/{count}  {strip(stop_m)}  {where:30s}", flush=True)


def run_method(arguments, label, coupling, logs, record):
    """Runs the trials of one method. Returns the stops [m] and the cube's mass [kg]."""
    print(f"\nMethod {label}. Wait with the finger behind the start line, push the cube once, come back.\n"
          f"It should stop at the mark, 30 cm on. Below: > your finger, # the cube, | the mark. {arguments.trials} trials.",
          flush=True)
    pair = Pair(arguments, coupling, logs, arguments.device_config)
    stops, trial, mass_kg, generation_over = [], None, 0.0, None
    live = sys.stdout.isatty()
    try:
        pair.start()
        for reading in pair.readings(float("inf")):
            body = moving_body(reading)
            if body is None:
                continue
            mass_kg = body["mass_kg"]
            if trial is None or body["generation"] != trial.generation:
                if body["generation"] == generation_over:
                    continue  # the cube is not back yet
                trial = Trial(body, time.monotonic())
            stop = trial.watch(reading)
            if stop is None:
                if live:
                    way = body["position_m"][0] - trial.start_x
                    finger = pointer(reading)["position_m"][0] - trial.start_x
                    print(f"  {len(stops) + 1:2d}/{arguments.trials}  {strip(way, finger)}", end="\r", flush=True)
                continue
            stops.append(stop)
            record([arguments.participant, label, coupling, len(stops), repr(stop), trial.contacts,
                    f"{trial.peak_force_n:.3f}", f"{time.monotonic() - trial.started:.2f}"])
            say_result(len(stops), arguments.trials, stop)
            if len(stops) == arguments.trials:
                return stops, mass_kg
            generation_over, trial = body["generation"], None
            pair.reset_scene()
    finally:
        pair.stop()
    return stops, mass_kg


def append(path, columns, row):
    new = not os.path.exists(path)
    with open(path, "a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        if new:
            writer.writerow(columns)
        writer.writerow(row)


def main():
    arguments = parse_arguments()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.makedirs(arguments.out, exist_ok=True)
    people = os.path.join(arguments.out, "people.csv")
    if os.path.exists(people):
        with open(people, newline="", encoding="utf-8") as file:
            if any(row["subject"] == str(arguments.participant) for row in csv.DictReader(file)):
                print(f"scripts/experiment: {people} has participant {arguments.participant} already; choose another number",
                      file=sys.stderr)
                return 64
    who = "person" if arguments.device_config else "simulated"
    device = arguments.device_config or "simulated hand"
    trials = os.path.join(arguments.out, "trials.csv")
    with tempfile.TemporaryDirectory(prefix="rikiseki-experiment-") as logs:
        for label, coupling in zip("ABC", order_of(arguments.participant, arguments.seed)):
            stops, mass_kg = run_method(arguments, label, coupling, logs, lambda row: append(trials, TRIALS, row))
            scored = stops[-arguments.scored:]
            append(people, PEOPLE, [who, f"{mass_kg:g}", coupling, f"{1 / arguments.world_rate:g}", arguments.trials,
                                    arguments.scored, arguments.participant, repr(statistics.mean(scored)),
                                    repr(statistics.stdev(scored)), " ".join(repr(stop) for stop in stops), "ok", 1,
                                    device])
    return subprocess.run([f"{arguments.bin}/haptic_lab", "people", "--out", arguments.out], check=False).returncode


if __name__ == "__main__":
    try:
        sys.exit(main())
    except RuntimeError as error:
        print(f"scripts/experiment: {error}", file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        print("\nstopped by hand: the trials so far are in trials.csv, the method under way counts as not done")
        sys.exit(130)
