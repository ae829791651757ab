// The light ring as the camera saw it lit: LED 0 at +x, anticlockwise, as in the geometry of the sensor.

import { shape } from "./dom.js";

const RADIUS = 48;

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
  const lamps = light.map((rgb, index) => {
    const angle = (2 * Math.PI * index) / light.length;
    return { rgb, index, cx: RADIUS * Math.cos(angle), cy: -RADIUS * Math.sin(angle) };
  });
  const disc = shape("clipPath", { id: "disc" }, shape("circle", { r: 39 }));
  const glows = lamps.map(({ index, cx, cy }) => shape("circle", { cx, cy, r: 66, fill: `url(#glow-${index})` }));
  return [
    shape("defs", {}, disc, ...lamps.map(gradient)),
    shape("circle", { r: 39, fill: "#05070b" }),
    shape("g", { "clip-path": "url(#disc)" }, ...glows),
    shape("circle", { r: 39, fill: "none", stroke: "#2a3548" }),
    ...lamps.map(lamp),
  ];
}

function gradient({ index, rgb }) {
  const stop = (offset, opacity) => shape("stop", { offset, "stop-color": `rgb(${rgb})`, "stop-opacity": opacity });
  return shape("radialGradient", { id: `glow-${index}` }, stop(0.2, 0.55), stop(1, 0));
}

function lamp({ index, rgb, cx, cy }) {
  const [fill, stroke] = Math.max(...rgb) > 0 ? [`rgb(${rgb})`, "#8889"] : ["#141a26", "currentColor"];
  return shape("circle", { cx, cy, r: 6, fill, stroke, "data-testid": `led-${index}` }, shape("title", {}, `LED ${index}: ${rgb.join(", ")}`));
}

function unknown() {
  const text = shape("text", { "text-anchor": "middle", fill: "currentColor", "font-size": 12 }, "light unknown");
  return [shape("circle", { r: RADIUS, fill: "none", stroke: "currentColor", "stroke-dasharray": "3 5" }), text];
}
