// SPDX-License-Identifier: MIT
// The page: hears the live stream, remembers the last 30 s, draws the moment that the clock says.
import * as THREE from "three";
import { Camera } from "./camera.js";
import { Charts } from "./charts.js";
import { connect } from "./connection.js";
import { ContactView, penetration, planesAt, pointersOf } from "./contact_view.js";
import { TICK } from "./decode.js";
import { csv, save } from "./export.js";
import { Frames, Ticks } from "./history.js";
import { bracket, poseAt } from "./interpolation.js";
import { onThemeChange, palette } from "./palette.js";
import { SceneView } from "./scene_view.js";
import { facts, warning } from "./status.js";
import { ViewClock } from "./view_clock.js";

const CHARTS_EVERY_MS = 66;
const TEXT_EVERY_MS = 200;

const byId = (id) => document.getElementById(id);
const ticks = new Ticks();
const frames = new Frames();
const clock = new ViewClock();
const sceneView = new SceneView((why) => (byId("complaint").textContent = why));
const contactView = new ContactView();
const charts = new Charts(byId("charts"));
const shown = { planes: true, ghosts: true };
let connected = false;
let head = null; // of the newest update
let picture = null; // what was drawn last; see window.rikiseki

const canvas = byId("view");
const scene = new THREE.Scene();
const renderer = makeRenderer();
const camera = new Camera(canvas);
scene.add(sceneView.group, contactView.group);
scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8378, 2));
const lamp = new THREE.DirectionalLight(0xffffff, 1.6);
lamp.position.set(-0.6, -0.4, 1);
scene.add(lamp);
setTheme();
onThemeChange(setTheme);

// Smooth edges cost a processor that has to draw by itself three quarters of its pictures.
function makeRenderer() {
  const probe = document.createElement("canvas").getContext("webgl2");
  const info = probe?.getExtension("WEBGL_debug_renderer_info");
  const name = info ? probe.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
  const software = /swiftshader|llvmpipe|software/i.test(name);
  probe?.getExtension("WEBGL_lose_context")?.loseContext();
  const made = new THREE.WebGLRenderer({ canvas, antialias: !software });
  made.setPixelRatio(software ? 1 : Math.min(devicePixelRatio, 2));
  return made;
}

function setTheme() {
  scene.background = new THREE.Color(palette().background);
  sceneView.setTheme();
  contactView.setTheme();
}

function resize() {
  const { clientWidth: width, clientHeight: height } = canvas.parentElement;
  if (width === 0 || height === 0) return;
  renderer.setSize(width, height, false);
  camera.setAspect(width / height);
}
new ResizeObserver(resize).observe(canvas.parentElement);
resize();

const norm = (v) => (v ? Math.hypot(...v) : 0);

connect({
  onState(on) {
    connected = on;
    showWarning();
  },
  onScene(message) {
    byId("complaint").textContent = "";
    sceneView.setScene(message);
    contactView.forget();
  },
  onUpdate(update) {
    head = update.head;
    clock.hear(head.now_ns);
    ticks.append(update.ticks, update.stride, norm(head.haptic.displayed), norm(head.haptic.received));
    head.frames.forEach((told, i) => frames.append(head.world.epoch, told, update.bodies[i]));
    if (head.frames.length > 0) contactView.hearImpulses(head.contacts, frames.list.at(-1).state);
  },
});

/** Penetrations up to the moment shown: only now the planes are known for them. */
let measured = 0;
function measurePenetration(last) {
  for (measured = Math.max(measured, ticks.first); measured <= last; ++measured) {
    const moment = bracket(frames, ticks.at(measured, TICK.start), true);
    if (!moment?.b) continue; // where the bodies were then is not known
    const planes = planesAt(moment);
    let deepest = 0;
    for (const { pointer, radius, position } of pointersOf(ticks, measured)) {
      deepest = Math.max(deepest, penetration(planes, pointer, radius, position));
    }
    ticks.setPenetration(measured, deepest);
  }
}

const paces = { count: 0, since: performance.now(), fps: 0 };
let chartsDrawn = 0;
let textsShown = 0;

function draw(at) {
  requestAnimationFrame(draw);
  const time = clock.advance(frames.list.at(-1)?.period ?? 0, at);
  const moment = bracket(frames, time, clock.interpolate);
  const last = ticks.indexAt(time);
  const pointers = last >= ticks.first ? pointersOf(ticks, last) : [];
  if (moment) sceneView.show(moment);
  const contacts = contactView.show(moment, pointers, time, shown, sceneView);
  camera.update(pointers[0]?.position ?? null);
  renderer.render(scene, camera.camera);
  picture = { time, moment, pointers, ...contacts, tick: pointers.length > 0 ? ticks.at(last, TICK.tick) : -1 };

  ++paces.count;
  if (at - paces.since >= 1000) {
    Object.assign(paces, { fps: (1e3 * paces.count) / (at - paces.since), count: 0, since: at });
  }
  if (at - chartsDrawn >= CHARTS_EVERY_MS) {
    chartsDrawn = at;
    measurePenetration(ticks.indexAt(Math.min(clock.live(at), frames.list.at(-1)?.state ?? 0)));
    charts.draw(ticks, time, head?.haptic.period_ns ?? 1e6);
  }
  if (at - textsShown >= TEXT_EVERY_MS) {
    textsShown = at;
    showWarning();
    byId("facts").textContent = facts(head, paces.fps, (clock.present(at) - time) * 1e-6);
  }
}
requestAnimationFrame(draw);

function showWarning() {
  const found = warning(connected, head);
  const banner = byId("banner");
  const text = found?.text ?? "";
  if (banner.textContent !== text) banner.textContent = text;
  banner.hidden = !found;
  banner.className = found?.level ?? "";
}

// ---------------------------------------------------------------------------------------------------
// What the user can do: a button and a key each.

function oldest() {
  return Math.max(frames.list[0]?.state ?? 0, 0);
}
function stepFrame(direction) {
  const time = clock.paused ?? clock.live();
  const column = clock.interpolate ? "state" : "stamp";
  const i = frames.indexAt(direction > 0 ? time : time - 1, column) + (direction > 0 ? 1 : 0);
  const frame = frames.list[Math.min(Math.max(i, 0), frames.list.length - 1)];
  if (frame) clock.stepBy(frame[column] - time, oldest());
}

const actions = {
  pause: () => clock.togglePause(),
  back: () => stepFrame(-1),
  forward: () => stepFrame(1),
  back_second: () => clock.stepBy(-1e9, oldest()),
  forward_second: () => clock.stepBy(1e9, oldest()),
  interpolate: () => clock.setInterpolate(!clock.interpolate),
  follow: () => (camera.follow = !camera.follow),
  home: () => camera.home(),
  planes: () => (shown.planes = !shown.planes),
  ghosts: () => (shown.ghosts = !shown.ghosts),
  screenshot: () => {
    renderer.render(scene, camera.camera); // the buffer is kept only until the picture is shown
    canvas.toBlob((blob) => save(blob, "rikiseki.png"));
  },
  csv: () => save(new Blob([windowCsv()], { type: "text/csv" }), "rikiseki.csv"),
  keys: () => (byId("keys").open = !byId("keys").open),
};
const KEYS = {
  " ": "pause", ArrowLeft: "back", ArrowRight: "forward", "Shift+ArrowLeft": "back_second",
  "Shift+ArrowRight": "forward_second", i: "interpolate", f: "follow", h: "home", p: "planes", g: "ghosts",
  s: "screenshot", c: "csv", "?": "keys",
};
const TURNS = {
  a: [-0.1, 0, 1], d: [0.1, 0, 1], w: [0, -0.1, 1], x: [0, 0.1, 1], "+": [0, 0, 0.9], "-": [0, 0, 1.1],
};

function windowCsv() {
  return csv(ticks, clock.paused ?? clock.live(), head?.haptic.period_ns ?? 1e6);
}

function act(name) {
  actions[name]();
  const pressed = { pause: clock.paused !== null, interpolate: clock.interpolate, follow: camera.follow, ...shown };
  for (const button of document.querySelectorAll("button[data-action]")) {
    if (button.dataset.action in pressed) button.setAttribute("aria-pressed", pressed[button.dataset.action]);
  }
}

for (const button of document.querySelectorAll("button[data-action]")) {
  button.addEventListener("click", () => act(button.dataset.action));
}
addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  // A focused button keeps its space and enter.
  if (event.target instanceof HTMLButtonElement && (event.key === " " || event.key === "Enter")) return;
  const key = (event.shiftKey && event.key.startsWith("Arrow") ? "Shift+" : "") + event.key;
  if (key in KEYS) act(KEYS[key]);
  else if (event.key in TURNS) camera.turn(...TURNS[event.key]);
  else return;
  event.preventDefault();
});

// ---------------------------------------------------------------------------------------------------
// For scripts and tests: what the page shows, in numbers.

window.rikiseki = {
  act,
  csv: windowCsv,
  /** The picture drawn last. Times in ns of the daemons' clock, positions in m, forces in N. */
  picture: () => ({
    connected,
    time: picture?.time ?? 0,
    now: head?.now_ns ?? 0,
    paused: clock.paused !== null,
    interpolate: clock.interpolate,
    fps: paces.fps,
    tick: picture?.tick ?? -1,
    frame: picture?.moment?.a.number ?? 0,
    frames: frames.list.length,
    oldest: oldest(),
    ticks: ticks.end,
    bodies: [...sceneView.bodies.values()].map(({ name, fixed, position, orientation, parts }) => ({
      name,
      fixed,
      drawn: parts.length,
      position: position.toArray(),
      orientation: orientation.toArray(),
    })),
    fingers: (picture?.pointers ?? []).map(({ position, force }, i) => ({
      position: position.toArray(),
      force: force.toArray(),
      proxy: picture.proxies[i].toArray(),
    })),
    planes: (picture?.planes ?? []).map(({ point, normal }) => ({ point: point.toArray(), normal: normal.toArray() })),
    drawn: {
      planes: contactView.planes.children.filter((one) => one.visible).length,
      arrows: contactView.arrows.children.filter((one) => one.visible).length,
      flashes: contactView.flashes.children.filter((one) => one.visible).length,
      ghosts: contactView.ghosts.children.filter((one) => one.visible).length,
    },
    banner: byId("banner").hidden ? "" : byId("banner").textContent,
    complaint: byId("complaint").textContent,
  }),
  /** A body along x over all remembered frames, every `step` ns, interpolated or raw: [frame before, x]. */
  sweep: (place, interpolate, step) => {
    const key = [...sceneView.bodies.keys()][place];
    const at = new THREE.Vector3();
    const way = [];
    for (let time = oldest(); time <= frames.list.at(-1).state; time += step) {
      const moment = bracket(frames, time, interpolate);
      if (poseAt(moment, key, at, new THREE.Quaternion())) way.push([moment.a.number, at.x]);
    }
    return way;
  },
  /** The world's frames that are remembered: [{number, stamp, state, bodies}] with [x, y, z] by body. */
  frames: () =>
    frames.list.map(({ number, stamp, state, bodies, rows }) => ({
      number,
      stamp,
      state,
      bodies: [...sceneView.bodies.keys()].map((key) => {
        const row = rows.get(key);
        return row === undefined ? null : [...bodies.slice(row + 2, row + 5)];
      }),
    })),
};
