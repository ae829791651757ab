// The gel surface in 3D, seen from the camera's side: depth moves the vertices of a plane, in the graphics card.

import * as THREE from "./vendor/three-0.185/three.module.min.js";
import { depthColour } from "./colour.js";
import { depthAt, sizeMm } from "./field.js";
import { shares } from "./hand.js";
import { Orbit } from "./orbit.js";
import { NO_DEPTH, depthMm } from "./packed.js";

/** How finely the surface is drawn; the last level is no mesh, but a picture: see planes.js. */
const MESHES = [[320, 240], [160, 120]];
const PICK_STEPS = 300;
const LIFT_MM = 0.05; // of the line over the surface, so that it is seen

const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;

const VERTEX = `
uniform sampler2D depth;
uniform float exaggeration;
varying vec2 place;
varying vec2 at;
varying float depthMm;
varying vec3 eye;
void main() {
  place = vec2(uv.x, 1.0 - uv.y);
  at = position.xy;
  depthMm = texture2D(depth, place).r;
  vec4 world = vec4(position.xy, depthMm * exaggeration, 1.0);
  eye = cameraPosition - world.xyz;
  gl_Position = projectionMatrix * viewMatrix * world;
}`;

const FRAGMENT = `
uniform sampler2D normals;
uniform sampler2D colours;
uniform sampler2D image;
uniform float exaggeration;
uniform float scaleMm;
uniform int colouring;
varying vec2 place;
varying vec2 at;
varying float depthMm;
varying vec3 eye;
void main() {
  vec3 flatNormal = texture2D(normals, place).xyz * 2.0 - 1.0;
  vec3 normal = normalize(vec3(flatNormal.x * exaggeration, -flatNormal.y * exaggeration, max(flatNormal.z, 0.05)));
  vec3 base = vec3(0.62, 0.66, 0.72);
  if (colouring == 0) base = texture2D(colours, vec2(depthMm / scaleMm * 254.0 / 256.0 + 0.5 / 256.0, 0.5)).rgb;
  if (colouring == 1) base = texture2D(image, place).rgb;
  vec3 key = normalize(vec3(-0.5, 0.6, 0.75));
  vec3 fill = normalize(vec3(0.8, -0.3, 0.5));
  float light = 0.42 + 0.62 * max(dot(normal, key), 0.0) + 0.16 * max(dot(normal, fill), 0.0);
  float gloss = pow(max(dot(normal, normalize(key + normalize(eye))), 0.0), 48.0);
  vec2 lines = abs(fract(at / 5.0 + 0.5) - 0.5) * 5.0 / max(fwidth(at), 1e-6);
  float grid = 1.0 - min(min(lines.x, lines.y), 1.0);
  gl_FragColor = vec4(mix(base * light + 0.16 * gloss, vec3(1.0), 0.13 * grid), 1.0);
}`;

export class Surface {
  #level = -1;
  #size = ""; // of the view, in pixels and mm
  #scene = new THREE.Scene();
  #camera = new THREE.PerspectiveCamera(30, 1, 1, 1000);
  #uniforms = { depth: {}, normals: {}, image: {}, colours: {}, exaggeration: {}, scaleMm: {}, colouring: {} };
  #material = new THREE.ShaderMaterial({
    uniforms: this.#uniforms, vertexShader: VERTEX, fragmentShader: FRAGMENT, side: THREE.DoubleSide,
    polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
  });
  #mesh = null;
  #frame = null;
  #line = new THREE.Line(lines([]), new THREE.LineBasicMaterial({ color: 0xffffff, depthTest: false }));
  #view = null;

  /** Draw into `box`; call `changed` when the view was turned. Throws where there is no WebGL. */
  constructor(box, imageCanvas, changed) {
    this.software = SOFTWARE.test(rendererName());
    this.renderer = new THREE.WebGLRenderer({ antialias: !this.software, alpha: true });
    this.canvas = this.renderer.domElement;
    box.append(this.canvas);
    this.orbit = new Orbit(box, changed);
    this.#tell({ image: Object.assign(new THREE.CanvasTexture(imageCanvas), { flipY: false }) });
    this.recolour();
    this.#line.frustumCulled = false;
    this.#line.renderOrder = 1; // over the mesh
    this.#scene.add(this.#line);
    new ResizeObserver(() => {
      this.renderer.setSize(box.clientWidth, box.clientHeight, false);
      this.#camera.aspect = box.clientWidth / Math.max(box.clientHeight, 1);
      this.#camera.updateProjectionMatrix();
      changed();
    }).observe(box);
  }

  /** Take over the colours that were chosen. */
  recolour() {
    const colours = Array.from({ length: 256 }, (_, i) => [...depthColour(i === 255 ? 2 : i / 254), 255]);
    this.#tell({ colours: texture(new Uint8Array(colours.flat()), 256, 1) });
    this.#uniforms.colours.value.needsUpdate = true;
  }

  /** Take over the depth of `view` and the painted normals. */
  update(view, normalPixels) {
    this.#view = view;
    this.#fit(view);
    const { data } = this.#uniforms.depth.value.image;
    for (let i = 0; i < data.length; i++) data[i] = view.depth[i] === NO_DEPTH ? 0 : depthMm(view.depth[i]);
    this.#uniforms.normals.value.image.data.set(normalPixels);
    for (const name of ["depth", "normals", "image"]) this.#uniforms[name].value.needsUpdate = true;
  }

  /** Return the place [x, y] in mm that a pointer on the canvas points at; null beside the gel. */
  placeAt(event) {
    const caster = new THREE.Raycaster();
    const [right, down] = shares(event, this.canvas);
    caster.setFromCamera(new THREE.Vector2(2 * right - 1, 1 - 2 * down), this.#camera);
    const { origin, direction } = caster.ray;
    const times = this.#uniforms.exaggeration.value;
    const tallest = this.#uniforms.depth.value.image.data.reduce((a, b) => Math.max(a, b), 0) * times;
    for (let i = 0; i <= PICK_STEPS; i++) {
      const z = tallest * (1 - i / PICK_STEPS);
      const along = (z - origin.z) / direction.z;
      const place = [origin.x + along * direction.x, -(origin.y + along * direction.y)];
      const depth = along > 0 ? depthAt(this.#view, this.#view.depth, place) : null;
      if (depth !== null && (depth * times >= z || i === PICK_STEPS)) return place;
    }
    return null;
  }

  /**
   * Draw at a level of `MESHES`, from so far away that the whole gel is seen, whatever the shape of the box. `look`:
   * {exaggeration, scaleMm, colouring}; over the surface lies a line through `places` [[x, y], ...] in mm.
   */
  draw(level, look, places) {
    this.#tell(look);
    const size = sizeMm(this.#view.header);
    if (level !== this.#level) this.#remesh(level, size);
    const height = (place) => (depthAt(this.#view, this.#view.depth, place) ?? 0) * look.exaggeration + LIFT_MM;
    this.#line.geometry.dispose();
    this.#line.geometry = lines(places.map(([x, y]) => [x, -y, height([x, y])]));
    const half = Math.tan((this.#camera.fov * Math.PI) / 360);
    this.orbit.place(this.#camera, (Math.hypot(...size) / half) * Math.max(0.53 / this.#camera.aspect, 0.405));
    this.renderer.render(this.#scene, this.#camera);
  }

  /** Give the shaders values of their uniforms. */
  #tell(values) {
    for (const [name, value] of Object.entries(values)) this.#uniforms[name].value = value;
  }

  /** Make what depends on the size of the view. */
  #fit({ width, height, header }) {
    const size = [width, height, ...sizeMm(header)].join();
    if (this.#size === size) return;
    this.#size = size;
    const smooth = { minFilter: THREE.LinearFilter, magFilter: THREE.LinearFilter };
    this.#tell({
      depth: texture(new Float32Array(width * height), width, height, THREE.RedFormat, THREE.FloatType),
      normals: Object.assign(texture(new Uint8Array(width * height * 4), width, height), smooth),
    });
    this.#frame?.removeFromParent();
    this.#frame = frameLines(...sizeMm(header));
    this.#scene.add(this.#frame);
    this.#level = -1;
  }

  #remesh(level, size) {
    const [columns, rows] = MESHES[level];
    this.#mesh?.geometry.dispose();
    this.#mesh?.removeFromParent();
    this.#mesh = new THREE.Mesh(new THREE.PlaneGeometry(...size, columns - 1, rows - 1), this.#material);
    this.#mesh.frustumCulled = false;
    this.#scene.add(this.#mesh);
    this.renderer.setPixelRatio(level === 0 ? Math.min(devicePixelRatio, 2) : 1);
    this.#level = level;
  }
}

/** Name of what draws, for instance a graphics card or SwiftShader; throws where there is no WebGL 2. */
function rendererName() {
  const context = document.createElement("canvas").getContext("webgl2");
  if (!context) throw new Error("this browser offers no WebGL 2");
  const names = context.getExtension("WEBGL_debug_renderer_info");
  const name = names ? context.getParameter(names.UNMASKED_RENDERER_WEBGL) : "";
  context.getExtension("WEBGL_lose_context")?.loseContext();
  return name;
}

/** A texture of which each point has the value of its pixel. */
function texture(...what) {
  const made = new THREE.DataTexture(...what);
  made.minFilter = made.magFilter = THREE.NearestFilter;
  return made;
}

/** A geometry of points [x, y, z] in mm. */
function lines(points) {
  const geometry = new THREE.BufferGeometry();
  return geometry.setAttribute("position", new THREE.Float32BufferAttribute(points.flat(), 3));
}

/** The rim of the view at rest, and its axes: x red to the right, y green downwards, z blue towards the camera. */
function frameLines(widthMm, heightMm) {
  const [x, y] = [widthMm / 2, heightMm / 2];
  const corners = [[-x, y, 0], [x, y, 0], [x, -y, 0], [-x, -y, 0]];
  const rim = corners.map((corner, i) => [corner, corners[(i + 1) % 4], [0.25, 0.32, 0.42]]);
  const ends = [[[-x + 5, y, 0], [1, 0.36, 0.36]], [[-x, y - 5, 0], [0.32, 0.82, 0.45]], [[-x, y, 5], [0.36, 0.55, 1]]];
  const all = [...rim, ...ends.map(([end, colour]) => [corners[0], end, colour])];
  const geometry = lines(all.flatMap(([start, end]) => [start, end]));
  const colours = all.flatMap(([, , colour]) => [...colour, ...colour]);
  geometry.setAttribute("color", new THREE.Float32BufferAttribute(colours, 3));
  return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ vertexColors: true }));
}
