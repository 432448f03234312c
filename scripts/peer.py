#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""A second implementation of both sides of the Rikiseki protocol, from protocol/SPEC.md alone (its section
numbers stand in the comments). Python 3 standard library only.

  peer.py world   a small world: a fixed box, or with --mass a block that slides on a rail along x
  peer.py haptic  a small haptic side: a simulated finger on a spring that presses into the box
  peer.py codec   decodes and encodes the messages of a file; for the tests

What it is good for: holding the other side in contact, judging it, and showing how little a peer needs. What
it is not: real-time. 500 ticks a second is what CPython holds on an ordinary PC, so that is the default of
the haptic side, and what its directory says.

Memory order, honestly: SPEC.md asks for aligned 64-bit loads and stores with acquire and release ordering.
Python has no such thing. CPython reads and writes an item of a memoryview of format Q with a memcpy of
constant size 8, which compilers for x86-64 make one mov, and x86-64 keeps loads in order among loads and
stores among stores, which is what acquire and release come to there. Every word that changes while others may
look goes that way, one by one; slices, which memmove copies in any order, are not used for them. On other
machines and other Pythons none of this holds, so they are refused.
"""

import argparse
import fcntl
import gc
import math
import mmap
import os
import platform
import pwd
import re
import signal
import stat
import struct
import sys
import threading
import time

VERSION = (1, 0)
LAYOUT_HASH = 0xACAE8D32F68C7538  # 8.3
MAGIC = int.from_bytes(b"RIKISEKI", "little")
BYTE_ORDER = 0x01020304
HEADER_BYTES = 4096
LINE = 128
MAX_SEGMENT_BYTES = 16 << 20
HAPTIC, WORLD = 1, 2
ROLE_NAMES = {HAPTIC: "haptic", WORLD: "world"}
INITIALISING, READY, CLOSED, FAULTED, SUPERSEDED = range(5)
STATE_WORD, HEARTBEAT_WORD, TICK_WORD = 0x80 // 8, 0x88 // 8, 0x90 // 8
COUNTERS_WORD = 0x100 // 8  # overruns, lapped, read_retries, rejected, gaps
UNIT = 1e-12  # N s, N m s: 7.1
PERIOD_LIMIT_NS = 10_000_000_000
USAGE, TEMPORARY, CONFIG = 64, 75, 78  # exit statuses
ABSENT, WAITING, LIVE, LATE, LOST, INCOMPATIBLE = range(6)  # states of a peer


class Refusal(Exception):
    """Ends the program with a status and a sentence."""

    def __init__(self, status, text):
        super().__init__(text)
        self.status = status


def now_ns():
    return time.clock_gettime_ns(time.CLOCK_MONOTONIC)


# ------------------------------------------------------------------------------------------------------
# Section 6: the bytes of the messages, as tables


class Nonsense(Exception):
    """A message that section 9.2 rejects."""


class Record:
    """Fields one after the other: `name:type` or `name:type[count]`, in the words of layout.golden.txt."""

    CODES = {"u8": "B", "u16": "H", "u32": "I", "u64": "Q", "i64": "q", "f64": "d", "char": "s"}

    def __init__(self, name, fields):
        self.name = name
        self.fields = []  # name, type, count, offset
        code = "<"
        self.bytes = 0
        for field in fields.split():
            field_name, kind, count = re.fullmatch(r"([\w.]+):(\w+?)(?:\[(\d+)\])?", field).groups()
            self.fields.append((field_name, kind, int(count or 0), self.bytes))
            code += (count or "") + self.CODES[kind]
            self.bytes = struct.calcsize(code)
        self.struct = struct.Struct(code)

    def layout(self):
        """The lines of layout.golden.txt (8.3)."""
        for name, kind, count, offset in self.fields:
            size = struct.calcsize("<" + self.CODES[kind]) * (count or 1)
            yield f"{self.name}.{name}:{kind}{f'[{count}]' if count else ''}:{offset}:{size}\n"

    def unpack(self, data, offset):
        values = self.struct.unpack_from(data, offset)
        record, at = {}, 0
        for name, kind, count, _ in self.fields:
            if count and kind != "char":
                value = list(values[at:at + count])
                at += count
            else:
                value = values[at]
                at += 1
            if kind == "f64" and not (all(map(math.isfinite, value)) if count else math.isfinite(value)):
                raise Nonsense(f"{self.name}.{name} is not finite")  # 6-1
            record[name] = value
        return record

    def pack(self, record):
        values = []
        for name, kind, count, _ in self.fields:
            if count and kind != "char":
                values.extend(record[name])
            else:
                values.append(record[name])
        return self.struct.pack(*values)


TICK = Record("haptic.tick", "tick:u64 start_ns:u64 period_ns:u64 previous_duration_ns:u64 world_epoch:u64 "
              "world_frame:u64 stiffness:f64 damping:f64 force_cap:f64 pointer_count:u32 channel_count:u32")
POINTER = Record("haptic.tick/pointer", "pointer:u32 reason:u32 radius:f64 position:f64[3] velocity:f64[3] "
                 "force:f64[3]")
CHANNEL = Record("haptic.tick/channel", "body:u32 generation:u32 pointer:u32 state:u32 opened_tick:u64 "
                 "impulse:i64[3] angular_impulse:i64[3] first_moment:f64[3] angular_first_moment:f64[3] "
                 "contact_point:f64[3]")
ROTATION = Record("haptic.tick/pointer_rotation", "orientation:f64[4] angular_velocity:f64[3] torque:f64[3]")
GROUND = Record("haptic.tick/ground", "impulse:i64[3] angular_impulse:i64[3]")
SCHEDULING = ("scheduling.policy:u32 scheduling.priority:u32 scheduling.memory_locked:u32 "
              "scheduling.cpu:u32 ")
HAPTIC_HEALTH = Record(
    "haptic.health", "ticks:u64 period_ns:u64 missed:u64 worst_missed_in_a_row:u64 reason_ticks:u64 reason:u32 "
    "peer_state:u32 peer_epoch:u64 feature_age_ns:u64 zero_force_after_ns:u64 largest_force:f64 "
    "largest_force_step:f64 slew_limit:f64 target:f64[3] " + SCHEDULING + "books.displayed:i64[3] "
    "books.ground:i64[3] books.covered:i64[3] books.applied:i64[3] books.discarded:i64[3] "
    "books.peer_lost:i64[3] minor_faults:u64 major_faults:u64 device:char[32] lateness:u64[256] "
    "duration:u64[256]")
FRAME = Record("world.frame", "frame:u64 world_time_ns:u64 period_ns:u64 acked_epoch:u64 acked_tick:u64 "
               "baseline_tick:u64 applied:i64[3] discarded:i64[3] coupling:u32 plane_count:u32")
PLANE = Record("world.frame/plane", "pointer:u32 body:u32 generation:u32 feature:u32 point:f64[3] normal:f64[3]")
SURFACE = Record("world.frame/plane_surface", "stiffness:f64 damping:f64")
WORLD_HEALTH = Record(
    "world.health", "frames:u64 period_ns:u64 missed:u64 lapped:u64 peer_state:u32 coupling:u32 peer_epoch:u64 "
    "applied:i64[3] discarded.gap:i64[3] discarded.coupling:i64[3] discarded.foreign_world:i64[3] "
    "discarded.unknown_body:i64[3] penalty_impulse:f64[3] moving_bodies:u64 resets:u64 " + SCHEDULING +
    "scene:char[64] lateness:u64[256] duration:u64[256]")
RECONCILIATION = Record("haptic.health/reconciliation", "frames:u64 newest_jump:f64 largest_jump:f64")
ENERGY = Record("haptic.health/energy", "injected:f64 dissipated:f64 flagged:u64 unstable:u32 controller:u32")
VELOCITY = Record("world.frame/plane_velocity", "velocity:f64[3]")
FRICTION = Record("world.frame/plane_friction", "static_friction:f64 dynamic_friction:f64")
RECOVERY = Record("world.frame/plane_recovery", "recovery_s:f64")
LOCAL = Record("world.frame/local", "local_body_count:u32 reserved:u32 substep_ns:u64")
LOCAL_BODY = Record("world.frame/local_body", "body:u32 generation:u32 contact_count:u32 reserved:u32 mass:f64 "
                    "inertia:f64[6] position:f64[3] orientation:f64[4] velocity:f64[3] angular_velocity:f64[3] "
                    "acceleration:f64[3] angular_acceleration:f64[3]")
CONTACT_PLANE = Record("world.frame/contact_plane", "other_body:u32 other_generation:u32 point:f64[3] "
                       "normal:f64[3] gap:f64 friction:f64 other_velocity:f64[3] other_inverse_mass:f64 "
                       "impulse:f64[3] radius:f64")
MOBILITY = Record("world.frame/plane_mobility", "inverse_mass:f64")
ROUNDING = Record("world.frame/plane_rounding", "radius:f64")
SCENE = Record("world.scene", "revision:u64 needs:u64 left_out:u64 gravity:f64[3] name:char[64] body_count:u32 "
               "collider_count:u32")
SCENE_BODY = Record("world.scene/body", "body:u32 generation:u32 fixed:u32 collider_count:u32 name:char[64]")
COLLIDER = Record("world.scene/collider", "shape:u32 reserved:u32 dimensions:f64[3] position:f64[3] "
                  "orientation:f64[4] colour:f64[4]")
MESH = Record("world.scene/mesh", "sha256:u8[32] path:char[224]")
BODIES = Record("world.bodies", "body_count:u32 reserved:u32")
BODY = Record("world.bodies/body", "body:u32 generation:u32 mass:f64 position:f64[3] orientation:f64[4] "
              "velocity:f64[3] angular_velocity:f64[3]")


class Cursor:
    """Takes records from the front of a payload."""

    def __init__(self, data, end):
        self.data, self.end, self.at = data, min(end, len(data)), 0

    def take(self, record, count=1):
        demand(count * record.bytes <= self.end - self.at, f"{record.name} lies beyond the end")
        records = [record.unpack(self.data, self.at + i * record.bytes) for i in range(count)]
        self.at += count * record.bytes
        return records


class Block:
    """An optional block: `count` records (a field of the head, a function of the message, or one)."""

    def __init__(self, bit, key, count, record, default, most=1):
        self.bit, self.key, self.count, self.default = bit, key, count, default
        self.record, self.records, self.most = record, [record], most * record.bytes

    def number(self, message):
        return self.count(message) if callable(self.count) else message[self.count] if self.count else 1

    def encode(self, message):
        """Empty if it is left out (6-6); so is an empty list."""
        if all(entry == self.default for entry in message[self.key]):
            return b""
        return b"".join(self.record.pack(entry) for entry in message[self.key])

    def decode(self, message, cursor):
        message[self.key] = cursor.take(self.record, self.number(message))

    def leave_out(self, message):
        message[self.key] = [{key: value[:] if isinstance(value, list) else value
                              for key, value in self.default.items()} for _ in range(self.number(message))]


class LocalBlock:
    """Block 16 of world.frame: `local` = {substep_ns, bodies}, each body with its `contacts`."""

    bit, key = 16, "local"
    records = [LOCAL, LOCAL_BODY, CONTACT_PLANE]
    most = LOCAL.bytes + 4 * (LOCAL_BODY.bytes + 16 * CONTACT_PLANE.bytes)

    def encode(self, message):
        local = message[self.key]
        if not local:
            return b""
        bodies = local["bodies"]
        for body in bodies:
            body["contact_count"] = len(body["contacts"])
        return b"".join([LOCAL.pack(local | {"local_body_count": len(bodies)})] +
                        [LOCAL_BODY.pack(body) for body in bodies] +
                        [CONTACT_PLANE.pack(contact) for body in bodies for contact in body["contacts"]])

    def decode(self, message, cursor):
        local = cursor.take(LOCAL)[0]
        demand(local["local_body_count"] <= 4, "local_body_count")
        local["bodies"] = cursor.take(LOCAL_BODY, local["local_body_count"])
        for body in local["bodies"]:
            demand(body["contact_count"] <= 16, "contact_count")
            body["contacts"] = cursor.take(CONTACT_PLANE, body["contact_count"])
        message[self.key] = local if local["bodies"] else []

    def leave_out(self, message):
        message[self.key] = []


class Message:
    """A message: head, lists of records, optional blocks. In memory: a dict of the head's fields and lists."""

    def __init__(self, type_id, head, lists=(), blocks=(), check=None, version=1):
        self.type_id, self.head, self.lists, self.blocks, self.check = type_id, head, lists, blocks, check
        self.version = version  # type_version of the stream

    def records(self):
        return ([self.head] + [record for _, _, record, _ in self.lists] +
                [record for block in self.blocks for record in block.records])

    def largest(self):
        return (self.head.bytes + sum(record.bytes * limit for _, _, record, limit in self.lists) +
                sum(block.most for block in self.blocks))

    def new(self, **fields):
        message = {key: [] for key, *_ in self.lists} | {block.key: [] for block in self.blocks}
        for name, kind, count, _ in self.head.fields:
            zero = b"" if kind == "char" else 0.0 if kind == "f64" else 0
            message[name] = [zero] * count if count and kind != "char" else zero
        message.update(fields)
        return message

    def encode(self, message):
        """The payload and its block bits."""
        for key, count, _, _ in self.lists:
            message[count] = len(message[key])
        parts = [self.head.pack(message)]
        for key, _, record, _ in self.lists:
            parts += [record.pack(entry) for entry in message[key]]
        bits = 0
        for block in self.blocks:
            part = block.encode(message)
            if part:
                bits |= block.bit
                parts.append(part)
        return b"".join(parts), bits

    def decode(self, data, used_bytes, bits):
        """The message in the private copy `data`, checked (9.2), or Nonsense."""
        cursor = Cursor(data, used_bytes)
        message = cursor.take(self.head)[0]
        for key, count, record, limit in self.lists:
            demand(message[count] <= limit, f"{count} is {message[count]}")
            message[key] = cursor.take(record, message[count])
        known = 0
        for block in self.blocks:
            known |= block.bit
            if bits & block.bit:
                block.decode(message, cursor)
            else:
                block.leave_out(message)
        # Nothing more follows, unless bits are set that are not known here (8.2-7).
        demand(used_bytes == cursor.at or (bits & ~known and used_bytes > cursor.at),
               f"{used_bytes} bytes used, {cursor.at} needed")
        if self.check:
            self.check(message)
        return message


def demand(condition, text):
    if not condition:
        raise Nonsense(text)


def is_period(period_ns):
    return 1 <= period_ns <= PERIOD_LIMIT_NS


def normalise(values, least, most, text):
    """9.2-4. What is unit as far as doubles can tell keeps its bits."""
    length = math.hypot(*values)
    demand(math.isfinite(length) and least < length < most, text)
    if abs(length - 1) > 1e-14:
        values[:] = [value / length for value in values]


def check_tick(m):
    demand(min(m["stiffness"], m["damping"], m["force_cap"]) >= 0, "a negative setting")
    demand(is_period(m["period_ns"]), "no period")
    numbers = [p["pointer"] for p in m["pointers"]]
    demand(all(n < 4 for n in numbers) and len(set(numbers)) == len(numbers), "pointer numbers")
    for p in m["pointers"]:
        demand(p["reason"] <= 17, "reason")
        demand(p["radius"] >= 0, "radius")
    for r in m["rotations"]:
        normalise(r["orientation"], 0.99 - 1e-16, 1.01 + 1e-16, "no unit quaternion")
    for c in m["channels"]:
        demand(c["pointer"] < 4, "channel of no pointer")
        demand(c["state"] in (1, 2), "channel state")
        demand(c["opened_tick"] <= m["tick"], "opened in the future")


def check_frame(m):
    demand(m["coupling"] in (1, 2, 3), "coupling")
    demand(m["frame"] != 0, "frame 0")
    demand(is_period(m["period_ns"]), "no period")
    demand(m["acked_epoch"] == 0 or m["baseline_tick"] <= m["acked_tick"], "baseline after the ack")
    for p in m["planes"]:
        demand(p["pointer"] < 4, "plane for no pointer")
        normalise(p["normal"], 1e-12, math.inf, "a normal without direction")
    for s in m["surfaces"]:
        demand(s["stiffness"] >= 0 and s["damping"] >= 0, "a negative surface")
    for f in m["frictions"]:
        demand(f["static_friction"] >= 0 and f["dynamic_friction"] >= 0, "a negative friction")
    for r in m["recoveries"]:
        demand(0 <= r["recovery_s"] <= 10, "recovery_s")
    for p in m["mobilities"]:
        demand(p["inverse_mass"] >= 0 or p == NOT_SAID, "inverse_mass")
    for p in m["roundings"]:
        demand(p["radius"] >= 0, "radius")
    if m["local"]:
        check_local(m["local"])


def check_local(local):
    demand(is_period(local["substep_ns"]), "no substep")
    numbers = [body["body"] for body in local["bodies"]]
    demand(len(set(numbers)) == len(numbers), "a local body stands twice")
    for body in local["bodies"]:
        demand(1e-9 <= body["mass"] <= 1e9, "mass")
        check_inertia(body["inertia"])
        normalise(body["orientation"], 0.99 - 1e-16, 1.01 + 1e-16, "no unit quaternion")
        for contact in body["contacts"]:
            demand(min(contact["friction"], contact["other_inverse_mass"], contact["radius"]) >= 0,
                   "a negative contact")
            normalise(contact["normal"], 1e-12, math.inf, "a normal without direction")


def check_inertia(inertia):
    """6.2-10."""
    trace = inertia[0] + inertia[3] + inertia[5]
    demand(1e-18 <= trace <= 1e18, "inertia")
    xx, xy, xz, yy, yz, zz = [component / trace for component in inertia]
    demand(xx > 1e-12 and xx * yy - xy * xy > 1e-12 and
           xx * (yy * zz - yz * yz) - xy * (xy * zz - xz * yz) + xz * (xy * yz - xz * yy) > 1e-12, "inertia")


def check_haptic_health(m):
    demand(m["reason"] <= 17 and m["peer_state"] <= 5, "enumerator")
    demand(is_period(m["period_ns"]), "no period")
    for r in m["reconciliation"]:
        demand(r["newest_jump"] >= 0 and r["largest_jump"] >= 0, "a negative jump")
    for e in m["energy"]:
        demand(e["dissipated"] >= 0, "negative friction")
        demand(e["unstable"] <= 1 and e["controller"] <= 1, "enumerator")


def check_world_health(m):
    demand(m["coupling"] in (1, 2, 3) and m["peer_state"] <= 5, "enumerator")
    demand(is_period(m["period_ns"]), "no period")


def check_bodies(m):
    for b in m["bodies"]:
        demand(b["mass"] >= 0, "mass")
        normalise(b["orientation"], 0.99 - 1e-16, 1.01 + 1e-16, "no unit quaternion")


DIMENSIONS = {1: 3, 2: 1, 3: 0, 4: 2, 5: 2, 6: 3, 7: 3}  # how many of a shape's count


def check_scene(m):
    demand(m["revision"] >= 1 and m["needs"] & m["left_out"] == 0, "revision or needs")
    demand(all(body["fixed"] <= 1 for body in m["bodies"]), "fixed")
    demand(sum(body["collider_count"] for body in m["bodies"]) == m["collider_count"], "collider_count")
    for c in m["colliders"]:
        demand(c["shape"] in DIMENSIONS, "shape")
        demand(all(0 <= part <= 1 for part in c["colour"]), "colour")
        if c["shape"] == 3:
            normalise(c["dimensions"], 1e-12, math.inf, "a half-space without direction")
        for i in range(DIMENSIONS[c["shape"]]):
            may_vanish = c["shape"] == 5 and i == 1
            demand(c["dimensions"][i] > 0 or (may_vanish and c["dimensions"][i] == 0), "dimensions")
        normalise(c["orientation"], 0.99 - 1e-16, 1.01 + 1e-16, "no unit quaternion")


def mesh_count(m):
    return sum(c["shape"] == 7 for c in m["colliders"])


STILL = {"orientation": [1.0, 0.0, 0.0, 0.0], "angular_velocity": [0.0] * 3, "torque": [0.0] * 3}
NOTHING = {"impulse": [0] * 3, "angular_impulse": [0] * 3}
OWN_SURFACE = {"stiffness": 0.0, "damping": 0.0}

NOT_MOVING, SMOOTH, OWN_RECOVERY = {"velocity": [0.0] * 3}, {"static_friction": 0.0, "dynamic_friction": 0.0}, \
    {"recovery_s": 0.0}
NOT_SAID = {"inverse_mass": -1.0}
FLAT = {"radius": 0.0}
NO_JUMPS = {"frames": 0, "newest_jump": 0.0, "largest_jump": 0.0}
NO_ENERGY = {"injected": 0.0, "dissipated": 0.0, "flagged": 0, "unstable": 0, "controller": 0}
NO_FILE = {"sha256": [0] * 32, "path": bytes(224)}

HAPTIC_TICK = Message(1, TICK, [("pointers", "pointer_count", POINTER, 4),
                                ("channels", "channel_count", CHANNEL, 16)],
                      [Block(1, "rotations", "pointer_count", ROTATION, STILL, 4),
                       Block(2, "ground", None, GROUND, NOTHING)], check_tick)
WORLD_FRAME = Message(16, FRAME, [("planes", "plane_count", PLANE, 32)],
                      [Block(1, "surfaces", "plane_count", SURFACE, OWN_SURFACE, 32),
                       Block(2, "velocities", "plane_count", VELOCITY, NOT_MOVING, 32),
                       Block(4, "frictions", "plane_count", FRICTION, SMOOTH, 32),
                       Block(8, "recoveries", "plane_count", RECOVERY, OWN_RECOVERY, 32),
                       LocalBlock(),
                       Block(32, "mobilities", "plane_count", MOBILITY, NOT_SAID, 32),
                       Block(64, "roundings", "plane_count", ROUNDING, FLAT, 32)], check_frame, version=4)
HAPTIC_HEALTH_MESSAGE = Message(2, HAPTIC_HEALTH, (), [Block(1, "reconciliation", None, RECONCILIATION, NO_JUMPS),
                                                       Block(2, "energy", None, ENERGY, NO_ENERGY)],
                                check_haptic_health, version=3)
WORLD_HEALTH_MESSAGE = Message(17, WORLD_HEALTH, check=check_world_health)
WORLD_BODIES = Message(18, BODIES, [("bodies", "body_count", BODY, 10000)], check=check_bodies)
WORLD_SCENE = Message(19, SCENE, [("bodies", "body_count", SCENE_BODY, 10000),
                                  ("colliders", "collider_count", COLLIDER, 20000)],
                      [Block(1, "meshes", mesh_count, MESH, NO_FILE)], check_scene)
MESSAGES = {m.type_id: m for m in (HAPTIC_TICK, HAPTIC_HEALTH_MESSAGE, WORLD_FRAME, WORLD_HEALTH_MESSAGE,
                                   WORLD_BODIES, WORLD_SCENE)}

# ------------------------------------------------------------------------------------------------------
# Section 4: the ring

FRESH, SAME, EMPTY, CONTENDED, BACKWARDS, REJECTED = "fresh same empty contended backwards rejected".split()


class Entry:
    """A directory entry (3.2)."""

    STRUCT = struct.Struct("<IHHQQIIIIQQQ")

    def __init__(self, values):
        (self.type_id, self.type_version, self.flags, self.cursor_offset, self.ring_offset, self.slot_stride,
         self.slot_count, self.payload_bytes, _, self.period_ns, _, _) = values

    def pack(self):
        return self.STRUCT.pack(self.type_id, self.type_version, self.flags, self.cursor_offset,
                                self.ring_offset, self.slot_stride, self.slot_count, self.payload_bytes, 0,
                                self.period_ns, 0, 0)

    def slot_word(self, number):
        return (self.ring_offset + (number & (self.slot_count - 1)) * self.slot_stride) // 8


class Writer:
    def __init__(self, words, entry, message):
        self.words, self.entry, self.message, self.published = words, entry, message, 0

    def publish(self, message):
        payload, bits = self.message.encode(message)
        assert len(payload) <= self.entry.payload_bytes
        words = self.words
        number = self.published + 1
        at = self.entry.slot_word(number)
        content = struct.unpack(f"<{len(payload) // 8}Q", payload)
        words[at] = 2 * number - 1                     # 4.2, in this order
        words[at + 1] = now_ns()
        words[at + 2] = len(payload) | bits << 32
        at += 4
        for value in content:
            words[at] = value
            at += 1
        words[self.entry.slot_word(number)] = 2 * number
        words[self.entry.cursor_offset // 8] = number
        self.published = number


class Reader:
    """Reads a stream of somebody else's segment and decodes what it says."""

    def __init__(self, view, message):
        self.view, self.message, self.entry = view, message, view.find(message.type_id)
        self.cursor = self.lost = self.retries = self.rejected = self.rejected_in_a_row = 0
        self.stamp_ns = 0  # of the message accepted last
        self.seen, self.seen_ns = 0, now_ns()
        self.backwards = False
        self.value = None
        self.why = ""

    def hopeless(self):
        return self.backwards or self.rejected_in_a_row >= 10  # 9.2-6

    def _newest(self):
        number = self.view.words[self.entry.cursor_offset // 8]
        if number < self.cursor or number >> 63:
            self.backwards = True
            return None
        now = now_ns()
        if self.entry.period_ns and self.seen:  # 9.2-9
            most = 4 * ((now - self.seen_ns) // self.entry.period_ns + self.entry.slot_count)
            if number - self.seen > most:
                self.backwards = True
                return None
        self.seen, self.seen_ns = number, now
        return number

    def _copy(self, number):
        words, at = self.view.words, self.entry.slot_word(number)
        if words[at] != 2 * number:
            return None
        stamp_ns, shape = words[at + 1], words[at + 2]
        used, bits = shape & 0xFFFFFFFF, shape >> 32
        count = min(used, self.entry.payload_bytes) // 8  # 4.3-3
        content = words[at + 4:at + 4 + count].tolist()  # item by item, in this order
        if words[at] != 2 * number:
            return None
        return stamp_ns, used, bits, struct.pack(f"<{count}Q", *content)

    def _accept(self, number, copy):
        self.cursor = number
        stamp_ns, used, bits, data = copy
        try:
            demand(used % 8 == 0 and used <= self.entry.payload_bytes, f"used_bytes is {used}")
            demand(stamp_ns <= now_ns() + 1_000_000, "stamped in the future")  # 9.2-8
            demand(stamp_ns >= self.stamp_ns, "stamped before its predecessor")  # 9.2-10
            self.value = self.message.decode(data, used, bits)
        except Nonsense as reason:
            self.rejected += 1
            self.rejected_in_a_row += 1
            self.why = str(reason)
            return REJECTED
        self.rejected_in_a_row = 0
        self.stamp_ns = stamp_ns
        return FRESH

    def latest(self):
        """4.3; the message is in `value`, which keeps the previous one unless FRESH."""
        for _ in range(3):
            number = self._newest()
            if number is None:
                return BACKWARDS
            if number == 0:
                return EMPTY
            if number == self.cursor:
                return SAME
            copy = self._copy(number)
            if copy:
                return self._accept(number, copy)
            self.retries += 1
        return CONTENDED

    def next(self):
        """4.4."""
        for _ in range(3):
            number = self._newest()
            if number is None:
                return BACKWARDS
            if number == self.cursor:
                return EMPTY
            if number - self.cursor > self.entry.slot_count - 2:
                resumed = number - self.entry.slot_count // 2
                self.lost += resumed - self.cursor
                self.cursor = resumed
            copy = self._copy(self.cursor + 1)
            if copy:
                return self._accept(self.cursor + 1, copy)
            self.retries += 1
        return CONTENDED


# ------------------------------------------------------------------------------------------------------
# Sections 3 and 5: segments

HEADER = struct.Struct("<QIHHQIIQQII64sQ")  # 0x00..0x7F


def segment_path(instance, role):
    if not re.fullmatch(r"[A-Za-z0-9_-]{1,64}", instance):
        raise Refusal(USAGE, f"instance '{instance}' is not 1 to 64 of A-Z a-z 0-9 _ -")
    return f"/dev/shm/rikiseki.{instance}.{ROLE_NAMES[role]}"


FLOCK = struct.Struct("hhqqi4x")  # struct flock of Linux on x86-64


def take_lock(descriptor, length):
    """An exclusive open-file-description lock; whether it was free."""
    try:
        fcntl.fcntl(descriptor, fcntl.F_OFD_SETLK, FLOCK.pack(fcntl.F_WRLCK, os.SEEK_SET, 0, length, 0))
    except OSError:
        return False
    return True


def is_owner_locked(descriptor):
    question = FLOCK.pack(fcntl.F_RDLCK, os.SEEK_SET, 0, 1, 0)
    return FLOCK.unpack(fcntl.fcntl(descriptor, fcntl.F_OFD_GETLK, question))[0] != fcntl.F_UNLCK


def identity(path):
    try:
        status = os.lstat(path)
    except OSError:
        return None
    return status.st_dev, status.st_ino


def runtime_directory():
    given = os.environ.get("RUNTIME_DIRECTORY", "").split(":")[0]
    session = os.environ.get("XDG_RUNTIME_DIR", "")
    return given or (f"{session}/haptics" if session else f"/tmp/rikiseki-{os.geteuid()}")


def round_up(value, multiple):
    return (value + multiple - 1) // multiple * multiple


class OwnSegment:
    """Our own segment (5.2): `streams` are (message, payload_bytes, slot_count, period_ns)."""

    def __init__(self, instance, role, streams):
        self.path = segment_path(instance, role)
        self._take_role(instance, role)
        old_epoch = self._supersede()
        entries = []
        ring = HEADER_BYTES + LINE * len(streams)
        for i, (message, payload_bytes, slot_count, period_ns) in enumerate(streams):
            stride = round_up(payload_bytes + 32, LINE)
            entries.append(Entry((message.type_id, message.version, 0, HEADER_BYTES + LINE * i, ring, stride, slot_count,
                                  payload_bytes, 0, period_ns, 0, 0)))
            ring += stride * slot_count
        size = round_up(ring, 4096)
        try:
            self.descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o640)
            os.fchmod(self.descriptor, 0o640)  # past the umask
            os.posix_fallocate(self.descriptor, 0, size)
        except OSError as error:
            raise Refusal(TEMPORARY, f"cannot make {self.path}: {error.strerror}") from None
        if not take_lock(self.descriptor, 1):
            raise Refusal(TEMPORARY, f"somebody else locked {self.path} while it was made")
        self.identity = identity(self.path)
        self.memory = mmap.mmap(self.descriptor, size)
        self.words = memoryview(self.memory).cast("Q")
        now = now_ns()
        self.epoch = max(now, old_epoch + 1)
        header = HEADER.pack(MAGIC, BYTE_ORDER, *VERSION, LAYOUT_HASH, HEADER_BYTES, len(entries), size,
                             self.epoch, role, os.getpid(), b"peer.py", 0)
        self.memory[:len(header)] = header
        for i, entry in enumerate(entries):
            self.memory[0x400 + 64 * i:0x400 + 64 * (i + 1)] = entry.pack()
        self.words[HEARTBEAT_WORD] = now
        self.words[STATE_WORD] = READY
        self.writers = [Writer(self.words, entry, message) for entry, (message, *_) in zip(entries, streams)]

    def _take_role(self, instance, role):
        folder = runtime_directory()
        try:
            os.makedirs(folder, 0o700, exist_ok=True)
            status = os.lstat(folder)
            if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.geteuid():
                raise Refusal(CONFIG, f"the runtime directory {folder} is not a directory of this user")
            path = f"{folder}/rikiseki.{instance}.{ROLE_NAMES[role]}.lock"
            self.role_lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
        except OSError as error:
            raise Refusal(CONFIG, f"cannot lock the role: {error}") from None
        if not take_lock(self.role_lock, 0):
            raise Refusal(TEMPORARY, f"another process is the {ROLE_NAMES[role]} side (it holds {path})")

    def _supersede(self):
        """Puts a dead predecessor's object out of the way; its epoch, 0 if there was none."""
        try:
            status = os.lstat(self.path)
        except FileNotFoundError:
            return 0
        if not stat.S_ISREG(status.st_mode) or status.st_uid != os.geteuid():
            raise Refusal(CONFIG, f"{self.path} belongs to another user")
        old = os.open(self.path, os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC)
        try:
            if is_owner_locked(old):
                raise Refusal(TEMPORARY, f"{self.path} is in use: its owner lives")
            epoch = 0
            if os.fstat(old).st_size >= HEADER_BYTES:
                with mmap.mmap(old, HEADER_BYTES) as memory, memoryview(memory).cast("Q") as words:
                    if words[0] == MAGIC and words[0x28 // 8] < 1 << 63:
                        epoch = words[0x28 // 8]
                        words[STATE_WORD] = SUPERSEDED
        finally:
            os.close(old)
        os.unlink(self.path)
        return epoch

    def heartbeat(self, tick):
        self.words[TICK_WORD] = tick
        self.words[HEARTBEAT_WORD] = now_ns()

    def count(self, index, value):
        """One of the five counters: 0 overruns, 1 lapped, 2 read_retries, 3 rejected, 4 gaps."""
        self.words[COUNTERS_WORD + index] = value

    def close(self):
        self.words[STATE_WORD] = CLOSED
        if identity(self.path) == self.identity:
            os.unlink(self.path)


class Incompatible(Exception):
    """9.1: refuse, and do not try this object again."""


class NotNow(Exception):
    """Nothing to attach to, for the time being."""


class View:
    """Somebody else's segment, attached read-only and checked (5.3, 9.1)."""

    def __init__(self, instance, role, needs):
        self.path = segment_path(instance, role)
        self.gone = False
        self.memory = self.words = None
        try:
            self.descriptor = os.open(self.path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError as error:
            raise NotNow(error.strerror) from None
        try:
            self._attach(role, needs)
        except BaseException:
            self.close()
            raise

    def _attach(self, role, needs):
        status = os.fstat(self.descriptor)
        self.identity = status.st_dev, status.st_ino
        if not stat.S_ISREG(status.st_mode) or status.st_uid not in permitted_owners():
            raise Incompatible(f"owner {status.st_uid} may not own a segment")
        if status.st_size == 0:
            raise NotNow("it has no memory yet")
        if not HEADER_BYTES <= status.st_size <= MAX_SEGMENT_BYTES:
            raise Incompatible(f"its size is {status.st_size}")
        self.memory = mmap.mmap(self.descriptor, status.st_size & ~7, access=mmap.ACCESS_READ)
        self.words = memoryview(self.memory).cast("Q")
        state = self.words[STATE_WORD]
        if state in (INITIALISING, CLOSED, SUPERSEDED):
            raise NotNow(f"state {state}")
        if state not in (READY, FAULTED):
            raise Incompatible(f"state is {state}")
        copy = struct.pack("<512Q", *self.words[:512].tolist())
        self.entries = check_header(copy, status.st_size, role)
        for message in needs:
            if self.find(message.type_id) is None:
                raise Incompatible(f"the stream {message.head.name} is missing")
        self.epoch = struct.unpack_from("<Q", copy, 0x28)[0]
        if not self.owner_alive():
            raise NotNow("its owner has died")
        for at in range(0, len(self.words), 512):
            self.words[at]  # touch the pages

    def find(self, type_id):
        return next((entry for entry in self.entries if entry.type_id == type_id), None)

    def state(self):
        return self.words[STATE_WORD]

    def ready(self):
        return not self.gone and self.state() == READY

    def heartbeat_ns(self):
        return self.words[HEARTBEAT_WORD]

    def owner_alive(self):
        return is_owner_locked(self.descriptor)

    def replaced(self):
        """The name leads to another object. A name that is gone is no end (5.4-3)."""
        named = identity(self.path)
        return named is not None and named != self.identity

    def close(self):
        if self.words is not None:
            self.words.release()
        if self.memory is not None:
            self.memory.close()
        os.close(self.descriptor)


def permitted_owners():
    owners = {os.geteuid(), 0}
    for user in ("haptics-device", "haptics-world"):
        try:
            owners.add(pwd.getpwnam(user).pw_uid)
        except KeyError:
            pass
    return owners


def check_header(copy, object_bytes, role):
    """The directory of the private copy of a header, or Incompatible with the field that is wrong (9.1)."""

    def require(condition, field, value):
        if not condition:
            raise Incompatible(f"{field} is {value}")

    (magic, byte_order, major, minor, layout_hash, header_bytes, count, size, epoch, its_role, *_) = \
        HEADER.unpack_from(copy)
    require(magic == MAGIC, "magic", hex(magic))
    require(byte_order == BYTE_ORDER, "byte_order", hex(byte_order))
    require(major == VERSION[0], "version_major", major)
    # Of another minor version the directory decides (8.2-4).
    require(minor != VERSION[1] or layout_hash == LAYOUT_HASH, "layout_hash", hex(layout_hash))
    require(header_bytes == HEADER_BYTES, "header_bytes", header_bytes)
    require(its_role == role, "role", its_role)
    require(epoch != 0, "epoch", epoch)
    require(HEADER_BYTES <= size <= object_bytes, "segment_bytes", size)
    require(1 <= count <= 16, "stream_count", count)
    entries, taken = [], [(0, HEADER_BYTES)]
    for i in range(count):
        entry = Entry(Entry.STRUCT.unpack_from(copy, 0x400 + 64 * i))
        require(entry.type_id != 0 and all(e.type_id != entry.type_id for e in entries), "type_id",
                entry.type_id)
        require(entry.slot_stride != 0 and entry.slot_stride % LINE == 0, "slot_stride", entry.slot_stride)
        require(4 <= entry.slot_count <= 65536 and entry.slot_count & (entry.slot_count - 1) == 0,
                "slot_count", entry.slot_count)
        require(entry.payload_bytes % 8 == 0 and entry.payload_bytes <= entry.slot_stride - 32,
                "payload_bytes", entry.payload_bytes)
        for field, length in (("cursor_offset", LINE), ("ring_offset", entry.slot_stride * entry.slot_count)):
            begin = getattr(entry, field)
            end = begin + length
            require(begin % LINE == 0 and end <= size, field, begin)
            require(all(end <= b or e <= begin for b, e in taken), f"overlapping: {field}", begin)
            taken.append((begin, end))
        entries.append(entry)
    return entries


class Link:
    """Keeps looking for the peer, ten times a second on a thread of its own (5.3-1), and watches whether its
    owner lives (5.4). The loop takes what it found with `take`."""

    def __init__(self, instance, role, needs):
        self.instance, self.role, self.needs = instance, role, needs
        self.path = segment_path(instance, role)
        self.offered = None  # a view that the loop has not taken yet
        self.newest = None   # the view offered last
        self.refused = None  # identity of an object not to be tried again
        self.incompatible = False
        self.stopping = threading.Event()
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def take(self):
        view, self.offered = self.offered, None
        return view

    def refuse(self, view, why):
        """The loop found that the peer talks nonsense (9.2-6)."""
        view.gone = True
        self.refused = view.identity
        self.incompatible = True
        say(f"{self.path}: refused, {why}")

    def stop(self):
        self.stopping.set()
        self.thread.join()

    def _run(self):
        while not self.stopping.wait(0.1):
            view = self.newest
            if view is not None and not view.gone:
                if view.state() in (CLOSED, SUPERSEDED) or not view.owner_alive() or view.replaced():
                    view.gone = True
                    say(f"{self.path}: its owner is gone")
            elif self.offered is None:
                self._look()

    def _look(self):
        named = identity(self.path)
        if named is None or named == self.refused:
            return
        self.incompatible = False
        try:
            view = View(self.instance, self.role, self.needs)
        except NotNow:
            return
        except Incompatible as reason:
            self.refused = named
            self.incompatible = True
            say(f"{self.path}: refused, {reason}")
            return
        say(f"{self.path}: attached, epoch {view.epoch}")
        self.newest = view
        self.offered = view


def say(text):
    print(f"peer.py: {text}", file=sys.stderr, flush=True)


# ------------------------------------------------------------------------------------------------------
# What both loops need


def wrap(value):
    """Modulo 2^64, signed (7.1-2)."""
    return (value + (1 << 63)) % (1 << 64) - (1 << 63)


def plus(a, b):
    return [wrap(x + y) for x, y in zip(a, b)]


def minus(a, b):
    return [wrap(x - y) for x, y in zip(a, b)]


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def scaled(a, factor):
    return [x * factor for x in a]


def added(a, b):
    return [x + y for x, y in zip(a, b)]


def subtracted(a, b):
    return [x - y for x, y in zip(a, b)]


def shortened(v, limit):
    length = math.hypot(*v)
    return scaled(v, limit * (1 - 1e-14) / length) if length > limit else v


class Histogram(list):
    """6.3: bucket 0 below 1 us, then eight to an octave."""

    def __init__(self):
        super().__init__([0] * 256)

    def note(self, duration_ns):
        bucket = 0
        if duration_ns >= 1000:
            octave = (duration_ns // 1000).bit_length() - 1
            base = 1000 << octave
            bucket = min(1 + 8 * octave + (duration_ns - base) * 8 // base, 255)
        self[bucket] += 1


class Schedule:
    """Absolute deadlines; missed ones are skipped and counted, never caught up."""

    def __init__(self, period_ns):
        self.period_ns = period_ns
        self.deadline_ns = now_ns()
        self.missed = self.missed_now = self.in_a_row = self.worst_in_a_row = 0
        self.lateness, self.duration = Histogram(), Histogram()

    def wait(self):
        """Sleeps until the next deadline; the time of the wake-up."""
        self.deadline_ns += self.period_ns
        now = now_ns()
        if now < self.deadline_ns:
            time.sleep((self.deadline_ns - now) * 1e-9)
            now = now_ns()
        self.missed_now = max(0, (now - self.deadline_ns) // self.period_ns)
        self.deadline_ns += self.missed_now * self.period_ns
        self.missed += self.missed_now
        self.in_a_row = self.in_a_row + self.missed_now if self.missed_now else 0
        self.worst_in_a_row = max(self.worst_in_a_row, self.in_a_row)
        self.lateness.note(max(0, now - self.deadline_ns))
        return now

    def health(self):
        return {"period_ns": self.period_ns, "missed": self.missed, "lateness": self.lateness,
                "duration": self.duration, "scheduling.policy": os.sched_getscheduler(0),
                "scheduling.cpu": 0xFFFFFFFF}


class Stop:
    """SIGTERM, SIGINT or the end of --seconds."""

    def __init__(self, seconds):
        self.end_ns = now_ns() + int(seconds * 1e9) if seconds else None
        self.asked = False
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._ask)

    def _ask(self, *_):
        self.asked = True

    def __bool__(self):
        return self.asked or (self.end_ns is not None and now_ns() >= self.end_ns)


# ------------------------------------------------------------------------------------------------------
# The world side

HALF_EXTENT = 0.03  # m: section 10
FORCE_CAP = 20.0  # N: the world's own, 7.4-5


def nearest_plane(centre, point):
    """The tangent plane of the box around `centre` at the point of its surface that is nearest to `point`:
    (distance, point, normal, feature)."""
    local = subtracted(point, centre)
    clamped = [min(max(x, -HALF_EXTENT), HALF_EXTENT) for x in local]
    away = subtracted(local, clamped)
    distance = math.hypot(*away)
    if distance > 1e-9:
        normal = scaled(away, 1 / distance)
    else:  # inside: the nearest face
        axis = max(range(3), key=lambda i: abs(local[i]))
        normal = [0.0] * 3
        normal[axis] = math.copysign(1.0, local[axis])
        clamped[axis] = math.copysign(HALF_EXTENT, local[axis])
        distance = abs(local[axis]) - HALF_EXTENT
    # Faces, edges and corners are 26 features of the box.
    sides = [(1 if n > 1e-9 else -1 if n < -1e-9 else 0) + 1 for n in normal]
    return distance, added(clamped, centre), normal, sides[0] + 3 * sides[1] + 9 * sides[2]


class LedgerReader:
    """Takes the impulses out of the haptic ticks by the rules of 7.4 and says what became of them (7.5)."""

    REASONS = ("gap", "coupling", "foreign_world", "unknown_body")

    def __init__(self, own_epoch, largest_impulse):
        self.own_epoch = own_epoch
        self.largest_units = largest_impulse / UNIT
        self.life_applied = [0] * 3
        self.life_discarded = {reason: [0] * 3 for reason in self.REASONS}
        self.owed = {}  # body -> units consumed and not yet applied
        self.consumed = 0.0  # units since the last take
        self.gaps = 0  # world ticks that discarded for 7.4-5
        self.begin(0)

    def begin(self, epoch):
        """Only after the old segment was read to its end (7.4-7) and that was acknowledged."""
        self.epoch = epoch
        self.baseline_tick = self.tick = None
        self.known = {}
        self.applied, self.discarded = [0] * 3, [0] * 3

    def consume(self, tick, can_move):
        if self.tick is not None and tick["tick"] <= self.tick:
            return False  # 7.4-9
        now = {}
        for channel in tick["channels"]:
            key = channel["body"], channel["generation"], channel["pointer"], channel["opened_tick"]
            if key in now:
                continue
            now[key] = channel["impulse"]
            before = self.known.get(key)
            if before is None:  # 7.4-2, 7.4-3
                is_new = self.tick is not None and channel["opened_tick"] > self.tick
                before = [0] * 3 if is_new else channel["impulse"]
            self._settle(channel, minus(channel["impulse"], before), tick["world_epoch"], can_move)
        self.known = now
        if self.tick is None:
            self.baseline_tick = tick["tick"]
        self.tick = tick["tick"]
        return True

    def _settle(self, channel, units, world_epoch, can_move):
        if units == [0] * 3:
            return
        if world_epoch != self.own_epoch:
            self._discard(units, "foreign_world")  # 7.4-4
        elif not can_move(channel["body"], channel["generation"]):
            self._discard(units, "unknown_body")  # 7.4-6
        else:
            before, self.consumed = self.consumed, self.consumed + math.hypot(*units)
            if self.consumed > self.largest_units:
                self.gaps += before <= self.largest_units
                self._discard(units, "gap")  # 7.4-5
            else:
                self.owed[channel["body"]] = plus(self.owed.get(channel["body"], [0] * 3), units)

    def _discard(self, units, reason):
        self.discarded = plus(self.discarded, units)
        self.life_discarded[reason] = plus(self.life_discarded[reason], units)

    def take(self):
        """The impulses [N s] to apply now, by body."""
        taken, self.owed, self.consumed = self.owed, {}, 0.0
        for units in taken.values():
            self.applied = plus(self.applied, units)
            self.life_applied = plus(self.life_applied, units)
        return {body: scaled(units, UNIT) for body, units in taken.items()}


class World:
    """A box at the target: fixed, or with a mass on a rail along x, slowed by drag. The rail takes up what
    points across it. A block that left the reach is put back after two seconds, as another generation."""

    REACH = 0.04  # m: a finger that comes back always finds it again
    PATIENCE = 2.0  # s

    def __init__(self, target, mass, drag):
        self.home, self.mass, self.drag = target, mass, drag
        self.generation, self.resets = 1, 0
        self.position, self.velocity, self.away = list(target), 0.0, 0.0

    def can_move(self, body, generation):
        return self.mass > 0 and body == 0 and generation == self.generation

    def step(self, impulses, dt):
        if self.mass <= 0:
            return
        self.velocity += impulses.get(0, [0.0])[0] / self.mass
        # Exactly: m dv/dt = -drag v.
        rate = self.drag / self.mass
        decay = math.exp(-rate * dt)
        self.position[0] += self.velocity * ((1 - decay) / rate if rate > 0 else dt)
        self.velocity *= decay
        self.away = self.away + dt if abs(self.position[0] - self.home[0]) > self.REACH else 0.0
        if self.drag > 0 and self.away > self.PATIENCE:
            self.position, self.velocity, self.away = list(self.home), 0.0, 0.0
            self.generation += 1
            self.resets += 1

    def planes(self, pointers, dt):
        """The planes and, of each, the mobility of the box: what it yields along its rail."""
        planes = []
        for pointer in pointers:
            distance, point, normal, feature = nearest_plane(self.position, pointer["position"])
            speed = math.hypot(*pointer["velocity"]) + abs(self.velocity)
            if distance < pointer["radius"] + 0.02 + 2 * dt * min(speed, 3.0):
                planes.append({"pointer": pointer["pointer"], "body": 0, "generation": self.generation,
                               "feature": feature, "point": point, "normal": normal})
        return planes, [{"inverse_mass": 1 / self.mass if self.mass > 0 else 0.0} for _ in planes]

    def scene(self):
        """6.5; needs: moving bodies, drag."""
        needs = (1 if self.mass > 0 else 0) | (16 if self.mass > 0 and self.drag > 0 else 0)
        return WORLD_SCENE.new(
            revision=1 + self.resets, needs=needs, left_out=255 & ~needs, name=b"peer.py",
            bodies=[{"body": 0, "generation": self.generation, "fixed": int(self.mass == 0),
                     "collider_count": 1, "name": b"box"}],
            colliders=[{"shape": 1, "reserved": 0, "dimensions": [HALF_EXTENT] * 3, "position": [0.0] * 3,
                        "orientation": [1.0, 0.0, 0.0, 0.0], "colour": [0.8, 0.5, 0.2, 1.0]}])

    def body(self):
        return {"body": 0, "generation": self.generation, "mass": self.mass, "position": self.position,
                "orientation": [1.0, 0.0, 0.0, 0.0], "velocity": [self.velocity, 0.0, 0.0],
                "angular_velocity": [0.0] * 3}


def run_world(arguments):
    period_ns = round(1e9 / arguments.rate)
    dt = period_ns * 1e-9
    world = World(arguments.target, arguments.mass, arguments.drag)
    own = OwnSegment(arguments.instance, WORLD,
                     [(WORLD_FRAME, 16384 - 32, 8, period_ns),  # 6.2-2
                      (WORLD_HEALTH_MESSAGE, WORLD_HEALTH.bytes, 4, 250_000_000),
                      (WORLD_BODIES, BODIES.bytes + BODY.bytes, 4, period_ns),
                      (WORLD_SCENE, SCENE.bytes + SCENE_BODY.bytes + COLLIDER.bytes, 4, 0)])
    frames, healths, bodies, scenes = own.writers
    scenes.publish(world.scene())
    ledger = LedgerReader(own.epoch, FORCE_CAP * max(0.1, 3 * dt))
    link = Link(arguments.instance, HAPTIC, [HAPTIC_TICK])
    reader, tick, tick_ns, fresh_ticks = None, None, 0, 0
    totals = [0, 0, 0]  # lapped, retries, rejected of the readers before
    schedule, stop = Schedule(period_ns), Stop(arguments.seconds)
    frame, health_ns = 0, 0
    say(f"world of instance '{arguments.instance}', {arguments.rate:g} Hz, " +
        (f"a block of {world.mass:g} kg" if world.mass else "a fixed box") + f", epoch {own.epoch}")

    def drain():
        """Every tick that was published and not read yet, within half a period: whoever floods is lapped, which
        loses nothing (7.4-1). Whether nothing is left."""
        nonlocal tick, tick_ns, fresh_ticks
        end_ns = now_ns() + period_ns // 2
        while reader is not None and not reader.hopeless():
            if now_ns() > end_ns:
                return False
            status = reader.next()
            if status == FRESH:
                if ledger.epoch != reader.view.epoch:
                    ledger.begin(reader.view.epoch)
                if ledger.consume(reader.value, world.can_move):
                    tick, tick_ns, fresh_ticks = reader.value, now_ns(), fresh_ticks + 1
            elif status != REJECTED:
                break
        if reader is not None and reader.hopeless() and not reader.view.gone:
            link.refuse(reader.view, reader.why or "its counter runs backwards")
        return True

    offered = None
    while not stop:
        now = schedule.wait()
        if offered is None:
            offered = link.take()  # first: the old segment, frozen then, is read to its end (5.3-5)
        drained = drain()
        impulses = ledger.take()
        world.step(impulses, dt)
        if scenes.published <= world.resets:
            scenes.publish(world.scene())
        frame += 1
        age_ns = now_ns() - tick_ns
        period_T = tick["period_ns"] if tick else 0
        peer_state = INCOMPATIBLE if link.incompatible else ABSENT
        if reader is not None and not link.incompatible:
            lost = not reader.view.ready() or age_ns > max(20_000_000, 20 * period_T) + period_ns
            late = age_ns > max(5_000_000, 5 * period_T) + period_ns
            peer_state = (WAITING if fresh_ticks < 3 else LOST if lost else LATE if late else LIVE)
        # A finger that has not been heard of for a while gets no planes.
        seen = tick["pointers"] if tick and peer_state in (WAITING, LIVE, LATE) else []
        planes, mobilities = world.planes(seen, dt)
        frames.publish(WORLD_FRAME.new(
            frame=frame, world_time_ns=frame * period_ns, period_ns=period_ns, acked_epoch=ledger.epoch,
            acked_tick=ledger.tick or 0, baseline_tick=ledger.baseline_tick or 0, applied=ledger.applied,
            discarded=ledger.discarded, coupling=2, planes=planes, mobilities=mobilities))
        bodies.publish(WORLD_BODIES.new(bodies=[world.body()]))
        own.heartbeat(frame)
        counts = totals if reader is None else \
            [a + b for a, b in zip(totals, (reader.lost, reader.retries, reader.rejected))]
        for index, value in enumerate([schedule.missed] + counts + [ledger.gaps]):
            own.count(index, value)
        if now - health_ns >= 250_000_000:
            health_ns = now
            discarded = {f"discarded.{reason}": units for reason, units in ledger.life_discarded.items()}
            healths.publish(WORLD_HEALTH_MESSAGE.new(
                frames=frame, lapped=counts[0], peer_state=peer_state, coupling=2,
                peer_epoch=reader.view.epoch if reader else 0, applied=ledger.life_applied,
                moving_bodies=int(world.mass > 0), resets=world.resets,
                scene=b"peer.py block" if world.mass else b"peer.py box", **discarded, **schedule.health()))
        if offered is not None and drained:  # only now: the old segment's end is acknowledged
            if reader is not None:
                reader.view.close()
            totals, reader, tick, fresh_ticks = counts, Reader(offered, HAPTIC_TICK), None, 0
            offered = None
        schedule.duration.note(now_ns() - now)
    own.close()
    link.stop()


# ------------------------------------------------------------------------------------------------------
# The haptic side

STIFFNESS, DAMPING = 1000.0, 2.0  # N/m, N s/m: what a plane that brings none gets
CAP, SLEW_LIMIT = 8.0, 1000.0  # N, N/s
SOFT_START, FADE = 0.2, 0.08  # s
RADIUS = 0.01  # m
SPEED_LIMIT = 3.0  # m/s
CONTACT, CAPPED, SLEW_LIMITED, STARTING, WORLD_LATE, WORLD_LOST, WORLD_ABSENT, OVER_SPEED, NO_CHANNEL, \
    LOOP_FAULT, STOPPED = 1, 2, 3, 5, 6, 7, 8, 9, 11, 13, 14


class Finger:
    """A finger on a spring that leads it from outside of the box, along x, towards its middle and back, every
    two seconds: mass, and the hand's stiffness and damping."""

    MASS, STIFFNESS, DAMPING = 0.3, 150.0, 6.0
    CYCLE = 2.0  # s

    def __init__(self, target):
        self.home = added(target, [-0.06, 0.0, 0.0])
        self.reach = 0.07  # m, along x
        self.position, self.velocity = list(self.home), [0.0] * 3
        self.time = 0.0

    def wanted(self):
        phase = self.time % self.CYCLE
        q = min(phase, 1.1 - phase) / 0.4 if phase < 1.1 else 0.0  # there, stay, back, rest
        q = min(max(q, 0.0), 1.0)
        return added(self.home, [self.reach * q * q * q * (10 - 15 * q + 6 * q * q), 0.0, 0.0])

    def move(self, force, dt):
        """Semi-implicit, in substeps of at most 2 ms."""
        steps = max(1, math.ceil(dt / 0.002))
        h = min(dt, 0.05) / steps
        for _ in range(steps):
            self.time += h
            wanted = self.wanted()
            for i in range(3):
                pull = self.STIFFNESS * (wanted[i] - self.position[i]) - self.DAMPING * self.velocity[i]
                self.velocity[i] += h * (pull + force[i]) / self.MASS
                self.position[i] += h * self.velocity[i]


class Quantiser:
    """N s to whole units; what is left over is carried (7.1-1)."""

    def __init__(self):
        self.remainder = [0.0] * 3

    def __call__(self, impulse):
        units = []
        for i, value in enumerate(impulse):
            exact = value / UNIT + self.remainder[i]
            units.append(round(exact))
            self.remainder[i] = exact - units[-1]
        return units


class Account:
    """A channel while we keep it."""

    def __init__(self, body, generation, tick):
        self.key = body, generation
        self.opened_tick, self.closed_tick = tick, None
        self.impulse, self.angular = [0] * 3, [0] * 3
        self.moment, self.angular_moment = [0.0] * 3, [0.0] * 3
        self.quantise, self.quantise_angular = Quantiser(), Quantiser()
        self.force, self.point = [0.0] * 3, [0.0] * 3  # on the body, in the tick before

    def pay(self, force, point, period, correction):
        """7.3."""
        before, angular_before = scaled(self.impulse, UNIT), scaled(self.angular, UNIT)
        now, late = scaled(force, period), scaled(self.force, correction)
        units = self.quantise(added(now, late))
        self.impulse = plus(self.impulse, units)
        self.angular = plus(self.angular,
                            self.quantise_angular(added(cross(point, now), cross(self.point, late))))
        for i in range(3):
            self.moment[i] += self.impulse[i] * UNIT * period + before[i] * correction
            self.angular_moment[i] += self.angular[i] * UNIT * period + angular_before[i] * correction
        self.force, self.point = force, point
        return units

    def record(self):
        return {"body": self.key[0], "generation": self.key[1], "pointer": 0,
                "state": 1 if self.closed_tick is None else 2, "opened_tick": self.opened_tick,
                "impulse": self.impulse, "angular_impulse": self.angular, "first_moment": self.moment,
                "angular_first_moment": self.angular_moment, "contact_point": self.point}


class Ledger:
    """The haptic side's books (7.2, 7.3, 7.6)."""

    HISTORY = 16384  # ticks whose totals are remembered, to look up what an ack covers

    def __init__(self, own_epoch, period):
        self.own_epoch, self.period = own_epoch, period
        self.accounts = []
        self.total, self.ground_angular = Quantiser(), Quantiser()
        self.force = [0.0] * 3          # minus the displayed force of the tick before
        self.ground_force, self.ground_point = [0.0] * 3, [0.0] * 3
        self.ground = {"impulse": [0] * 3, "angular_impulse": [0] * 3}
        self.books = {name: [0] * 3 for name in ("displayed", "ground", "covered", "applied", "discarded",
                                                 "peer_lost")}
        self.history = [None] * self.HISTORY
        self.ticks = 0
        self.acked_tick, self.acked = 0, [0] * 3
        self.world = None  # (epoch, baseline_tick) that acknowledged last
        self.world_applied, self.world_discarded = [0] * 3, [0] * 3

    def _displayed_at(self, tick):
        if tick >= self.ticks or self.ticks - tick > self.HISTORY:
            return None
        return self.history[tick % self.HISTORY]

    def receive(self, world_epoch, frame):
        """Books what the ack of a frame covers; wrong acks are ignored (7.6-4, 7.6-5)."""
        tick, baseline_tick = frame["acked_tick"], frame["baseline_tick"]
        displayed = self._displayed_at(tick)
        if frame["acked_epoch"] != self.own_epoch or tick < self.acked_tick or displayed is None:
            return
        books = self.books
        if self.world != (world_epoch, baseline_tick):
            baseline = self._displayed_at(baseline_tick)
            if baseline is not None and self.acked_tick <= baseline_tick <= tick:
                self.world_applied, self.world_discarded = [0] * 3, [0] * 3
            else:  # its beginning is out of sight: count from here
                baseline = displayed
                self.world_applied, self.world_discarded = frame["applied"], frame["discarded"]
            books["peer_lost"] = plus(books["peer_lost"], minus(baseline, self.acked))
            self.acked = baseline
            self.world = world_epoch, baseline_tick
        books["covered"] = plus(books["covered"], minus(displayed, self.acked))
        books["applied"] = plus(books["applied"], minus(frame["applied"], self.world_applied))
        books["discarded"] = plus(books["discarded"], minus(frame["discarded"], self.world_discarded))
        self.acked, self.acked_tick = displayed, tick
        self.world_applied, self.world_discarded = frame["applied"], frame["discarded"]
        self.accounts = [a for a in self.accounts if a.closed_tick is None or a.closed_tick > tick]  # 7.6-2

    def open(self, key, tick):
        """An open channel for a body, or None if all are taken (7.2-6)."""
        for account in self.accounts:
            if account.key == key:
                account.closed_tick = None
                return account
        if len(self.accounts) == 16:
            return None
        self.accounts.append(Account(*key, tick))
        return self.accounts[-1]

    def book(self, displayed, shares, finger, previous_duration):
        """`displayed` on the user; `shares`: (account, force on the user, point) as wanted; without an account
        it is the ground's (7.2-10)."""
        correction = previous_duration - self.period if self.ticks else 0.0
        wanted = [sum(share[1][i] for share in shares) for i in range(3)]
        square = dot(wanted, wanted)
        fraction = min(max(dot(displayed, wanted) / square, 0.0), 1.0) if square > 1e-24 else 0.0
        booked, to_bodies = [0] * 3, [0.0] * 3
        for account in self.accounts:
            force, point = [0.0] * 3, account.point
            for owner, share, at in shares:
                if owner is account:
                    force, point = scaled(share, -fraction), at
            booked = plus(booked, account.pay(force, point, self.period, correction))
            to_bodies = added(to_bodies, force)
        on_world = scaled(displayed, -1.0)
        total = self.total(added(scaled(on_world, self.period), scaled(self.force, correction)))
        ground_force = subtracted(on_world, to_bodies)
        self.ground["impulse"] = plus(self.ground["impulse"], minus(total, booked))
        self.ground["angular_impulse"] = plus(self.ground["angular_impulse"], self.ground_angular(
            added(cross(finger, scaled(ground_force, self.period)),
                  cross(self.ground_point, scaled(self.ground_force, correction)))))
        self.force, self.ground_force, self.ground_point = on_world, ground_force, list(finger)
        self.books["displayed"] = plus(self.books["displayed"], booked)
        self.books["ground"] = self.ground["impulse"]
        self.history[self.ticks % self.HISTORY] = self.books["displayed"]
        self.ticks += 1

    def close_idle(self, near, tick):
        for account in self.accounts:
            if account.closed_tick is None and account.force == [0.0] * 3 and account.key not in near:
                account.closed_tick = tick


class PeerWatch:
    """Whether the world is alive, counted on our own clock (5.5)."""

    LONGEST_PERIOD_NS = 200_000_000

    def __init__(self):
        self.stated_period_ns = self.LONGEST_PERIOD_NS  # of the newest frame of any world
        self.forget()

    def forget(self):
        self.state, self.fresh, self.frame_ns, self.period_ns = ABSENT, 0, 0, self.LONGEST_PERIOD_NS

    def lost_after(self):
        return self.lost_after_period(self.period_ns)

    @staticmethod
    def lost_after_period(period_ns):
        return max(5 * period_ns, 250_000_000)

    def update(self, now, view, frame, force_is_zero):
        alive = view is not None and view.ready() and now - view.heartbeat_ns() <= self.lost_after()
        age = now - self.frame_ns
        if self.state in (LIVE, LATE):
            if not alive or (frame is None and age > self.lost_after()):
                self.state = LOST
            elif frame is not None or age <= 2.5 * self.period_ns:
                self.state = LIVE
            else:
                self.state = LATE
        elif self.state == LOST:
            if force_is_zero:
                self.forget()
            return
        elif not alive:
            self.forget()
        else:
            self.state = WAITING
            if self.fresh and age > self.lost_after():
                self.fresh = 0
        if frame is not None and self.state != ABSENT:
            self.frame_ns = now
            self.period_ns = self.stated_period_ns = min(frame["period_ns"], self.LONGEST_PERIOD_NS)
            self.fresh += 1
            if self.state == WAITING and self.fresh >= 3:  # 5.5-3
                self.state = LIVE


class Surfaces:
    """The planes for pointer 0, moved from one frame to the next over a world period."""

    def __init__(self):
        self.planes = {}  # key -> (from, to, normal, stiffness, damping)
        self.fixed = set()  # bodies that cannot move, as the frame says
        self.since_ns, self.period_ns = 0, 1

    def receive(self, frame, now):
        shown = {key: self._point(plane, now) for key, plane in self.planes.items()}
        self.planes, self.fixed = {}, set()
        for plane, surface, mobility in zip(frame["planes"], frame["surfaces"], frame["mobilities"]):
            if plane["pointer"] != 0:
                continue
            if mobility["inverse_mass"] == 0:
                self.fixed.add((plane["body"], plane["generation"]))
            key = plane["body"], plane["generation"], plane["feature"]
            own = surface["stiffness"] > 0
            self.planes[key] = (shown.get(key, plane["point"]), plane["point"], plane["normal"],
                                min(surface["stiffness"], STIFFNESS) if own else STIFFNESS,
                                min(surface["damping"], DAMPING) if own else DAMPING)
        self.since_ns, self.period_ns = now, min(frame["period_ns"], PeerWatch.LONGEST_PERIOD_NS)

    def _point(self, plane, now):
        part = min((now - self.since_ns) / self.period_ns, 1.0)
        return [a + part * (b - a) for a, b in zip(plane[0], plane[1])]

    def forces(self, finger, now):
        """Force on the user and contact point, by body: a spring and a damper that only push."""
        forces = {}
        for key, plane in self.planes.items():
            normal = plane[2]
            depth = RADIUS - dot(subtracted(finger.position, self._point(plane, now)), normal)
            if not depth > 0:
                continue
            push = plane[3] * min(depth, 0.1) - plane[4] * dot(finger.velocity, normal)
            if push > 0:
                body = key[:2]
                force, point = forces.get(body, ([0.0] * 3, None))
                contact = subtracted(finger.position, scaled(normal, RADIUS - min(depth, 0.1)))
                forces[body] = added(force, scaled(normal, push)), contact
        return forces

    def bodies(self):
        return {key[:2] for key in self.planes}


class Safety:
    """The last stage: finite, below the cap, below the slew limit, zero without a world (5.5)."""

    def __init__(self, period):
        self.period, self.gain, self.force, self.reason = period, 0.0, [0.0] * 3, WORLD_ABSENT

    def limit(self, wanted, state, speed, elapsed, missed, no_channel):
        fault = LOOP_FAULT if missed >= 100 else OVER_SPEED if not speed <= SPEED_LIMIT else 0
        if fault or not all(map(math.isfinite, wanted)):
            self.gain, wanted = 0.0, [0.0] * 3
        elif state in (LIVE, LATE):
            self.gain = min(1.0, self.gain + min(elapsed, self.period) / SOFT_START)
        elif state == LOST:
            self.gain = max(0.0, self.gain - elapsed / FADE)
        else:
            self.gain = 0.0
        full = scaled(wanted, self.gain)
        target = shortened(full, CAP)
        change = subtracted(target, self.force)
        step = shortened(change, SLEW_LIMIT * self.period)
        self.force = shortened(added(self.force, step), CAP) if step is not change else target
        self.reason = (fault or (WORLD_LOST if state == LOST else 0) or
                       (WORLD_ABSENT if state not in (LIVE, LATE) else 0) or
                       (SLEW_LIMITED if step is not change else 0) or (CAPPED if target is not full else 0) or
                       (STARTING if wanted != [0.0] * 3 and self.gain < 1 else 0) or
                       (NO_CHANNEL if no_channel else 0) or (WORLD_LATE if state == LATE else 0) or
                       (CONTACT if wanted != [0.0] * 3 else 0))
        return self.force


class HapticSide:
    """One tick: read the finger, render, limit, book, publish."""

    def __init__(self, own, period_ns, target):
        self.own, self.period_ns, self.period = own, period_ns, period_ns * 1e-9
        self.ticks, self.healths = own.writers
        self.finger, self.surfaces, self.watch = Finger(target), Surfaces(), PeerWatch()
        self.ledger, self.safety = Ledger(own.epoch, self.period), Safety(self.period)
        self.reader = None
        self.newest_frame = 0  # number of the newest frame of this reader
        self.shown_epoch = self.shown_frame = self.channel_epoch = 0
        self.start_ns, self.tick, self.reason, self.reason_ticks = 0, 0, WORLD_ABSENT, 0
        self.largest_force = self.largest_step = 0.0
        self.retries = self.rejected = 0

    def read_world(self, link):
        """The newest frame if it is new, else None. A new world only after the old one's force is gone."""
        offered = link.take() if self.watch.state == ABSENT else None
        if offered is not None:
            if self.reader is not None:
                self._last_ack()
                self.retries += self.reader.retries
                self.rejected += self.reader.rejected
                self.reader.view.close()
            self.reader, self.newest_frame = Reader(offered, WORLD_FRAME), 0
        if self.reader is None:
            return None
        status = self.reader.latest()
        if self.reader.hopeless() and not self.reader.view.gone:
            link.refuse(self.reader.view, self.reader.why or "its counter runs backwards")
        if status != FRESH or self.reader.value["frame"] <= self.newest_frame:  # 6.2-3
            return None
        self.newest_frame = self.reader.value["frame"]
        self.ledger.receive(self.reader.view.epoch, self.reader.value)
        return self.reader.value

    def _last_ack(self):
        """5.3-6: the old world's newest frame once more, before the new one counts."""
        if not self.reader.hopeless() and self.reader.latest() == FRESH:
            self.ledger.receive(self.reader.view.epoch, self.reader.value)

    def step(self, now, link, schedule):
        previous_ns = now - self.start_ns if self.tick else 0
        elapsed = previous_ns * 1e-9
        self.finger.move(self.safety.force, elapsed)
        frame = self.read_world(link)
        before = self.safety.force
        view = self.reader.view if self.reader else None
        self.watch.update(now, view, frame, before == [0.0] * 3)
        state = self.watch.state
        if state == ABSENT and self.shown_epoch:
            self.surfaces = Surfaces()
            self.shown_epoch = self.shown_frame = 0
        if frame is not None and state in (WAITING, LIVE, LATE):
            if self.channel_epoch != view.epoch:
                self.ledger.accounts = []  # 7.6-3
                self.channel_epoch = view.epoch
            self.surfaces.receive(frame, now)
            self.shown_epoch, self.shown_frame = view.epoch, frame["frame"]
        shares, no_channel = [], False
        if state in (LIVE, LATE, LOST):
            for body, (force, point) in self.surfaces.forces(self.finger, now).items():
                if body in self.surfaces.fixed:  # 7.2-10
                    shares.append((None, force, point))
                    continue
                account = self.ledger.open(body, self.tick)
                no_channel |= account is None
                if account is not None:
                    shares.append((account, force, point))
        wanted = [sum(share[1][i] for share in shares) for i in range(3)]
        force = self.safety.limit(wanted, state, math.hypot(*self.finger.velocity), elapsed,
                                  schedule.in_a_row, no_channel)
        self.ledger.book(force, shares, self.finger.position, elapsed)
        self.ledger.close_idle(self.surfaces.bodies(), self.tick)
        self.publish(now, previous_ns, force, self.safety.reason)
        self.largest_step = max(self.largest_step, math.hypot(*subtracted(force, before)))

    def publish(self, now, previous_ns, force, reason):
        pointer = {"pointer": 0, "reason": reason, "radius": RADIUS, "position": self.finger.position,
                   "velocity": self.finger.velocity, "force": force}
        self.ticks.publish(HAPTIC_TICK.new(
            tick=self.tick, start_ns=now, period_ns=self.period_ns, previous_duration_ns=previous_ns,
            world_epoch=self.shown_epoch, world_frame=self.shown_frame, stiffness=STIFFNESS, damping=DAMPING,
            force_cap=CAP, pointers=[pointer], channels=[a.record() for a in self.ledger.accounts],
            ground=[self.ledger.ground]))
        self.reason_ticks = self.reason_ticks + 1 if reason == self.reason else 0
        self.reason = reason
        self.largest_force = max(self.largest_force, math.hypot(*force))
        self.start_ns = now
        self.tick += 1
        self.own.heartbeat(self.tick)

    def publish_health(self, now, schedule, incompatible):
        watch = self.watch
        state = INCOMPATIBLE if incompatible and watch.state == ABSENT else watch.state
        retries, rejected = self.retries, self.rejected
        if self.reader is not None:
            retries, rejected = retries + self.reader.retries, rejected + self.reader.rejected
        for index, value in enumerate((schedule.missed, 0, retries, rejected)):
            self.own.count(index, value)
        self.healths.publish(HAPTIC_HEALTH_MESSAGE.new(
            ticks=self.tick, worst_missed_in_a_row=schedule.worst_in_a_row, reason_ticks=self.reason_ticks,
            reason=self.reason, peer_state=state,
            peer_epoch=self.reader.view.epoch if self.reader and watch.state != ABSENT else 0,
            feature_age_ns=max(0, now - watch.frame_ns) if self.shown_epoch else 0,
            zero_force_after_ns=watch.lost_after_period(watch.stated_period_ns) +
            round((FADE + CAP / SLEW_LIMIT) * 1e9) + 3 * self.period_ns, largest_force=self.largest_force, largest_force_step=self.largest_step,
            slew_limit=SLEW_LIMIT, target=self.finger.wanted(), device=b"peer.py",
            **{f"books.{name}": units for name, units in self.ledger.books.items()}, **schedule.health()))

    def stop(self):
        """The last tick displays zero force (5.6-4)."""
        now = now_ns()
        self.ledger.book([0.0] * 3, [], self.finger.position, (now - self.start_ns) * 1e-9)
        self.publish(now, now - self.start_ns, [0.0] * 3, STOPPED)


def run_haptic(arguments):
    period_ns = round(1e9 / arguments.rate)
    slots = 4 * (PeerWatch.LONGEST_PERIOD_NS + period_ns) // period_ns  # 6.1
    own = OwnSegment(arguments.instance, HAPTIC,
                     [(HAPTIC_TICK, HAPTIC_TICK.largest(), 1 << max(2, (slots - 1).bit_length()), period_ns),
                      (HAPTIC_HEALTH_MESSAGE, HAPTIC_HEALTH_MESSAGE.largest(), 4, 100_000_000)])
    side = HapticSide(own, period_ns, arguments.target)
    link = Link(arguments.instance, WORLD, [WORLD_FRAME])
    schedule, stop = Schedule(period_ns), Stop(arguments.seconds)
    health_ns = 0
    say(f"haptic side of instance '{arguments.instance}', {arguments.rate:g} Hz, epoch {own.epoch}")
    gc.collect()
    gc.freeze()
    gc.disable()  # nothing here is cyclic
    while not stop:
        now = schedule.wait()
        side.step(now, link, schedule)
        if now - health_ns >= 100_000_000:
            health_ns = now
            side.publish_health(now, schedule, link.incompatible)
        schedule.duration.note(now_ns() - now)
    side.stop()
    side.publish_health(now_ns(), schedule, link.incompatible)
    own.close()
    link.stop()


# ------------------------------------------------------------------------------------------------------
# For the tests


def run_codec(arguments):
    """Each message of the file: type, used_bytes, blocks, length (u32 each), payload. For each the answer:
    1 if it is sound, used_bytes, blocks, length, payload as encoded here; else four zeros. Type 0 is a
    segment's header, with the object's size and the role in place of used_bytes and blocks."""
    with open(arguments.messages, "rb") as file:
        data = file.read()
    at = 0
    with open(arguments.answers, "wb") as answers:
        while at < len(data):
            type_id, used, bits, length = struct.unpack_from("<4I", data, at)
            at += 16
            content = data[at:at + length]
            payload, encoded_bits = b"", 0
            try:
                if type_id == 0:
                    check_header(content, used, bits)
                else:
                    message = MESSAGES[type_id]
                    payload, encoded_bits = message.encode(message.decode(content, used, bits))
                answers.write(struct.pack("<4I", 1, len(payload), encoded_bits, len(payload)) + payload)
            except (Nonsense, Incompatible):
                answers.write(struct.pack("<4I", 0, 0, 0, 0))
            at += length


def run_layout(_):
    """The records of this program in the words of layout.golden.txt."""
    for message in MESSAGES.values():
        for record in message.records():
            sys.stdout.writelines(record.layout())


# ------------------------------------------------------------------------------------------------------


def vector(text):
    values = [float(part) for part in text.split(",")]
    if len(values) != 3 or not all(map(math.isfinite, values)):
        raise argparse.ArgumentTypeError("three numbers x,y,z")
    return values


def rate(most):
    def parse(text):
        value = float(text)
        if not 1 <= value <= most:
            raise argparse.ArgumentTypeError(f"1 to {most} Hz")
        return value
    return parse


def amount(text):
    value = float(text)
    if not (math.isfinite(value) and value >= 0):
        raise argparse.ArgumentTypeError("a number, not negative")
    return value


class Parser(argparse.ArgumentParser):
    def error(self, message):
        self.print_usage(sys.stderr)
        self.exit(USAGE, f"peer.py: {message}\n")


def main():
    parser = Parser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    world = commands.add_parser("world")
    world.add_argument("--rate", type=rate(200), default=20.0, metavar="HZ")
    world.add_argument("--mass", type=amount, default=0.0, metavar="KG", help="0: the box is fixed")
    world.add_argument("--drag", type=amount, default=2.0, metavar="NS/M", help="what slows the block")
    world.set_defaults(run=run_world)
    haptic = commands.add_parser("haptic")
    haptic.add_argument("--rate", type=rate(1000), default=500.0, metavar="HZ")
    haptic.set_defaults(run=run_haptic)
    for side in (world, haptic):
        side.add_argument("--instance", default="0")
        side.add_argument("--seconds", type=amount, default=0.0, help="0: until SIGTERM")
        side.add_argument("--target", type=vector, default=[0.0, 0.0, 0.0], metavar="X,Y,Z", help="m")
    codec = commands.add_parser("codec")
    codec.add_argument("messages")
    codec.add_argument("answers")
    codec.set_defaults(run=run_codec)
    commands.add_parser("layout").set_defaults(run=run_layout)
    # --target -0.1,0,0 would look like an option.
    words = []
    for word in sys.argv[1:]:
        if words and words[-1] == "--target":
            words[-1] += "=" + word
        else:
            words.append(word)
    arguments = parser.parse_args(words)
    if platform.machine() != "x86_64" or platform.python_implementation() != "CPython":
        raise Refusal(USAGE, "this is no CPython on x86-64: nothing promises its memory order (see --help)")
    arguments.run(arguments)


if __name__ == "__main__":
    try:
        main()
    except Refusal as refusal:
        say(str(refusal))
        sys.exit(refusal.status)
