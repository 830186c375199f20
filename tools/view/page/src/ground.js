// Unbounded ground, horizon and sky behind everything, and the shadows on the ground.

import {
  BufferGeometry, Color, DoubleSide, Float32BufferAttribute, FrontSide, LinearFilter, LineSegments, Mesh, NoBlending,
  OrthographicCamera, PlaneGeometry, RedFormat, Scene, ShaderMaterial, ShadowMaterial, UnsignedByteType, Vector2,
  WebGLRenderTarget,
} from "three";
import { colour, isDark } from "./theme.js";

/** Additional layer of the objects that cast a contact shadow. */
export const CASTERS = 1;
/** Height above the ground at which a contact shadow ends, m. */
const REACH = 0.35;
/** Pixels of the contact shadow along each side. */
const CONTACT_PIXELS = 192;
/** Pictures between two contact shadows. */
const CONTACT_EVERY = 2;

/** Elevations of the rings of the sky, degrees, and their colour between horizon (0) and zenith (1). */
const SKY = [[-90, 0], [-0.5, 0], [0, 0], [2, 0.14], [5, 0.28], [10, 0.45], [18, 0.62], [32, 0.8], [55, 0.95], [90, 1]];
/** Radii of the rings of the ground, and their shares of central light and of distant haze. */
const FLOOR = [[0, 1, 0], [0.7, 0.93, 0], [1.4, 0.7, 0], [2.2, 0.42, 0.02], [3.2, 0.18, 0.06], [4.5, 0.05, 0.13], [7, 0, 0.28],
  [11, 0, 0.47], [18, 0, 0.7], [32, 0, 0.9], [70, 0, 1], [400, 0, 1]];
const SEGMENTS = 40;
/** The grid: distance of lines, half of the side of the square, and length of separately fading parts, m. */
const FINE = { apart: 0.25, half: 5, part: 0.5 };
const COARSE = { apart: 1, half: 16, part: 1 };
const AXES = { apart: 100, half: 60, part: 1 };

// These are drawn at the far plane: they hide nothing, and covered parts cost little.
const FAR_VERTEX = /* glsl */ `
attribute vec4 shade;
uniform vec3 colours[5];
uniform vec2 focus;
uniform float reach, fade;
varying vec4 shown;
void main() {
#ifdef SKY
  vec4 seen = vec4(mat3(viewMatrix) * position, 1.0);
  shown = vec4(mix(colours[1], colours[0], shade.x), 1.0);
#else
  vec4 at = modelMatrix * vec4(position, 1.0);
  vec4 seen = viewMatrix * at;
#ifdef LINES
  vec2 from = (at.xy - focus) / reach;
  shown = vec4(shade.rgb, shade.a * exp(-dot(from, from) / fade));
#else
  shown = vec4(mix(mix(colours[2], colours[3], shade.x), colours[1], shade.y), 1.0);
#endif
#endif
  gl_Position = projectionMatrix * seen;
  gl_Position.z = gl_Position.w;
}`;

const FAR_FRAGMENT = /* glsl */ `
varying vec4 shown;
void main() {
  gl_FragColor = shown;
#ifndef LINES
  // half a step of 8 bits of noise: no bands
  gl_FragColor.rgb += (fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715)))) - 0.5) / 255.0;
#endif
}`;

/** A geometry of rings of corners, from the inside to the outside, each with its shade. */
function rings(all, corner, shade) {
  const [positions, shades, indices] = [[], [], []];
  all.forEach((ring, row) => {
    for (let column = 0; column <= SEGMENTS; column += 1) {
      const angle = (2 * Math.PI * column) / SEGMENTS;
      positions.push(...corner(ring, Math.cos(angle), Math.sin(angle)));
      shades.push(...shade(ring));
      if (row === 0 || column === 0) continue;
      const [d, c] = [row * (SEGMENTS + 1) + column, (row - 1) * (SEGMENTS + 1) + column];
      indices.push(c - 1, d - 1, c, c, d - 1, d);
    }
  });
  return far(positions, shades).setIndex(indices);
}

function far(positions, shades) {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(positions, 3));
  geometry.setAttribute("shade", new Float32BufferAttribute(shades, 4));
  return geometry;
}

/** Corners of the lines of a square grid around the origin, in short parts. */
function grid({ apart, half, part }, skip) {
  const corners = [];
  for (let index = Math.round(-half / apart); index <= half / apart; index += 1) {
    if (skip && index % skip === 0) continue;
    for (let from = -half; from < half; from += part) {
      corners.push(from, index * apart, 0, from + part, index * apart, 0);
      corners.push(index * apart, from, 0, index * apart, from + part, 0);
    }
  }
  return corners;
}

const PLANE_VERTEX = /* glsl */ `
varying vec2 at;
void main() {
  at = uv;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`;

// Seen from below, the height of an object above the ground is its distance from the camera: closer is darker.
const CONTACT_FRAGMENT = /* glsl */ `
void main() {
  float near = 1.0 - gl_FragCoord.z;
  gl_FragColor = vec4(near * near, 0.0, 0.0, 1.0);
}`;

const BLUR_VERTEX = /* glsl */ `
varying vec2 at;
void main() {
  at = position.xy * 0.5 + 0.5;
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`;

const BLUR_FRAGMENT = /* glsl */ `
uniform sampler2D picture;
uniform vec2 step_;
varying vec2 at;
void main() {
  float sum = 0.227 * texture2D(picture, at).r;
  sum += 0.194 * (texture2D(picture, at + step_).r + texture2D(picture, at - step_).r);
  sum += 0.122 * (texture2D(picture, at + 2.0 * step_).r + texture2D(picture, at - 2.0 * step_).r);
  sum += 0.054 * (texture2D(picture, at + 3.0 * step_).r + texture2D(picture, at - 3.0 * step_).r);
  sum += 0.016 * (texture2D(picture, at + 4.0 * step_).r + texture2D(picture, at - 4.0 * step_).r);
  gl_FragColor = vec4(sum, 0.0, 0.0, 1.0);
}`;

const SHADE_FRAGMENT = /* glsl */ `
uniform sampler2D picture;
uniform vec3 shade;
uniform float strength;
varying vec2 at;
void main() {
  vec2 edge = smoothstep(0.0, 0.12, at) * smoothstep(0.0, 0.12, 1.0 - at);
  float near = texture2D(picture, vec2(1.0 - at.x, at.y)).r; // from below left is right
  gl_FragColor = vec4(shade, strength * near * edge.x * edge.y);
}`;

/** A triangle that covers the picture. */
function covering() {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute([-1, -1, 0, 3, -1, 0, -1, 3, 0], 3));
  return geometry;
}

const picture = () => {
  const options = { format: RedFormat, type: UnsignedByteType, minFilter: LinearFilter, magFilter: LinearFilter };
  return new WebGLRenderTarget(CONTACT_PIXELS, CONTACT_PIXELS, { ...options, stencilBuffer: false });
};

const DEGREE = Math.PI / 180;

export class Ground {
  #height = 0;
  #pictures = 0;

  constructor(scene) {
    this.scene = scene;
    this.colours = Array.from({ length: 5 }, () => new Color());
    this.uniforms = { colours: { value: this.colours }, focus: { value: new Vector2() }, reach: { value: 1 } };
    const sky = rings(SKY, ([degrees], x, y) => {
      const [up, out] = [Math.sin(degrees * DEGREE), Math.cos(degrees * DEGREE)];
      return [out * x, out * y, up];
    }, ([, share]) => [share, 0, 0, 1]);
    const floor = rings(FLOOR, ([radius], x, y) => [radius * x, radius * y, 0], ([, light, haze]) => [light, haze, 0, 1]);
    this.floor = this.#far(new Mesh(floor), {});
    this.fine = this.#far(new LineSegments(), { LINES: "" }, grid(FINE, 4), 5);
    this.coarse = this.#far(new LineSegments(), { LINES: "" }, grid(COARSE), 22);
    this.axes = this.#far(new LineSegments(), { LINES: "" }, grid(AXES), 30);
    const all = [this.#far(new Mesh(sky), { SKY: "" }), this.floor, this.fine, this.coarse, this.axes];
    all.forEach((one, order) => (one.renderOrder = 1000 + order)); // after all opaque objects
    scene.add(...all);
    const lying = { transparent: true, depthWrite: false, polygonOffset: true, polygonOffsetFactor: -2, polygonOffsetUnits: -2 };
    this.catcher = new Mesh(new PlaneGeometry(1, 1), new ShadowMaterial(lying));
    this.catcher.receiveShadow = true;
    this.shade = { picture: { value: null }, shade: { value: new Color() }, strength: { value: 1 } };
    const shade = { uniforms: this.shade, vertexShader: PLANE_VERTEX, fragmentShader: SHADE_FRAGMENT };
    this.contact = new Mesh(new PlaneGeometry(1, 1), new ShaderMaterial({ ...shade, ...lying }));
    // above the lines of the grid
    [this.catcher.renderOrder, this.contact.renderOrder] = [1, 0];
    scene.add(this.catcher, this.contact);
    this.#prepareContact();
    this.paint();
  }

  /** An object behind everything; lines between these corners fade away from the focus. */
  #far(object, defines, corners, fade = 1) {
    const isLines = corners !== undefined;
    if (isLines) object.geometry = far(corners, new Array((corners.length / 3) * 4).fill(0));
    object.material = new ShaderMaterial({
      uniforms: { ...this.uniforms, fade: { value: fade } }, defines, vertexShader: FAR_VERTEX, fragmentShader: FAR_FRAGMENT, depthWrite: false,
      transparent: isLines, side: "SKY" in defines ? DoubleSide : FrontSide,
    });
    object.frustumCulled = false;
    return object;
  }

  #prepareContact() {
    [this.seen, this.blurred] = [picture(), picture()];
    this.shade.picture.value = this.seen.texture;
    this.below = new OrthographicCamera(-1, 1, 1, -1, 0, REACH);
    this.below.layers.set(CASTERS);
    this.nearness = new ShaderMaterial({ vertexShader: PLANE_VERTEX, fragmentShader: CONTACT_FRAGMENT, blending: NoBlending, side: DoubleSide });
    this.blur = { picture: { value: null }, step_: { value: new Vector2() } };
    const blur = { uniforms: this.blur, vertexShader: BLUR_VERTEX, fragmentShader: BLUR_FRAGMENT, depthTest: false, depthWrite: false };
    const quad = new Mesh(covering(), new ShaderMaterial({ ...blur, blending: NoBlending }));
    quad.frustumCulled = false;
    quad.layers.set(CASTERS);
    this.blurring = new Scene().add(quad);
  }

  /** Applies the colours of the theme, mixed with the colour of the world's ground, if it has one. */
  paint() {
    const srgb = (name) => new Color(colour(name)).convertLinearToSRGB();
    ["--zenith", "--horizon", "--floor", "--lit"].forEach((name, index) => this.colours[index].copy(srgb(name)));
    if (this.tint) {
      const { r, g, b } = this.tint;
      const grey = (r + g + b) / 3 || 1;
      for (const shown of this.colours.slice(2, 4)) {
        shown.r = Math.min((shown.r * (1 + r / grey)) / 2, 1);
        shown.g = Math.min((shown.g * (1 + g / grey)) / 2, 1);
        shown.b = Math.min((shown.b * (1 + b / grey)) / 2, 1);
      }
    }
    const lines = (object, shade) => {
      const { array, count } = object.geometry.attributes.shade;
      for (let index = 0; index < count; index += 1) array.set(shade(index), 4 * index);
      object.geometry.attributes.shade.needsUpdate = true;
    };
    const rgba = (name, alpha) => [...srgb(name).toArray(), alpha];
    const [cell, axis, x, y] = [rgba("--axis", 0.4), rgba("--axis", 1), rgba("--x-axis", 0.9), rgba("--y-axis", 0.9)];
    lines(this.fine, () => cell);
    lines(this.coarse, () => axis);
    const { array } = this.axes.geometry.attributes.position;
    lines(this.axes, (index) => (array[3 * index + 1] === 0 && array[3 * (index ^ 1) + 1] === 0 ? x : y));
    this.shade.shade.value.copy(srgb("--shade"));
    this.shade.strength.value = isDark() ? 0.8 : 0.6;
    this.catcher.material.color.set(colour("--shade"));
    this.catcher.material.opacity = isDark() ? 0.5 : 0.36;
  }

  /** The world's ground: its height, m, and its colour; undefined for the grid alone. */
  place(height = 0, tint = undefined) {
    this.#height = height;
    this.tint = tint;
    for (const object of [this.floor, this.fine, this.coarse, this.axes]) object.position.z = height;
    this.paint();
  }

  /** Centres the ground on a point, within a radius, m. `shadows` and `contact` select the shadows. */
  focus(centre, radius, { shadows, contact }) {
    this.uniforms.focus.value.set(centre.x, centre.y);
    const reach = Math.max(radius, 0.4);
    this.uniforms.reach.value = reach;
    this.floor.position.set(centre.x, centre.y, this.#height);
    this.floor.scale.set(reach, reach, 1);
    for (const lines of [this.fine, this.coarse]) lines.position.set(Math.round(centre.x), Math.round(centre.y), this.#height);
    this.catcher.visible = shadows;
    this.catcher.position.set(centre.x, centre.y, this.#height);
    this.catcher.scale.setScalar(12 * radius);
    this.contact.visible = contact;
    const side = 3.2 * radius;
    this.contact.position.set(centre.x, centre.y, this.#height);
    this.contact.scale.setScalar(side);
    if (this.below.right === side / 2) return;
    [this.below.left, this.below.right, this.below.top, this.below.bottom] = [-side / 2, side / 2, side / 2, -side / 2];
    this.below.updateProjectionMatrix();
  }

  /** Draws the contact shadow of objects close to the ground. */
  renderContact(renderer) {
    this.#pictures += 1;
    if (!this.contact.visible || this.#pictures % CONTACT_EVERY !== 0) return;
    this.below.position.copy(this.contact.position);
    this.below.up.set(0, 1, 0);
    this.below.lookAt(this.contact.position.x, this.contact.position.y, this.#height + 1);
    const { overrideMaterial } = this.scene;
    const shadows = renderer.shadowMap.autoUpdate;
    renderer.shadowMap.autoUpdate = false;
    this.scene.overrideMaterial = this.nearness;
    renderer.setRenderTarget(this.seen);
    renderer.setClearColor(0, 1);
    renderer.clear();
    renderer.render(this.scene, this.below);
    this.scene.overrideMaterial = overrideMaterial;
    const step = 1.6 / CONTACT_PIXELS;
    for (const [from, to, x, y] of [[this.seen, this.blurred, step, 0], [this.blurred, this.seen, 0, step]]) {
      this.blur.picture.value = from.texture;
      this.blur.step_.value.set(x, y);
      renderer.setRenderTarget(to);
      renderer.render(this.blurring, this.below);
    }
    renderer.setRenderTarget(null);
    renderer.shadowMap.autoUpdate = shadows;
  }
}
