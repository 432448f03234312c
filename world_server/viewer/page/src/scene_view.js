// SPDX-License-Identifier: MIT
// The bodies of the scene, instanced: one draw call for all colliders that look alike.
import * as THREE from "three";
import { bodyKey } from "./decode.js";
import { poseAt } from "./interpolation.js";
import { palette } from "./palette.js";
import { geometryOf, isGround, shapeKey } from "./shapes.js";

const ONE = new THREE.Vector3(1, 1, 1);
const UNPAINTED = [0.7, 0.7, 0.7, 1]; // the protocol's default colour: the page chooses

function poseMatrix({ position, orientation: [w, x, y, z] }) {
  return new THREE.Matrix4().compose(new THREE.Vector3(...position), new THREE.Quaternion(x, y, z, w), ONE);
}

export class SceneView {
  /** @param {function(string)} complain is told what cannot be drawn, and why */
  constructor(complain) {
    this.group = new THREE.Group();
    this.bodies = new Map(); // by bodyKey: {name, fixed, parts, shown: {position, orientation}}
    this.#complain = complain;
  }
  #complain;
  #generation = 0;

  /** Takes another scene; `scene` as the scene message has it. */
  setScene(scene) {
    this.scene = scene;
    this.clear();
    const alike = new Map();
    for (const body of scene.bodies) {
      const shown = {
        name: body.name,
        fixed: body.fixed,
        parts: [],
        position: new THREE.Vector3(NaN, NaN, NaN),
        orientation: new THREE.Quaternion(),
      };
      this.bodies.set(bodyKey(body.body, body.generation), shown);
      for (const collider of body.shapes) {
        const key = `${shapeKey(collider, body.fixed)} ${body.fixed} ${collider.colour}`;
        if (!alike.has(key)) alike.set(key, { collider, fixed: body.fixed, members: [] });
        alike.get(key).members.push({ shown, local: poseMatrix(collider) });
      }
    }
    for (const kind of alike.values()) this.#build(kind, this.#generation);
    if (scene.name === "push") this.group.add(stripes());
  }

  clear() {
    ++this.#generation;
    this.bodies.clear();
    this.group.traverse(({ geometry, material }) => {
      geometry?.dispose();
      material?.dispose();
    });
    this.group.clear();
  }

  async #build({ collider, fixed, members }, generation) {
    let geometry;
    try {
      geometry = await geometryOf(collider, fixed);
    } catch (error) {
      this.#complain(error.message);
      return;
    }
    if (generation !== this.#generation) return; // another scene came meanwhile
    const painted = collider.colour.some((value, i) => value !== UNPAINTED[i]);
    const [red, green, blue, alpha] = collider.colour;
    // The ground fills the picture and has one normal: light need not be computed for each pixel.
    const Material = isGround(collider) ? THREE.MeshBasicMaterial : THREE.MeshLambertMaterial;
    const material = new Material({
      color: painted ? new THREE.Color(red, green, blue) : palette()[fixed ? "fixed" : "moving"],
      transparent: alpha < 1,
      opacity: alpha,
      side: isGround(collider) || collider.mesh ? THREE.DoubleSide : THREE.FrontSide,
      polygonOffset: isGround(collider),
      polygonOffsetFactor: 1,
      polygonOffsetUnits: 1,
    });
    const mesh = new THREE.InstancedMesh(geometry, material, members.length);
    mesh.frustumCulled = false;
    mesh.userData.theme = painted ? null : fixed ? "fixed" : "moving";
    members.forEach(({ shown, local }, i) => {
      shown.parts.push({ mesh, i, local });
      shown.position.x = NaN; // to be placed anew
      mesh.setMatrixAt(i, new THREE.Matrix4().makeScale(0, 0, 0)); // not before its pose is known
    });
    this.group.add(mesh);
  }

  setTheme() {
    this.group.traverse(({ material, userData }) => {
      if (userData.theme) material.color.set(palette()[userData.theme]);
    });
  }

  /** Puts every body where it is at a moment (interpolation.js). */
  show(moment) {
    for (const [key, shown] of this.bodies) {
      if (!poseAt(moment, key, position, orientation)) continue;
      if (shown.position.equals(position) && shown.orientation.equals(orientation)) continue;
      shown.position.copy(position);
      shown.orientation.copy(orientation);
      pose.compose(position, orientation, ONE);
      for (const { mesh, i, local } of shown.parts) {
        mesh.setMatrixAt(i, placed.multiplyMatrices(pose, local));
        mesh.instanceMatrix.needsUpdate = true;
      }
    }
  }
}

const position = new THREE.Vector3();
const orientation = new THREE.Quaternion();
const pose = new THREE.Matrix4();
const placed = new THREE.Matrix4();

/** The floor of the push task: a stripe every 5 cm from where the cube starts, the goal at 30 cm. */
function stripes() {
  const group = new THREE.Group();
  for (let i = 0; i <= 8; ++i) {
    const goal = i === 6;
    const stripe = new THREE.Mesh(
      new THREE.PlaneGeometry(goal ? 0.006 : 0.004, 0.3),
      new THREE.MeshBasicMaterial({ color: palette()[goal ? "mark" : "stripe"] }),
    );
    stripe.position.set(0.05 * i, 0, -0.0298);
    stripe.userData.theme = goal ? "mark" : "stripe";
    group.add(stripe);
  }
  return group;
}
