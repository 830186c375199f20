// Shapes of scenes and targets as objects of the picture. Shared geometries and materials are created once.

import {
  BoxGeometry, BufferGeometry, Color, ConeGeometry, CylinderGeometry, Float32BufferAttribute, Group, Mesh, MeshBasicMaterial,
  MeshStandardMaterial, Quaternion, SphereGeometry, SRGBColorSpace, Vector3,
} from "three";
import { toCreasedNormals } from "three/addons/utils/BufferGeometryUtils.js";
import { CASTERS } from "./ground.js";
import { inStudio, surface } from "./surfaces.js";

/** Angle between two faces above which their common edge is sharp, rad. */
const CREASE = 0.6;
/** Maximum number of corners of a smoothed mesh; finer meshes look smooth. */
const MOST_CORNERS = 60_000;
/** Maximum number of cached materials. */
const MOST_MATERIALS = 200;
const GREY = { r: 0.6, g: 0.6, b: 0.6, a: 1 };

const upright = (geometry) => geometry.rotateX(Math.PI / 2);
const BOX = new BoxGeometry(1, 1, 1);
const SPHERE = new SphereGeometry(0.5, 24, 16);
const CYLINDER = upright(new CylinderGeometry(0.5, 0.5, 1, 40));
// along x, from the origin
const SHAFT = new CylinderGeometry(0.5, 0.5, 1, 12).rotateZ(-Math.PI / 2).translate(0.5, 0, 0);
const TIP = new ConeGeometry(0.5, 1, 20).rotateZ(-Math.PI / 2).translate(0.5, 0, 0);
const SHARED = new Set([BOX, SPHERE, CYLINDER, SHAFT, TIP]);
const materials = new Map();

function shared(key, make) {
  if (!materials.has(key)) {
    if (materials.size >= MOST_MATERIALS) materials.clear();
    materials.set(key, make());
  }
  return materials.get(key);
}

const vector = (v) => new Vector3(v?.x ?? 0, v?.y ?? 0, v?.z ?? 0);
const quaternion = (q) => (q ? new Quaternion(q.x, q.y, q.z, q.w) : new Quaternion());

/** Moves an object to a pose. */
export function placeAt(object, pose) {
  object.position.copy(vector(pose?.position));
  object.quaternion.copy(quaternion(pose?.orientation));
  return object;
}

/** Makes all opaque parts of an object cast and receive shadows. */
export function shadowed(object) {
  object.traverse((child) => {
    if (!child.isMesh) return;
    const opaque = ![child.material].flat().some(({ transparent }) => transparent);
    [child.castShadow, child.receiveShadow] = [opaque, true];
    if (opaque) child.layers.enable(CASTERS);
    else child.layers.disable(CASTERS);
  });
  return object;
}

/** Smooths the normals of a mesh without sharp edges, if it is small. */
export function smoothed(geometry) {
  const corners = geometry.index?.count ?? geometry.attributes.position.count;
  return corners > MOST_CORNERS ? geometry : toCreasedNormals(geometry, CREASE);
}

/** An arrow along x of this total length, m. */
function arrow({ shaftLength, shaftDiameter, headLength, headDiameter }, color) {
  const { r, g, b } = color ?? { r: 0.9, g: 0.2, b: 0.15 };
  const made = () => inStudio(new MeshStandardMaterial({ color: new Color().setRGB(r, g, b, SRGBColorSpace), roughness: 0.6 }));
  const material = shared(`arrow ${r} ${g} ${b}`, made);
  const [shaft, tip] = [new Mesh(SHAFT, material), new Mesh(TIP, material)];
  shaft.scale.set(Math.max(shaftLength, 1e-4), shaftDiameter || 0.3 * headDiameter, shaftDiameter || 0.3 * headDiameter);
  tip.scale.set(Math.max(headLength, 1e-4), headDiameter, headDiameter);
  tip.position.x = shaftLength;
  return new Group().add(shaft, tip);
}

/** The group that a scene entity of Foxglove draws. */
export function drawn(entity) {
  const group = new Group();
  const add = (geometry, { pose, color, size }, other) => {
    const { r, g, b, a } = color ?? GREY;
    const material = other ? surface({ r, g, b, a }, other) : shared(`${r} ${g} ${b} ${a}`, () => surface({ r, g, b, a }));
    const mesh = placeAt(new Mesh(geometry, material), pose);
    if (size && SHARED.has(geometry)) mesh.scale.set(size.x, size.y, size.z);
    group.add(mesh);
  };
  for (const cube of entity.cubes) add(BOX, cube);
  for (const sphere of entity.spheres) add(SPHERE, sphere);
  for (const cylinder of entity.cylinders) {
    const { topScale: top, bottomScale: bottom, size } = cylinder;
    if (top === 1 && bottom === 1) add(CYLINDER, cylinder);
    else add(upright(new CylinderGeometry(0.5 * top, 0.5 * bottom, 1, 40)).scale(size.x, size.y, size.z), cylinder);
  }
  for (const { pose, points, colors, indices, color } of entity.triangles) {
    let geometry = new BufferGeometry();
    geometry.setAttribute("position", new Float32BufferAttribute(points.flatMap(({ x, y, z }) => [x, y, z]), 3));
    const isColoured = colors.length > 0 && colors.length === points.length;
    const linear = ({ r, g, b }) => new Color().setRGB(r, g, b, SRGBColorSpace).toArray();
    if (isColoured) geometry.setAttribute("color", new Float32BufferAttribute(colors.flatMap(linear), 3));
    if (indices.length) geometry.setIndex(indices);
    geometry.computeVertexNormals();
    // Unshared corners belong to a body, not to a terrain.
    if (!indices.length || indices.length === points.length) geometry = smoothed(geometry);
    add(geometry, { pose, color: isColoured ? { r: 1, g: 1, b: 1, a: color?.a ?? 1 } : color }, { vertexColors: isColoured });
  }
  shadowed(group);
  for (const one of entity.arrows) group.add(placeAt(arrow(one, one.color), one.pose));
  return group;
}

/** Three axes, red, green and blue, 1 m long. */
export function axes() {
  const group = new Group();
  const turns = [[0, 0, 0], [0, 0, Math.PI / 2], [0, -Math.PI / 2, 0]];
  ["#e5484d", "#46a758", "#3e7bfa"].forEach((color, index) => {
    const material = shared(`axis ${color}`, () => new MeshBasicMaterial({ color, toneMapped: false }));
    const [shaft, tip] = [new Mesh(SHAFT, material), new Mesh(TIP, material)];
    shaft.scale.set(0.8, 0.045, 0.045);
    tip.scale.set(0.2, 0.12, 0.12);
    tip.position.x = 0.8;
    const one = new Group().add(shaft, tip);
    one.rotation.set(...turns[index]);
    group.add(one);
  });
  return group;
}

/** Removes an object and frees its unshared resources. */
export function dispose(object) {
  object.removeFromParent();
  object.traverse((child) => {
    if (!child.geometry || SHARED.has(child.geometry)) return;
    child.geometry.dispose();
    const kept = new Set(materials.values());
    for (const material of [child.material].flat()) if (!kept.has(material)) material?.dispose();
  });
}
