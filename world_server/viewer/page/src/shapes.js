// SPDX-License-Identifier: MIT
// Geometries of the scene's colliders. Dimensions as SPEC.md 6.5 gives them; z of the collider is up.
import * as THREE from "three";
import { ConvexGeometry } from "three/addons/geometries/ConvexGeometry.js";
import { ColladaLoader } from "three/addons/loaders/ColladaLoader.js";
import { OBJLoader } from "three/addons/loaders/OBJLoader.js";
import { STLLoader } from "three/addons/loaders/STLLoader.js";

const SHAPE = { box: 1, sphere: 2, halfSpace: 3, cylinder: 4, capsule: 5, ellipsoid: 6, mesh: 7 };
const GROUND = 4; // m, edge of the piece of a half-space that is drawn

/** Shapes that look alike have equal keys. */
export function shapeKey({ shape, dimensions, mesh }, fixed) {
  return [shape, ...dimensions, mesh ? `${mesh.name}${fixed}` : ""].join(" ");
}

/**
 * @param {Object} collider as the scene message has it, without its pose
 * @param {boolean} fixed a mesh that moves is its convex hull, as in the world
 * @return {Promise<THREE.BufferGeometry>} rejects for a mesh that cannot be had
 */
export async function geometryOf(collider, fixed) {
  const [x, y, z] = collider.dimensions;
  switch (collider.shape) {
    case SHAPE.box:
      return new THREE.BoxGeometry(2 * x, 2 * y, 2 * z);
    case SHAPE.sphere:
      return new THREE.SphereGeometry(x, 24, 16);
    case SHAPE.halfSpace:
      return ground(new THREE.Vector3(x, y, z));
    case SHAPE.cylinder:
      return new THREE.CylinderGeometry(x, x, 2 * y, 32).rotateX(Math.PI / 2);
    case SHAPE.capsule:
      return new THREE.CapsuleGeometry(x, 2 * y, 8, 24).rotateX(Math.PI / 2);
    case SHAPE.ellipsoid:
      return new THREE.SphereGeometry(1, 24, 16).scale(x, y, z);
    case SHAPE.mesh:
      return (await meshGeometry(collider.mesh, fixed)).scale(x, y, z);
    default:
      throw new Error(`shape ${collider.shape} is unknown to this page`);
  }
}

export function isGround(collider) {
  return collider.shape === SHAPE.halfSpace;
}

function ground(normal) {
  const turn = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 0, 1), normal);
  return new THREE.PlaneGeometry(GROUND, GROUND).applyQuaternion(turn);
}

async function meshGeometry({ name, format }, fixed) {
  const response = await fetch(`/mesh/${name}`);
  if (!response.ok) throw new Error(await response.text());
  const bytes = await response.arrayBuffer();
  const text = () => new TextDecoder().decode(bytes);
  const parsed = {
    ".stl": () => new THREE.Mesh(new STLLoader().parse(bytes)),
    ".obj": () => new OBJLoader().parse(text()),
    ".dae": () => new ColladaLoader().parse(text(), "").scene,
  }[format.toLowerCase()];
  if (!parsed) throw new Error(`a mesh of format ${format} is unknown to this page`);
  const corners = cornersOf(parsed());
  if (!fixed) return new ConvexGeometry(corners);
  const geometry = new THREE.BufferGeometry().setFromPoints(corners);
  geometry.computeVertexNormals();
  return geometry;
}

/** Three for each triangle, in metres where the file knows its unit, along the file's axes. */
function cornersOf(root) {
  const corners = [];
  root.quaternion.identity(); // ColladaLoader turns what is up; the world does not
  root.updateMatrixWorld(true);
  root.traverse((part) => {
    if (!part.isMesh) return;
    const flat = part.geometry.index ? part.geometry.toNonIndexed() : part.geometry;
    const positions = flat.getAttribute("position");
    for (let i = 0; i < positions.count; ++i) {
      corners.push(new THREE.Vector3().fromBufferAttribute(positions, i).applyMatrix4(part.matrixWorld));
    }
  });
  return corners;
}
