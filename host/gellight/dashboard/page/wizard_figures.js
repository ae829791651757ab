// The figures of a calibration that a visitor wants to see, with their names and units.

const FIGURES = [
  ["prepare", ["uniformity", "average", "sigma_grey"], "evenness of the light (σ)", (v) => `${v.toFixed(1)} grey`],
  ["prepare", ["camera", "exposure_us"], "exposure", (v) => `${(v / 1000).toFixed(2)} ms`],
  ["reference", ["noise_grey"], "noise of a pixel", (v) => `${v.toFixed(2)} grey`],
  ["reference", ["drift_grey"], "drift while warm", (v) => `${v.toFixed(3)} grey`],
  ["pixel_size", ["x_mm"], "pixel size, x", (v) => `${(v * 1000).toFixed(2)} µm`],
  ["pixel_size", ["y_mm"], "pixel size, y", (v) => `${(v * 1000).toFixed(2)} µm`],
  ["pixel_size", ["spread_px"], "cylinder, spread of the diameter", (v) => `${v.toFixed(3)} px`],
  ["fit", ["held_out", "normal_error_deg", "mean"], "normal error, presses not learnt from", (v) => `${v.toFixed(2)}°`],
  ["fit", ["training", "unlikeness"], "the like unit's presses alone, slopes off by", (v) => `${(100 * v).toFixed(0)} %`],
  ["fit", ["training", "cpu_seconds"], "training", (v) => `${v.toFixed(1)} CPU s`],
  ["verify", ["true_depth_mm"], "depth error in contact, fresh presses", (v) => `${(v * 1000).toFixed(1)} µm`],
  ["verify", ["depth_mm"], "of it in the shape (the mean of each press is off)", (v) => `${(v * 1000).toFixed(1)} µm`],
  ["verify", ["normal_deg"], "normal error, fresh presses", (v) => `${v.toFixed(2)}°`],
];

/** Return [name, text] for each figure that is known. */
export function figureRows(figures) {
  return FIGURES.flatMap(([step, path, name, write]) => {
    const value = path.reduce((inner, key) => inner?.[key], figures[step]);
    return typeof value === "number" ? [[name, write(value)]] : [];
  });
}
