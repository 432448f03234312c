// SPDX-License-Identifier: MIT
// The camera: free (mouse, touch, keys), or following the finger.
import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const HOME = new THREE.Vector3(-0.22, -0.5, 0.34);
const HOME_TARGET = new THREE.Vector3(0.1, 0, 0);

export class Camera {
  constructor(element) {
    this.camera = new THREE.PerspectiveCamera(45, 1, 0.01, 50);
    this.camera.up.set(0, 0, 1);
    this.#controls = new OrbitControls(this.camera, element);
    this.#controls.maxDistance = 10;
    this.#controls.minDistance = 0.03;
    this.follow = false;
    this.home();
  }
  #controls;
  #followed = null;

  home() {
    this.camera.position.copy(HOME);
    this.#controls.target.copy(HOME_TARGET);
    this.#controls.update();
  }

  /** Turns round the target by angles [rad], and goes nearer or farther by a factor. */
  turn(azimuth, elevation, factor) {
    const arm = this.camera.position.clone().sub(this.#controls.target);
    const round = new THREE.Spherical().setFromVector3(new THREE.Vector3(arm.x, arm.z, -arm.y));
    round.theta += azimuth;
    round.phi = Math.min(Math.max(round.phi + elevation, 0.05), Math.PI - 0.05);
    round.radius *= factor;
    const turned = new THREE.Vector3().setFromSpherical(round);
    this.camera.position.copy(this.#controls.target).add(new THREE.Vector3(turned.x, -turned.z, turned.y));
    this.#controls.update();
  }

  /** Before each picture; `finger` a position, or null. */
  update(finger) {
    if (this.follow && finger) {
      if (this.#followed) {
        const way = finger.clone().sub(this.#followed);
        this.camera.position.add(way);
        this.#controls.target.add(way);
      } else {
        this.#controls.target.copy(finger);
      }
      this.#controls.update();
    }
    this.#followed = this.follow && finger ? finger.clone() : null;
  }

  setAspect(aspect) {
    this.camera.aspect = aspect;
    this.camera.updateProjectionMatrix();
  }
}
