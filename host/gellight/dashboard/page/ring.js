// The light ring as the camera saw it lit: LED 0 at +x, anticlockwise, as in the geometry of the sensor.

const NAMESPACE = "http://www.w3.org/2000/svg";
const RADIUS = 48;

function shape(kind, attributes) {
  const element = document.createElementNS(NAMESPACE, kind);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

export class Ring {
  #svg;
  #shown = "";

  constructor(svg) {
    this.#svg = svg;
  }

  /** Show `light`, a list of [r, g, b] for each LED; null where the camera does not know it. */
  show(light) {
    const key = JSON.stringify(light);
    if (key === this.#shown) return;
    this.#shown = key;
    this.#svg.replaceChildren(...(light ? drawn(light) : unknown()));
  }
}

function drawn(light) {
  const glows = shape("g", { "clip-path": "url(#disc)" });
  const lamps = shape("g", {});
  const definitions = shape("defs", {});
  const disc = shape("clipPath", { id: "disc" });
  disc.append(shape("circle", { r: 39 }));
  definitions.append(disc);
  light.forEach((rgb, index) => {
    const angle = (2 * Math.PI * index) / light.length;
    const [cx, cy] = [RADIUS * Math.cos(angle), -RADIUS * Math.sin(angle)];
    definitions.append(gradient(index, rgb));
    const glow = shape("circle", { cx, cy, r: 66, fill: `url(#glow-${index})` });
    glow.style.mixBlendMode = "screen";
    glows.append(glow);
    lamps.append(lamp(index, rgb, cx, cy));
  });
  const rim = shape("circle", { r: 39, fill: "none", stroke: "#2a3548" });
  return [definitions, shape("circle", { r: 39, fill: "#05070b" }), glows, rim, lamps];
}

function gradient(index, rgb) {
  const fade = shape("radialGradient", { id: `glow-${index}` });
  const colour = `rgb(${rgb})`;
  fade.append(shape("stop", { offset: "0.2", "stop-color": colour, "stop-opacity": 0.55 }));
  fade.append(shape("stop", { offset: "1", "stop-color": colour, "stop-opacity": 0 }));
  return fade;
}

function lamp(index, rgb, cx, cy) {
  const lit = Math.max(...rgb) > 0;
  const circle = shape("circle", { cx, cy, r: 6, fill: lit ? `rgb(${rgb})` : "#141a26", stroke: lit ? "#8889" : "currentColor" });
  circle.dataset.testid = `led-${index}`;
  const title = shape("title", {});
  title.textContent = `LED ${index}: ${rgb.join(", ")}`;
  circle.append(title);
  return circle;
}

function unknown() {
  const text = shape("text", { "text-anchor": "middle", fill: "currentColor", "font-size": 12 });
  text.textContent = "light unknown";
  return [shape("circle", { r: RADIUS, fill: "none", stroke: "currentColor", "stroke-dasharray": "3 5" }), text];
}
