// Surfaces: colours of a model as materials that reflect a studio, computed without a texture.

import { Color, MeshStandardMaterial, SRGBColorSpace } from "three";

/** Roughness and share of metal: plastic, painted or bare metal. */
const PLASTIC = { roughness: 0.5, metalness: 0 };
const METAL = { roughness: 0.38, metalness: 0.65 };
/** Greys between these brightnesses look like metal, darker ones like rubber, brighter ones like paint. */
const GREYS = [0.35, 0.8];
const SATURATION = 0.08;
/** Minimum of each colour component: no plastic is darker. */
const DARKEST = 0.19;

/** Light of the studio that surfaces reflect; changed with the theme. */
export const studio = { above: { value: new Color() }, below: { value: new Color() }, rim: { value: 0.3 } };

// Reflections of a bright ceiling, a soft box to the left, and the ground. Surfaces seen edge-on are darker, so that parts of
// one colour stay apart.
const REFLECTED = /* glsl */ `
#include <lights_fragment_end>
{
  float facing = saturate(dot(geometryNormal, geometryViewDir));
  vec3 ray = inverseTransformDirection(reflect(-geometryViewDir, geometryNormal), viewMatrix);
  float blur = 0.15 + 0.7 * material.roughness;
  vec3 light = mix(studioBelow, studioAbove, smoothstep(-blur, blur, ray.z));
  light += studioAbove * 1.6 * smoothstep(1.0 - 0.55 * blur, 1.0, dot(ray, vec3(0.41, -0.66, 0.63)));
  vec3 fresnel = material.specularColorBlended
    + (1.0 - material.specularColorBlended) * pow(1.0 - facing, 5.0) * (1.0 - material.roughness);
  reflectedLight.indirectSpecular += light * fresnel;
  float edge = mix(1.0 - studioRim, 1.0, smoothstep(0.0, 0.55, facing));
  reflectedLight.indirectDiffuse *= edge;
  reflectedLight.directDiffuse *= mix(1.0, edge, 0.7);
}`;

function reflectStudio(shader) {
  Object.assign(shader.uniforms, { studioAbove: studio.above, studioBelow: studio.below, studioRim: studio.rim });
  shader.fragmentShader = shader.fragmentShader
    .replace("#include <common>", "#include <common>\nuniform vec3 studioAbove, studioBelow;\nuniform float studioRim;")
    .replace("#include <lights_fragment_end>", REFLECTED);
}

/** Makes a physically based material reflect the studio. */
export function inStudio(material) {
  material.onBeforeCompile = reflectStudio;
  material.customProgramCacheKey = () => "studio";
  return material;
}

/** A material of a colour in sRGB, 0 to 1, as in files. */
export function surface({ r, g, b, a = 1 }, other = {}) {
  const [least, most] = [Math.min(r, g, b), Math.max(r, g, b)];
  const isMetal = most - least < SATURATION && most > GREYS[0] && most < GREYS[1];
  const color = new Color().setRGB(...[r, g, b].map((part) => Math.max(part, DARKEST)), SRGBColorSpace);
  const seeThrough = a < 1 ? { transparent: true, opacity: a, depthWrite: false } : {};
  return inStudio(new MeshStandardMaterial({ color, ...(isMetal ? METAL : PLASTIC), ...seeThrough, ...other }));
}

const replaced = new WeakMap();

function replace(material, make) {
  if (!replaced.has(material)) replaced.set(material, make(material));
  return replaced.get(material);
}

/** Colour of a link without one in its description. */
const UNCOLOURED = { r: 0.8, g: 0.81, b: 0.83 };

/** Converts the material of a description, in sRGB, to one of the page. */
export function fromUrdf(material) {
  if (material.isMeshStandardMaterial) return material;
  return replace(material, ({ name, map, opacity: a, color: { r, g, b } }) => {
    const isColoured = name !== "" || map || r + g + b !== 3;
    return surface({ ...(isColoured ? { r, g, b } : UNCOLOURED), a }, { map });
  });
}

/** Converts the material of a loaded mesh to one of the page. */
export function fromFile(material) {
  if (material.isMeshStandardMaterial) return inStudio(material);
  if (!material.isMeshPhongMaterial && !material.isMeshLambertMaterial && !material.isMeshBasicMaterial) return material;
  return replace(material, ({ map, side, vertexColors, opacity: a, alphaTest, color }) => {
    const { r, g, b } = color.clone().convertLinearToSRGB();
    return surface({ r, g, b, a }, { map, side, vertexColors, alphaTest });
  });
}
