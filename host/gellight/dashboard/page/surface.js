// The gel surface in 3D, seen from the camera's side: depth moves the vertices of a plane, in the graphics card.

import * as THREE from "./vendor/three-0.185/three.module.min.js";
import { depthAt, sizeMm } from "./field.js";
import { shares } from "./hand.js";
import { Orbit } from "./orbit.js";
import { NO_DEPTH, depthMm } from "./packed.js";

/** How finely the surface is drawn; the last level is no mesh, but a picture: see planes.js. */
const MESHES = [[320, 240], [160, 120]];
const PICK_STEPS = 300;
const AXIS_MM = 5;
const LIFT_MM = 0.05; // of the line over the surface, so that it is seen
const GEL = new Uint8Array([158, 168, 184, 255]); // its own colour

const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;

const VERTEX = `
uniform sampler2D depth;
uniform float exaggeration;
varying vec2 place;
varying vec2 at;
varying vec3 eye;
void main() {
  place = uv;
  at = position.xy;
  vec4 world = vec4(position.xy, texture2D(depth, vec2(uv.x, 1.0 - uv.y)).r * exaggeration, 1.0);
  eye = cameraPosition - world.xyz;
  gl_Position = projectionMatrix * viewMatrix * world;
}`;

const FRAGMENT = `
uniform sampler2D normals;
uniform sampler2D colours;
uniform float exaggeration;
varying vec2 place;
varying vec2 at;
varying vec3 eye;
void main() {
  vec3 flatNormal = texture2D(normals, place).xyz * 2.0 - 1.0;
  vec3 normal = normalize(vec3(flatNormal.x * exaggeration, -flatNormal.y * exaggeration, max(flatNormal.z, 0.05)));
  vec3 base = texture2D(colours, place).rgb;
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
  #uniforms = { depth: {}, normals: {}, colours: {}, exaggeration: {} };
  #paints; // what the surface can be coloured by
  #material = new THREE.ShaderMaterial({
    uniforms: this.#uniforms, vertexShader: VERTEX, fragmentShader: FRAGMENT, side: THREE.DoubleSide,
    polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
  });
  #mesh = null;
  #frame = null;
  #line = new THREE.Line(lines([]), new THREE.LineBasicMaterial({ color: 0xffffff, depthTest: false }));
  #view = null;

  /** Draw into `box`, by the colours of `planes`; call `changed` when it was turned. Throws where there is no WebGL. */
  constructor(box, planes, changed) {
    this.software = SOFTWARE.test(rendererName());
    this.renderer = new THREE.WebGLRenderer({ antialias: !this.software, alpha: true });
    this.canvas = this.renderer.domElement;
    box.append(this.canvas);
    this.orbit = new Orbit(box, changed);
    const [depth, image, normals] = [planes.depth, planes.image, planes.normal].map(painted);
    this.#paints = [depth, image, new THREE.DataTexture(GEL, 1, 1)];
    this.#uniforms.normals.value = normals;
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

  /** Take over the depth of `view`. */
  update(view) {
    this.#view = view;
    this.#fit(view);
    const { data } = this.#uniforms.depth.value.image;
    for (let i = 0; i < data.length; i++) data[i] = view.depth[i] === NO_DEPTH ? 0 : depthMm(view.depth[i]);
    this.#uniforms.depth.value.needsUpdate = true;
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
   * Draw at a level of `MESHES`, from so far away that the whole gel is seen, whatever the shape of the box, with one
   * of the colours `#paints`; over the surface lies a line through `places` [[x, y], ...] in mm.
   */
  draw(level, exaggeration, colouring, places) {
    this.#uniforms.exaggeration.value = exaggeration;
    this.#uniforms.colours.value = this.#paints[colouring];
    for (const name of ["normals", "colours"]) this.#uniforms[name].value.needsUpdate = true;
    const size = sizeMm(this.#view.header);
    if (level !== this.#level) this.#remesh(level, size);
    const height = (place) => (depthAt(this.#view, this.#view.depth, place) ?? 0) * exaggeration + LIFT_MM;
    this.#line.geometry.dispose();
    this.#line.geometry = lines(places.map(([x, y]) => [x, -y, height([x, y])]));
    const half = Math.tan((this.#camera.fov * Math.PI) / 360);
    this.orbit.place(this.#camera, (Math.hypot(...size) / half) * Math.max(0.53 / this.#camera.aspect, 0.405));
    this.renderer.render(this.#scene, this.#camera);
  }

  /** Make what depends on the size of the view. */
  #fit({ width, height, header }) {
    const size = [width, height, ...sizeMm(header)].join();
    if (this.#size === size) return;
    this.#size = size;
    for (const texture of [this.#uniforms.normals.value, ...this.#paints]) texture.dispose(); // of another size
    const depth = new Float32Array(width * height);
    this.#uniforms.depth.value = new THREE.DataTexture(depth, width, height, THREE.RedFormat, THREE.FloatType);
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

/** A texture of what is painted on a plane. */
function painted({ canvas }) {
  return Object.assign(new THREE.CanvasTexture(canvas), { minFilter: THREE.LinearFilter });
}

/** A geometry of points [x, y, z] in mm. */
function lines(points) {
  const geometry = new THREE.BufferGeometry();
  return geometry.setAttribute("position", new THREE.Float32BufferAttribute(points.flat(), 3));
}

/** The rim of the view at rest, and its axes: x red to the right, y green downwards, z blue towards the camera. */
function frameLines(widthMm, heightMm) {
  const [x, y] = [widthMm / 2, heightMm / 2];
  const corners = lines([[-x, y, 0], [x, y, 0], [x, -y, 0], [-x, -y, 0]]);
  const rim = new THREE.LineLoop(corners, new THREE.LineBasicMaterial({ color: new THREE.Color(0.25, 0.32, 0.42) }));
  const axes = new THREE.AxesHelper(AXIS_MM);
  axes.position.set(-x, y, 0);
  axes.scale.y = -1;
  return new THREE.Group().add(rim, axes);
}
