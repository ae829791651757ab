// The gel surface in 3D, seen from the camera's side: depth moves the vertices of a plane, in the graphics card.

import * as THREE from "./vendor/three-0.185/three.module.min.js";
import { depthColour } from "./colour.js";
import { depthAt } from "./field.js";
import { DEPTH_OFFSET_MM, DEPTH_UNIT_MM, NO_DEPTH } from "./packed.js";
import { Orbit } from "./orbit.js";

/** How finely the surface is drawn; the last level is no mesh, but a picture: see relief.js. */
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
  #size = { width: 0, height: 0 };
  #level = -1;
  #scene = new THREE.Scene();
  #camera = new THREE.PerspectiveCamera(30, 1, 1, 1000);
  #uniforms = {
    depth: { value: null }, normals: { value: null }, image: { value: null }, colours: { value: colourTexture() },
    exaggeration: { value: 4 }, scaleMm: { value: 1.6 }, colouring: { value: 0 },
  };
  #material;
  #mesh = null;
  #frame = null;
  #line = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: 0xffffff, depthTest: false }));
  #view = null;
  #reach = 100; // distance in mm at which the whole gel is seen

  /** Draw into `box`; call `changed` when the view was turned. Throws where there is no WebGL. */
  constructor(box, imageCanvas, changed) {
    this.software = SOFTWARE.test(rendererName());
    this.renderer = new THREE.WebGLRenderer({ antialias: !this.software, alpha: true });
    this.canvas = this.renderer.domElement;
    box.append(this.canvas);
    this.orbit = new Orbit(box, changed);
    this.#uniforms.image.value = new THREE.CanvasTexture(imageCanvas);
    this.#uniforms.image.value.flipY = false;
    this.#line.frustumCulled = false;
    this.#line.renderOrder = 1; // over the mesh
    this.#scene.add(this.#line);
    this.#material = new THREE.ShaderMaterial({ uniforms: this.#uniforms, vertexShader: VERTEX, fragmentShader: FRAGMENT, side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
    new ResizeObserver(() => this.#resize(box, changed)).observe(box);
  }

  set exaggeration(times) { this.#uniforms.exaggeration.value = times; }
  set scaleUm(um) { this.#uniforms.scaleMm.value = um / 1000; }
  /** Take over the colours that were chosen. */
  recolour() { this.#uniforms.colours.value = colourTexture(); }
  set colouring(mode) { this.#uniforms.colouring.value = mode; }

  /** Take over the depth of `view` and the painted normals. */
  update(view, normalPixels) {
    this.#view = view;
    this.#fit(view.width, view.height, view.header);
    const texture = this.#uniforms.depth.value;
    const { data } = texture.image;
    for (let i = 0; i < data.length; i++) data[i] = view.depth[i] === NO_DEPTH ? 0 : view.depth[i] * DEPTH_UNIT_MM - DEPTH_OFFSET_MM;
    this.#uniforms.normals.value.image.data.set(normalPixels);
    for (const name of ["depth", "normals", "image"]) this.#uniforms[name].value.needsUpdate = true;
  }

  /** Draw a line over the surface through `places` [[x, y], ...] in mm; none where there are none. */
  drawLine(places) {
    const heights = places.map((place) => (depthAt(this.#view, this.#view.depth, place) ?? 0) * this.#uniforms.exaggeration.value + LIFT_MM);
    this.#line.geometry.dispose();
    this.#line.geometry = new THREE.BufferGeometry();
    this.#line.geometry.setAttribute("position", new THREE.Float32BufferAttribute(places.flatMap(([x, y], i) => [x, -y, heights[i]]), 3));
  }

  /** Return the place [x, y] in mm that a pointer on the canvas points at; null beside the gel. */
  placeAt({ clientX, clientY }) {
    if (!this.#view) return null;
    const box = this.canvas.getBoundingClientRect();
    const caster = new THREE.Raycaster();
    caster.setFromCamera(new THREE.Vector2(((clientX - box.left) / box.width) * 2 - 1, 1 - ((clientY - box.top) / box.height) * 2), this.#camera);
    const { origin, direction } = caster.ray;
    const tallest = this.#uniforms.depth.value.image.data.reduce((a, b) => Math.max(a, b), 0) * this.#uniforms.exaggeration.value;
    for (let i = 0; i <= PICK_STEPS; i++) {
      const z = tallest * (1 - i / PICK_STEPS);
      const along = (z - origin.z) / direction.z;
      const place = [origin.x + along * direction.x, -(origin.y + along * direction.y)];
      const depth = along > 0 ? depthAt(this.#view, this.#view.depth, place) : null;
      if (depth !== null && (depth * this.#uniforms.exaggeration.value >= z || i === PICK_STEPS)) return place;
    }
    return null;
  }

  /** Render at a level of `MESHES`. */
  draw(level) {
    if (!this.#size.width) return;
    if (level !== this.#level) this.#remesh(level);
    this.orbit.place(this.#camera, this.#reach);
    this.renderer.render(this.#scene, this.#camera);
  }

  #fit(width, height, { image_px: image, pixel_size_mm: pixel }) {
    const [widthMm, heightMm] = [image[0] * pixel[0], image[1] * pixel[1]];
    if (this.#size.width === width && this.#size.height === height && this.#size.widthMm === widthMm) return;
    this.#size = { width, height, widthMm, heightMm };
    this.#uniforms.depth.value = new THREE.DataTexture(new Float32Array(width * height), width, height, THREE.RedFormat, THREE.FloatType);
    const normals = new THREE.DataTexture(new Uint8Array(width * height * 4), width, height);
    normals.minFilter = normals.magFilter = THREE.LinearFilter;
    this.#uniforms.normals.value = normals;
    this.#frame?.removeFromParent();
    this.#frame = frameLines(widthMm, heightMm);
    this.#scene.add(this.#frame);
    this.#level = -1;
    this.#aim();
  }

  #remesh(level) {
    const { widthMm, heightMm } = this.#size;
    const [columns, rows] = MESHES[level];
    this.#mesh?.geometry.dispose();
    this.#mesh?.removeFromParent();
    this.#mesh = new THREE.Mesh(new THREE.PlaneGeometry(widthMm, heightMm, columns - 1, rows - 1), this.#material);
    this.#mesh.frustumCulled = false;
    this.#scene.add(this.#mesh);
    this.renderer.setPixelRatio(level === 0 ? Math.min(devicePixelRatio, 2) : 1);
    this.#level = level;
  }

  #resize(box, changed) {
    this.renderer.setSize(box.clientWidth, box.clientHeight, false);
    this.#camera.aspect = box.clientWidth / Math.max(box.clientHeight, 1);
    this.#camera.updateProjectionMatrix();
    this.#aim();
    changed();
  }

  /** Move the camera away until the whole gel is seen, whatever the shape of the box. */
  #aim() {
    const half = Math.tan((this.#camera.fov * Math.PI) / 360);
    const { widthMm = 40, heightMm = 30 } = this.#size;
    this.#reach = (Math.hypot(widthMm, heightMm) / half) * Math.max(0.53 / this.#camera.aspect, 0.405);
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

function colourTexture() {
  const data = new Uint8Array(256 * 4);
  for (let i = 0; i < 256; i++) data.set([...depthColour(i === 255 ? 2 : i / 254), 255], i * 4);
  const texture = new THREE.DataTexture(data, 256, 1);
  texture.minFilter = texture.magFilter = THREE.NearestFilter;
  texture.needsUpdate = true;
  return texture;
}

/** The rim of the view at rest, and its axes: x red to the right, y green downwards, z blue towards the camera. */
function frameLines(widthMm, heightMm) {
  const [x, y] = [widthMm / 2, heightMm / 2];
  const rim = [-x, y, 0, x, y, 0, x, y, 0, x, -y, 0, x, -y, 0, -x, -y, 0, -x, -y, 0, -x, y, 0];
  const axes = [-x, y, 0, -x + 5, y, 0, -x, y, 0, -x, y - 5, 0, -x, y, 0, -x, y, 5];
  const colours = [...Array(8).fill([0.25, 0.32, 0.42]), ...[[1, 0.36, 0.36], [0.32, 0.82, 0.45], [0.36, 0.55, 1]].flatMap((c) => [c, c])];
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute([...rim, ...axes], 3));
  geometry.setAttribute("color", new THREE.Float32BufferAttribute(colours.flat(), 3));
  return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ vertexColors: true }));
}
