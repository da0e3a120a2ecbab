/** The ground: a plane with a grid that fades away, on which shadows fall. */

import * as THREE from "three";

/** Rounds of a grid's spacing, and how many of its lines a view is about to span. */
const ROUND = [1, 2, 5, 10];
const LINES = 16;
/** Every so many lines one is stronger. */
const STRONGER = 5;

const VERTICES = `
varying vec2 place;
void main() {
  vec4 world = modelMatrix * vec4(position, 1.0);
  place = world.xy;
  gl_Position = projectionMatrix * viewMatrix * world;
}`;
const FRAGMENTS = `
varying vec2 place;
uniform vec3 paper;
uniform vec3 ink;
uniform vec2 middle;
uniform float reach;
uniform float spacing;
float lines(float step) {
  vec2 at = place / step;
  vec2 width = fwidth(at);
  vec2 away = abs(fract(at - 0.5) - 0.5) / max(width, 1e-6);
  // Lines that would lie closer than pixels become an even tone.
  vec2 shown = clamp(1.2 - away, 0.0, 1.0) * clamp(1.0 - 3.0 * width, 0.0, 1.0);
  return max(shown.x, shown.y);
}
void main() {
  float far = distance(place, middle) / reach;
  float line = max(0.45 * lines(spacing), 0.8 * lines(${STRONGER.toFixed(1)} * spacing));
  gl_FragColor = vec4(mix(paper, ink, line * (1.0 - 0.6 * far)), 1.0 - smoothstep(0.35, 1.0, far));
  #include <colorspace_fragment>
}`;

/**
 * @param {number} radius of what is seen [m]
 * @returns {number} a round number [m]
 */
export function spacingFor(radius) {
  const fine = (2 * radius) / LINES;
  const decade = 10 ** Math.floor(Math.log10(fine));
  return decade * /** @type {number} */ (ROUND.find((round) => round * decade >= 0.999 * fine));
}

export class Ground {
  /**
   * @param {number} height [m]
   * @param {THREE.Sphere} arena Where bodies are.
   */
  constructor(height, arena) {
    this.spacing = spacingFor(arena.radius);
    const reach = 4.5 * arena.radius;
    const { x, y } = arena.center;
    this.tones = {
      paper: { value: new THREE.Color() },
      ink: { value: new THREE.Color() },
    };
    const plane = new THREE.ShaderMaterial({
      vertexShader: VERTICES,
      fragmentShader: FRAGMENTS,
      uniforms: {
        ...this.tones,
        middle: { value: new THREE.Vector2(x, y) },
        reach: { value: reach },
        spacing: { value: this.spacing },
      },
      transparent: true,
      polygonOffset: true,
      polygonOffsetFactor: 1,
      polygonOffsetUnits: 1,
    });
    this.shade = new THREE.ShadowMaterial({ depthWrite: false });
    this.group = new THREE.Group();
    const disk = new THREE.CircleGeometry(reach, 64);
    for (const [order, material] of [plane, this.shade].entries()) {
      const mesh = new THREE.Mesh(disk, material);
      mesh.position.set(x, y, height);
      mesh.renderOrder = order;
      mesh.receiveShadow = material === this.shade;
      this.group.add(mesh);
    }
  }

  /**
   * @param {THREE.Color} paper
   * @param {THREE.Color} ink
   * @param {number} depth of shadows, 0 to 1
   */
  takeColours(paper, ink, depth) {
    this.tones.paper.value.copy(paper);
    this.tones.ink.value.copy(ink);
    this.shade.opacity = depth;
  }
}
