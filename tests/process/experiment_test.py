# SPDX-License-Identifier: MIT
"""A session of scripts/experiment with the simulated hand: two trials with each method. Nothing here is timed."""

import argparse
import csv
import os
import subprocess
import sys
import tempfile

parser = argparse.ArgumentParser()
for name in ("--bin", "--config", "--scripts"):
    parser.add_argument(name, required=True)
arguments = parser.parse_args()
sys.dont_write_bytecode = True
sys.path.insert(0, arguments.scripts)

from experiment_session import COUPLINGS, order_of  # noqa: E402  (found through --scripts)


def check(holds, what):
    if not holds:
        sys.exit(f"experiment_test: {what}")


def rows(folder, name):
    with open(os.path.join(folder, name), newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def session(folder, participant):
    command = [sys.executable, "-B", f"{arguments.scripts}/experiment_session.py", "--participant", str(participant),
               "--out", folder, "--trials", "2", "--scored", "2", "--bin", arguments.bin, "--config", arguments.config]
    return subprocess.run(command, capture_output=True, text=True, check=False)


for first in (1, 7, 13):
    orders = {order_of(participant, 1) for participant in range(first, first + 6)}
    check(len(orders) == 6, "six participants have every order once")
check([order_of(n, 1) for n in range(1, 13)] == [order_of(n, 1) for n in range(1, 13)], "an order is drawn from the seed")
check([order_of(n, 1) for n in range(1, 13)] != [order_of(n, 2) for n in range(1, 13)], "another seed, other orders")

with tempfile.TemporaryDirectory() as folder:
    ended = session(folder, 3)
    check(ended.returncode == 0, f"it ended with {ended.returncode}: {ended.stderr}")
    for coupling in COUPLINGS:
        check(coupling not in ended.stdout, f"the screen names {coupling}")
    trials, people = rows(folder, "trials.csv"), rows(folder, "people.csv")
    check([row["method"] for row in trials] == ["A", "A", "B", "B", "C", "C"], "two trials with each method")
    check(tuple(row["coupling"] for row in people) == order_of(3, 1), "the methods come in the participant's order")
    for row in people:
        stops = [trial["stop_m"] for trial in trials if trial["coupling"] == row["coupling"]]
        check(row["got_stops_m"].split() == stops, "people.csv has the stops of trials.csv")
        check(all(abs(float(stop)) > 1e-3 for stop in stops), f"the cube went somewhere: {stops}")
    with open(os.path.join(folder, "index.html"), encoding="utf-8") as file:
        page = file.read()
    check("The 30 cm task with people" in page and "<svg" in page, "there is a page with figures")
    again = session(folder, 3)
    check(again.returncode == 64 and "already" in again.stderr, "a participant is asked once")
print("experiment_test: passed")
