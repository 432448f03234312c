// SPDX-License-Identifier: MIT
// What the finger meets: the finger, its proxy on the surface, the contact planes as patches that ride
// on their bodies, the displayed force, flashes where impulses arrive, ghosts of the local copies.
import * as THREE from "three";
import { POINTER, POINTER_NUMBERS, TICK_NUMBERS, bodyKey } from "./decode.js";
import { poseAt } from "./interpolation.js";
import { palette } from "./palette.js";

const PATCH = 0.06; // m, edge of a plane's patch
const METRES_PER_NEWTON = 0.02;
const FLASH_NS = 300e6;
const MOST_POINTERS = 4;
const MOST_PLANES = 32;
const PROJECTIONS = 30;

/** Grows a group's children to `count`, shows so many, hides the rest. */
function pool(group, count, make) {
  while (group.children.length < count) group.add(make());
  group.children.forEach((child, i) => (child.visible = i < count));
}

function material(theme, options = {}) {
  const made = new THREE.MeshLambertMaterial({ color: palette()[theme], ...options });
  made.userData.theme = theme;
  return made;
}

/** The planes of a moment in W, as {pointer, point, normal}: fixed to their bodies, which move. */
export function planesAt(moment) {
  const own = { a: moment.a, b: null, s: 0, duration: 0 };
  return moment.a.planes.slice(0, MOST_PLANES).map(({ pointer, body, generation, point, normal }) => {
    const p = new THREE.Vector3(...point);
    const n = new THREE.Vector3(...normal);
    const key = bodyKey(body, generation);
    if (poseAt(own, key, then.position, then.orientation) &&
        poseAt(moment, key, now.position, now.orientation)) {
      const turn = now.orientation.clone().multiply(then.orientation.conjugate());
      p.sub(then.position).applyQuaternion(turn).add(now.position);
      n.applyQuaternion(turn);
    }
    return { pointer, point: p, normal: n };
  });
}
const then = { position: new THREE.Vector3(), orientation: new THREE.Quaternion() };
const now = { position: new THREE.Vector3(), orientation: new THREE.Quaternion() };

/** How deep a finger is in the deepest of its planes, m; 0 outside. */
export function penetration(planes, pointer, radius, position) {
  let deepest = 0;
  for (const { pointer: whose, point, normal } of planes) {
    if (whose !== pointer) continue;
    deepest = Math.max(deepest, radius - position.clone().sub(point).dot(normal));
  }
  return deepest;
}

/** The point nearest to the finger's centre at which it would touch no plane (Dykstra's projections). */
export function proxyOf(planes, pointer, radius, position) {
  const own = planes.filter((plane) => plane.pointer === pointer);
  const proxy = position.clone();
  const pushed = own.map(() => 0);
  for (let i = 0; i < PROJECTIONS; ++i) {
    own.forEach(({ point, normal }, k) => {
      proxy.addScaledVector(normal, -pushed[k]);
      pushed[k] = Math.max(0, radius - proxy.clone().sub(point).dot(normal));
      proxy.addScaledVector(normal, pushed[k]);
    });
  }
  return proxy;
}

/** The pointers in row i of the ticks: [{pointer, reason, radius, position, force}]. */
export function pointersOf(ticks, i) {
  const found = [];
  for (let p = 0; p < ticks.pointers; ++p) {
    const from = TICK_NUMBERS + p * POINTER_NUMBERS;
    const at = (column) => ticks.at(i, from + column);
    if (!(at(POINTER.radius) > 0)) continue;
    const vector = (column) => new THREE.Vector3(at(column), at(column + 1), at(column + 2));
    found.push({
      pointer: at(POINTER.number),
      reason: at(POINTER.reason),
      radius: at(POINTER.radius),
      position: vector(POINTER.position),
      force: vector(POINTER.force),
    });
  }
  return found;
}

export class ContactView {
  constructor() {
    this.group = new THREE.Group();
    this.fingers = new THREE.Group();
    this.proxies = new THREE.Group();
    this.arrows = new THREE.Group();
    this.planes = new THREE.Group();
    this.flashes = new THREE.Group();
    this.ghosts = new THREE.Group();
    this.group.add(this.fingers, this.proxies, this.arrows, this.planes, this.flashes, this.ghosts);
    this.#finger = material("finger", { transparent: true, opacity: 0.85 });
    this.#proxy = material("proxy");
    this.#plane = material("plane", { transparent: true, opacity: 0.3, side: THREE.DoubleSide, depthWrite: false });
    this.#force = material("force", { depthTest: false });
    this.#ghost = new THREE.MeshBasicMaterial({ color: palette().ghost, wireframe: true, transparent: true, opacity: 0.6 });
    this.#ghost.userData.theme = "ghost";
    this.#sphere = new THREE.SphereGeometry(1, 24, 16);
    this.#patch = new THREE.PlaneGeometry(PATCH, PATCH);
    this.#impulses = new Map();
    this.#lit = [];
  }
  #finger;
  #proxy;
  #plane;
  #force;
  #ghost;
  #sphere;
  #patch;
  #impulses; // of the channels, by body and pointer, at the frame before
  #lit; // flashes that still shine: {time, point, size}

  setTheme() {
    for (const one of [this.#finger, this.#proxy, this.#plane, this.#force, this.#ghost]) {
      one.color.set(palette()[one.userData.theme]);
    }
  }

  /** A frame arrived: what the channels grew by since the frame before flashes where it acted. */
  hearImpulses(contacts, time) {
    for (const { body, generation, pointer, point, impulse } of contacts) {
      const key = `${bodyKey(body, generation)} ${pointer}`;
      const total = new THREE.Vector3(...impulse);
      const grown = total.distanceTo(this.#impulses.get(key) ?? total);
      this.#impulses.set(key, total);
      if (grown > 1e-4) this.#lit.push({ time, point, size: 0.006 + 0.012 * Math.sqrt(grown) });
    }
    while (this.#lit.length > 1000) this.#lit.shift();
  }

  forget() {
    this.#impulses.clear();
    this.#lit = [];
  }

  /**
   * @param {Object} moment of the world (interpolation.js), or null
   * @param {Array} pointers of pointersOf
   * @param {number} time ns, that is shown
   * @param {{planes: boolean, ghosts: boolean}} wanted
   * @return {{planes: Array, proxies: Array}} as drawn
   */
  show(moment, pointers, time, wanted, sceneView) {
    const planes = moment ? planesAt(moment) : [];
    const shownPointers = pointers.slice(0, MOST_POINTERS);
    const proxies = shownPointers.map((one) => proxyOf(planes, one.pointer, one.radius, one.position));
    pool(this.fingers, shownPointers.length, () => new THREE.Mesh(this.#sphere, this.#finger));
    pool(this.proxies, shownPointers.length, () => new THREE.Mesh(this.#sphere, this.#proxy));
    pool(this.arrows, shownPointers.length, () => arrow(this.#force));
    shownPointers.forEach(({ position, radius, force }, i) => {
      this.fingers.children[i].position.copy(position);
      this.fingers.children[i].scale.setScalar(radius);
      this.proxies.children[i].position.copy(proxies[i]);
      this.proxies.children[i].scale.setScalar(radius / 4);
      aim(this.arrows.children[i], position, force);
    });
    pool(this.planes, wanted.planes ? planes.length : 0, () => new THREE.Mesh(this.#patch, this.#plane));
    if (wanted.planes) {
      planes.forEach(({ point, normal }, i) => {
        this.planes.children[i].position.copy(point).addScaledVector(normal, 3e-4);
        this.planes.children[i].quaternion.setFromUnitVectors(UP, normal);
      });
    }
    this.#showFlashes(time);
    this.#showGhosts(wanted.ghosts && moment ? (moment.b ?? moment.a) : null, time, sceneView);
    return { planes, proxies };
  }

  #showFlashes(time) {
    const shining = this.#lit.filter((flash) => time >= flash.time && time - flash.time < FLASH_NS);
    pool(this.flashes, shining.length, () => {
      const own = new THREE.MeshBasicMaterial({ transparent: true, depthWrite: false });
      return new THREE.Mesh(this.#sphere, own);
    });
    shining.forEach(({ time: lit, point, size }, i) => {
      const flash = this.flashes.children[i];
      const faded = (time - lit) / FLASH_NS;
      flash.position.set(...point);
      flash.scale.setScalar(size * (1 + faded));
      flash.material.color.set(palette().flash);
      flash.material.opacity = 0.7 * (1 - faded);
    });
  }

  // A copy is where its frame says, moved on by its velocity to the moment shown.
  #showGhosts(frame, time, sceneView) {
    const meshes = [];
    for (const copy of frame?.copies ?? []) {
      const body = sceneView.bodies.get(bodyKey(copy.body, copy.generation));
      if (!body) continue;
      const [w, x, y, z] = copy.orientation;
      const seconds = (time - frame.state) * 1e-9;
      at.set(...copy.position).addScaledVector(velocity.set(...copy.velocity), seconds);
      pose.compose(at, turn.set(x, y, z, w), ONE);
      for (const part of body.parts) meshes.push({ geometry: part.mesh.geometry, matrix: pose.clone().multiply(part.local) });
    }
    pool(this.ghosts, meshes.length, () => {
      const ghost = new THREE.Mesh(this.#sphere, this.#ghost);
      ghost.matrixAutoUpdate = false;
      return ghost;
    });
    meshes.forEach(({ geometry, matrix }, i) => {
      this.ghosts.children[i].geometry = geometry;
      this.ghosts.children[i].matrix.copy(matrix);
    });
  }
}

const UP = new THREE.Vector3(0, 0, 1);
const ONE = new THREE.Vector3(1, 1, 1);
const at = new THREE.Vector3();
const velocity = new THREE.Vector3();
const turn = new THREE.Quaternion();
const pose = new THREE.Matrix4();

/** An arrow of length 1 along z. */
function arrow(one) {
  const group = new THREE.Group();
  const shaft = new THREE.Mesh(new THREE.CylinderGeometry(0.003, 0.003, 1, 12).rotateX(Math.PI / 2).translate(0, 0, 0.5), one);
  const head = new THREE.Mesh(new THREE.ConeGeometry(0.008, 0.024, 16).rotateX(Math.PI / 2), one);
  shaft.renderOrder = head.renderOrder = 1;
  group.add(shaft, head);
  return group;
}

function aim(group, from, force) {
  const newtons = force.length();
  group.visible &&= newtons > 1e-3;
  if (!group.visible) return;
  const length = newtons * METRES_PER_NEWTON;
  group.position.copy(from);
  group.quaternion.setFromUnitVectors(UP, force.clone().normalize());
  group.children[0].scale.z = length;
  group.children[1].position.z = length;
}
